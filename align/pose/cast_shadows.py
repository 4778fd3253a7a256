"""The scale of a scan by the table beside it: what shadows the scan casts there, and what shadows the balls cast.

A scan that is too large looks right farther away. Its shadow tells where the table lies, in the scan's millimetres; the
balls' shadows tell where the same table lies in those of their diameters. Neither scan nor balls need to touch it.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import FinalEvidence
from align.pose.photographed import Photographs, longer_side
from align.pose.scan_view import View
from align.pose.shading import ShadedSamples, find_shadows, take_samples
from scene.lights import Lights
from scene.normals import unit

Array = NDArray[np.float64]

SAMPLES = 1000
"""Pixels, about, of the table."""
AROUND, MARGIN_PX = 0.75, 4.0
"""How far around the scan, in its size, and around each ball, in its diameter, they lie; and how far from both."""
LOSS = 0.3
"""Of a pixel's rms over the frames: where Geman and McClure's loss [Geman1987] bends. A shadow takes nearly all light;
what a table is other than matte changes less."""
REWEIGHTED, RIDGE = 4, 1e-3
"""Rounds of the least squares; of a matrix' mean diagonal or largest value: what is not told stays small."""
TILTS, AZIMUTHS = np.tan(np.radians([0, 12, 24, 36, 48, 58])), 10
"""Of the tables that are tried first: slopes against the image, and in how many directions."""
STEPS, SEARCHES, SHRINK = np.diag([0.1, 0.1, 0.02, 0.05]), 3, -0.4
"""First steps of the search, see `ShadowedTable.residuals`; how often it begins, and how steps shrink each time."""
BESIDE = np.diag([0.03, 0.03, 0.005, 0.01])
"""Steps by which shadows' borders move by about their own width: over them the loss is a parabola."""
SEEN = 3.0
"""Standard deviations, over the frames, by which shadows must explain the photographs better than none do."""
LEAST, DEVIATIONS = 0.02, 4.0
"""How far from 1 a scale must be, and by how many sigmas, for a word: tables are no planes, and lamps no points."""


@dataclass(frozen=True)
class ScanScale:
    """By how much larger the scan would have to be."""

    scale: float
    sigma: float
    """Relative."""

    @property
    def warning(self) -> str | None:
        """What to say of a scale that is not 1; None where it may be."""
        log = float(np.log(self.scale))
        if abs(log) < max(LEAST, DEVIATIONS * self.sigma):
            return None
        large, small = ("small", "large") if log > 0 else ("large", "small")
        return (
            f"scan: by its shadow on the table it is {np.exp(abs(log)):.3f} times too {large} (+- {self.sigma:.1%}). "
            f"One length is wrong: the scan is too {large} (scan_unit), or diameter_mm of all the balls is too "
            f"{small}, or the lights' file is in another unit. Lights and distance are wrong until then: measure a "
            "ball and the object with calipers."
        )


@dataclass(frozen=True)
class ShadowedTable:
    """What photographs show of a plane beside a scan and balls, which cast shadows on it."""

    view: View
    """The scan at its pose."""
    lights: Lights
    centers: Array
    """(B, 3): of the balls, mm."""
    radii: Array
    """(B,), mm."""
    samples: ShadedSamples

    @cached_property
    def rays(self) -> Array:
        """(P, 3) unit: of the samples' pixels."""
        return self.view.camera.rays(self.samples.pixels)[1]

    @cached_property
    def across(self) -> Array:
        """(P, 3): one, and the pixels' places in the picture."""
        pixels = self.samples.pixels - self.samples.pixels.mean(0)
        return np.column_stack([np.ones(len(pixels)), 2 * pixels / np.ptp(pixels)])

    def residuals(self, found: Array, *, scan: bool = True, balls: bool = True) -> Array:
        """Return (N, P), over `LOSS`: samples less what a table shows under the shadows of scan and balls.

        `found` (4,): slopes of the table's normal, and the logarithms of the table's depth behind the scan's middle,
        in units of the scan, and of the scan's scale. Each pixel has its albedo; how each frame's light differs from
        the calibrated one may slope over the picture.
        """
        normal = unit(np.array([found[0], found[1], 1.0]))
        points = self.rays * (normal @ self.view.pivot * np.exp(found[2] + found[3]) / (self.rays @ normal))[:, None]
        vectors = self.lights.toward(points)
        lit = np.maximum(vectors @ normal, 0)
        for center, radius in zip(self.centers, self.radii, strict=True) if balls else ():
            away = center - points
            along = np.einsum("npk,pk->np", unit(vectors), away)
            lit *= (along < 0) | ((away * away).sum(1) - along**2 > radius**2)
        if scan:
            # The same shadows as of the scan as it is, when table and lights are nearer by its scale.
            size, lights = np.exp(found[3]), self.lights
            if lights.positions_mm is not None:
                lights = replace(lights, positions_mm=lights.positions_mm / size)
            lit *= ~find_shadows(self.view, lights, points / size, np.broadcast_to(normal, points.shape))
        return self._unexplained(lit)

    def _unexplained(self, lit: Array) -> Array:
        values, used = self.samples.values / self.samples.scale, ~self.samples.clipped
        weight, gain, residuals = used.astype(np.float64), np.ones((len(values), 1)), np.zeros(values.shape)
        for _ in range(REWEIGHTED):
            shown = gain * lit
            albedo = (weight * shown * values).sum(0) / np.maximum((weight * shown * shown).sum(0), 1e-12)
            basis = (albedo * lit)[..., None] * self.across
            square = np.swapaxes(basis, 1, 2) @ (weight[..., None] * basis)
            square += (RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] + 1e-9) * np.eye(3)
            slopes = np.linalg.solve(square, np.einsum("npi,np->ni", basis, weight * values)[..., None])[..., 0]
            gain = np.maximum(slopes @ self.across.T, 0)
            residuals = np.where(used, values - gain * albedo * lit, 0) / LOSS
            weight = used / (1 + residuals**2) ** 2
        return residuals

    def costs(self, found: Array, **shadows: bool) -> Array:
        """Return the mean loss of each frame (N,), 0 to 1; `shadows`, see `residuals`."""
        square = self.residuals(found, **shadows) ** 2
        return (square / (1 + square)).mean(1)

    def seen(self, found: Array, **shadows: bool) -> bool:
        """Whether the photographs show the shadows that are False in `shadows`."""
        gain = self.costs(found, **shadows) - self.costs(found)
        return bool(gain.mean() > SEEN * gain.std() / np.sqrt(len(gain)))

    def starts(self) -> list[Array]:
        """Return tables of any tilt: the scan stands on them, and so do the balls, or not; or it floats."""
        mesh, out = self.view.caster.mesh, []
        vertices = self.view.pose.apply(mesh.vertices)
        for tilt, turn in product(TILTS, 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS):
            slopes = tilt * np.array([np.cos(turn), np.sin(turn)])
            normal = unit(np.append(slopes, 1.0))
            foot, balls = (vertices @ normal).min(), (self.centers @ normal - self.radii).min()
            for table, scale in ((foot, 1.0), (foot, balls / foot), (foot - mesh.radius_mm, 1.0)):
                out.append(np.array([*slopes, np.log(table / (normal @ self.view.pivot)), np.log(scale)]))
        return out[3 * (AZIMUTHS - 1) :]

    def fitted(self) -> Array:
        """Return what explains the photographs best (4,), see `residuals`."""
        from scipy.optimize import minimize

        def cost(found: Array) -> float:
            return float(self.costs(found).mean())

        found, steps = min(self.starts(), key=cost), STEPS
        for _ in range(SEARCHES):
            how = {"initial_simplex": [found, *(found + steps)], "maxfev": 160, "xatol": 3e-4, "fatol": 1e-6}
            found, steps = minimize(cost, found, method="Nelder-Mead", options=how).x, SHRINK * steps
        return found

    def sigma(self, found: Array) -> float:
        """Return the standard deviation of the log scale, by the infinitesimal jackknife over frames [Efron1981]."""
        pulls = np.stack([self.costs(found + one) - self.costs(found - one) for one in BESIDE])
        bends = [
            sum(a * b * self.costs(found + a * one + b * two).sum() for a, b in product((1, -1), repeat=2))
            for one, two in product(BESIDE, repeat=2)
        ]
        values, vectors = np.linalg.eigh(np.reshape(bends, (4, 4)))
        inverse = (vectors / np.maximum(values, RIDGE * values.max())) @ vectors.T
        moved = 2 * BESIDE[3, 3] * inverse[3] @ (pulls - pulls.mean(1, keepdims=True))
        return float(np.sqrt((moved**2).sum() * len(moved) / max(len(moved) - 4, 1)))


def shadow_scale(evidence: FinalEvidence, photographs: Photographs) -> ScanScale | None:
    """Return the scale of a scan by its shadow; None where balls of known size, a table or shadows are not seen.

    Its sigma has the balls' depths, which are as unsure as their radii in the picture.
    """
    seen = evidence.seen
    known = [ball for ball in photographs.spheres if ball.diameter_mm and not ball.apart]
    if not known or seen.camera.is_orthographic or not evidence.used.any():
        return None
    around, beside = seen.near < AROUND * longer_side(seen.mask), seen.near > MARGIN_PX
    for ball in known:
        around |= ball.mask(seen.camera, grow_px=2 * AROUND * ball.radius_px)
        beside &= ~ball.mask(seen.camera, grow_px=MARGIN_PX)
    samples = take_samples(photographs.frames, seen.lights, around & beside, count=SAMPLES)
    centers = np.stack([ball.center_mm(seen.camera) for ball in known])
    table = ShadowedTable(evidence.view, seen.lights, centers, np.array([ball.radius_mm for ball in known]), samples)
    found = table.fitted()
    if not (table.seen(found, scan=False) and table.seen(found, balls=False)):
        return None
    depths = [np.hypot(ball.sigma_px / ball.radius_px, ball.diameter_sigma) for ball in known]
    sigma = np.hypot(table.sigma(found), np.sum(np.maximum(depths, 1e-4) ** -2.0) ** -0.5)
    return ScanScale(float(np.exp(found[3])), float(sigma))
