"""The shading: how well the scan's normals, under the calibrated lights, explain the photographs."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import Appearance, Lit, albedo_of, freed_of_appearance
from align.pose.photographed import FEWEST
from align.pose.scan_view import View
from scene.frames import Frames
from scene.lights import Lights

Array = NDArray[np.float64]

GRAZING = 0.12
"""A light lower than this over the surface (cosine) is left out: penumbra and bounced light rule there."""


@dataclass(frozen=True)
class ShadedSamples:
    """What N frames show at P pixels of the object."""

    pixels: Array
    """(P, 2)."""
    values: NDArray[np.float32]
    """(N, P): mean of the channels, each divided by the light's intensity at the reference point."""
    usable: NDArray[np.bool_]
    """(N, P): not saturated, and above the noise."""
    clipped: NDArray[np.bool_]
    """(N, P)."""
    scale: Array
    """(P,): the pixel's rms over its usable samples."""
    colours: NDArray[np.float32]
    """(N, P, 3): linear, as photographed."""

    def under(self, lights: Lights) -> "ShadedSamples":
        """Return the same samples as they are read under lights of other intensities."""
        return samples_of(self.pixels, self.colours, self.clipped, lights)


def take_samples(frames: Frames, lights: Lights, mask: NDArray[np.bool_], *, count: int) -> ShadedSamples:
    """Read about `count` pixels of the mask (H, W), evenly spread, from all frames."""
    inside = np.flatnonzero(mask)
    # Every k-th in scan order lies in slanted rows: even, and without a grid's blind frequencies.
    pick = np.unique(np.linspace(0, len(inside) - 1, min(count, len(inside))).astype(int))
    v, u = np.divmod(inside[pick], mask.shape[1])
    read = (frames.read_pixels(index, v, u) for index in range(len(frames)))
    colours, clipped = map(np.stack, zip(*read, strict=True))
    return samples_of(np.stack([u, v], -1).astype(np.float64), colours, clipped, lights)


def samples_of(
    pixels: Array, colours: NDArray[np.float32], clipped: NDArray[np.bool_], lights: Lights
) -> ShadedSamples:
    """Return the samples of pixels (P, 2) that show linear `colours` (N, P, 3) under the lights."""
    weight = (1 / lights.intensities / 3).astype(np.float32)
    values = np.einsum("npc,nc->np", colours, weight)
    scale = np.sqrt(np.mean(np.where(clipped, 0, values) ** 2, axis=0)).astype(np.float64)
    floor = 0.05 * np.median(scale)
    usable = ~clipped & (values > 0.1 * scale)
    return ShadedSamples(pixels, values, usable, clipped, np.maximum(scale, floor), colours)


def find_shadows(view: View, lights: Lights, points: NDArray, normals: NDArray) -> NDArray[np.bool_]:
    """Return (N, P): the scan stands between the point and the light."""
    caster, back = view.caster, view.pose.inverse()
    lift = 2e-3 * caster.mesh.radius_mm
    # The inside, seen through a hole, has points but no normals; a ray of NaN would try every triangle.
    known = np.isfinite(points).all(1) & np.isfinite(normals).all(1)
    start = back.apply(points[known] + lift * normals[known])
    out = np.zeros((len(lights), len(points)), bool)
    for index in range(len(lights)):
        if lights.positions_mm is None:
            toward = np.broadcast_to(back.rotate(lights.directions[index]), start.shape)
            far = np.full(len(start), np.inf)
        else:
            toward = back.apply(lights.positions_mm[index]) - start
            far = np.linalg.norm(toward, axis=1)
            toward = toward / far[:, None]
        out[index, known] = caster.blocked(start, toward, far)
    return out


def choose(samples: ShadedSamples, normals: NDArray, vectors: Array, shadows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (N, P): samples that a scan with these normals should explain."""
    b = cosines(vectors, normals)
    used = samples.usable & ~shadows & (b > GRAZING * np.linalg.norm(vectors, axis=-1))
    used &= np.isfinite(normals[:, 0])
    return used & (used.sum(0) >= FEWEST)


class ExplainedShading(NamedTuple):
    """Samples as a scan explains them."""

    residuals: Array
    """(N, P): (measured - albedo * predicted) / the pixel's scale, 0 where not used."""
    albedo: Array
    """(P,), over the pixel's scale."""
    jacobian: Array | None
    """(N, P, 6) of the residuals by `nudge`."""


def explain(
    samples: ShadedSamples,
    used: NDArray[np.bool_],
    normals: NDArray,
    lit: Lit,
    look: Appearance,
    slopes: Array | None = None,
) -> ExplainedShading:
    """Explain samples by normals (P, 3), NaN where the scan is missed, with the best albedo for each pixel.

    `used` (N, P), of `choose`, is held while the pose moves, so that the cost does not jump, and so is the appearance;
    `slopes` (P, 3, 6): the normals', see `View.normal_slopes`. With them there is a Jacobian; residuals and Jacobian
    are then freed of what another appearance would make of them: it follows the pose, as the albedo does.

    With b = predicted and weights w: albedo = sum w b E / sum w b^2 (variable projection [Golub1973]); w falls off for
    samples that the rest of their pixel contradicts. The albedo's slope: sum w (E - 2 albedo b) db / sum w b^2.
    """
    values = np.where(used, samples.values, 0) / samples.scale
    shown = look.predict(lit, normals)
    albedo, weight = albedo_of(values, used, shown, look.loss)
    residuals = np.where(used, values - albedo * shown, 0.0)
    if slopes is None:
        return ExplainedShading(residuals, albedo, None)
    along = np.matmul(look.slopes(lit, normals).transpose(1, 0, 2), slopes)
    square = np.maximum((weight * shown * shown).sum(0), 1e-12)
    drift = np.einsum("np,pnt->pt", weight * (values - 2 * albedo * shown), along) / square[:, None]
    jacobian = -(albedo[:, None, None] * along + shown.T[:, :, None] * drift[:, None, :]).transpose(1, 0, 2)
    if look.around is not None:
        changes = np.concatenate([residuals[..., None], jacobian], -1)
        changes = freed_of_appearance(changes, weight, albedo, shown, lit, normals)
        residuals, jacobian = np.where(used, changes[..., 0], 0.0), changes[..., 1:]
    return ExplainedShading(residuals, albedo, np.where(used[..., None], jacobian, 0.0))


def cosines(vectors: Array, normals: NDArray) -> Array:
    """Return (N, P) light . normal, 0 where the normal is unknown."""
    return np.einsum("npk,pk->np", vectors, np.nan_to_num(normals))
