"""The registered scan as a witness of the lights: what its own shading says of each light's direction and intensity.

Under the right light a matte scan shades as the photograph does. What is left over, frame by frame, is explained by a
change of that frame's light vector, relative: across it a turn, along it a change of the intensity.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import trust
from align.pose.photographed import Photographs
from align.pose.refine import robust_sigma
from align.pose.scan_view import View
from align.pose.shading import Samples, choose, cosines, find_shadows, take_samples
from scene.lights import Lights
from scene.normals import unit

Array = NDArray[np.float64]
PIXELS = 4000  # that are asked
PARTS = 8  # sectors of the object, each left out once: what holds for seven must hold for the eighth
ROUNDS, REWEIGHTED = 5, 3  # albedo and lights in turns, and weights
LOOSE = 100.0  # times its sigma, by which a light may be off that the scan contradicts
FEWEST = 50  # samples that a frame needs in all but one sector
LEAST_DEG, LEAST_SHARE = 1.0, 0.05  # a turn, and a relative change of intensity, worth a word
SIGMAS, EXPLAINS = 3.0, 0.2
"""Standard deviations, of light and witness together, beyond which a light is off, and share of its frame's misfit on
sectors left out that the change must explain."""


class Witness(NamedTuple):
    """What the scan says of N lights."""

    change: Array  # (N, 3) to be added to the unit direction: across it radians, along it the intensity's logarithm
    covariance: Array  # (N, 3, 3)
    explains: Array  # (N,) share of the frame's misfit, on sectors left out, that the change takes away

    @property
    def moved(self) -> NDArray[np.bool_]:
        """(N,): whether a change explains sectors that it was not fitted to."""
        return self.explains > EXPLAINS

    def turn_deg(self, lights: Lights) -> Array:
        """Return (N,), by how much the directions are off."""
        return np.rad2deg(np.linalg.norm(self.change - _along(self.change, lights), axis=1))

    def brighter(self, lights: Lights) -> Array:
        """Return (N,), by which the intensities are too low, relative."""
        return np.sum(self.change * lights.directions, 1)

    def off(self, lights: Lights) -> NDArray[np.bool_]:
        """Return (N,), which lights the scan contradicts."""
        turned, brighter = self.turn_deg(lights), np.abs(self.brighter(lights))
        across, along = _sigmas(self.covariance, lights)
        turn = np.hypot(np.rad2deg(across), np.nan_to_num(lights.direction_sigma_deg))
        share = np.hypot(along, np.nan_to_num(lights.intensity_sigma))
        off = (turned > np.maximum(LEAST_DEG, SIGMAS * turn)) | (brighter > np.maximum(LEAST_SHARE, SIGMAS * share))
        return off & self.moved


def ask_scan(view: View, photographs: Photographs) -> Witness:
    """Return what the scan's shading at its pose says of the lights.

    Notes
    -----
    E = a n.(v + |v| c): a pixel's value E, its albedo a, the scan's normal n, the light's vector v there, c the change.
    Albedo from all frames and c by robust least squares in turns; the intensities' common factor is the albedo's. The
    covariance is the jackknife's over sectors [Efron1981]: gloss and bounced light err over whole regions.
    """
    lights = photographs.lights
    samples = take_samples(photographs.frames, lights, photographs.mask, count=PIXELS)
    surface = view.surface(*photographs.camera.rays(samples.pixels))
    # Which pixels are lit hangs on the lights' directions: they are chosen again under the turned ones.
    first = _Shaded.of(view, lights, samples, *surface).change()
    first -= _along(first, lights)
    shaded = _Shaded.of(view, _changed(lights, first), samples, *surface)
    angle = np.arctan2(*(shaded.pixels - shaded.pixels.mean(0)).T[::-1])
    part = ((angle / (2 * np.pi) + 0.5) * PARTS).astype(int) % PARTS
    without, before, after = [], np.zeros(len(lights)), np.zeros(len(lights))
    for k in range(PARTS):
        one, rest = shaded.only(part == k), shaded.only(part != k)
        without.append(rest.change())
        before += one.misfit(-first)
        after += one.misfit(without[-1])
    spread = np.stack(without) - np.mean(without, axis=0)
    covariance = (PARTS - 1) / PARTS * np.einsum("kni,knj->nij", spread, spread)
    explains = np.where(before > 0, 1 - after / np.maximum(before, 1e-12), 0.0)
    found = Witness(first + shaded.change(), covariance, explains)
    return found._replace(covariance=covariance + _of_the_model(found, lights))


class _Shaded(NamedTuple):
    """P pixels of the scan under N lights."""

    pixels: Array  # (P, 2)
    values: Array  # (N, P) relative to the pixel's scale, 0 where not used
    used: NDArray[np.bool_]  # (N, P)
    cosines: Array  # (N, P) light vector . normal
    slopes: Array  # (N, P, 3) of these by the change
    directions: Array  # (N, 3) of the lights

    @classmethod
    def of(cls, view: View, lights: Lights, samples: Samples, points: Array, normals: Array) -> "_Shaded":
        shadows = find_shadows(view, lights, points, normals)
        vectors = np.nan_to_num(lights.toward(points))
        used = choose(samples, normals, vectors, shadows)
        slopes = np.linalg.norm(vectors, axis=-1, keepdims=True) * np.nan_to_num(normals)
        values = np.where(used, samples.values, 0) / samples.scale
        return cls(samples.pixels, values, used, cosines(vectors, normals), slopes, lights.directions)

    def only(self, some: NDArray[np.bool_]) -> "_Shaded":
        """Return some of the pixels (P,)."""
        return self._replace(
            pixels=self.pixels[some],
            values=self.values[:, some],
            used=self.used[:, some],
            cosines=self.cosines[:, some],
            slopes=self.slopes[:, some],
        )

    def _residuals(self, change: Array) -> tuple[Array, Array, Array]:
        """Return residuals and weights (N, P), and the albedo (P,) that the changed lights make best."""
        b = self.cosines + np.einsum("npi,ni->np", self.slopes, change)
        weight = self.used.astype(np.float64)
        albedo, residuals = np.zeros(b.shape[1]), self.values
        for _ in range(REWEIGHTED):
            albedo = (weight * b * self.values).sum(0) / np.maximum((weight * b * b).sum(0), 1e-12)
            residuals = np.where(self.used, self.values - albedo * b, 0.0)
            weight = trust(self.used, residuals)
        return residuals, weight, albedo

    def misfit(self, change: Array) -> Array:
        """Return (N,), each frame's sum of weighted squares under changed lights."""
        residuals, weight, _ = self._residuals(change)
        return np.sum(weight * residuals**2, 1)

    def change(self) -> Array:
        """Return (N, 3), the change of each light that explains the frames best; 0 where a frame shows too little."""
        change = np.zeros((len(self.values), 3))
        for _ in range(ROUNDS):
            residuals, weight, albedo = self._residuals(change)
            slopes = albedo[:, None] * self.slopes
            normal = np.einsum("np,npi,npj->nij", weight, slopes, slopes) + 1e-6 * np.eye(3)
            step = np.linalg.solve(normal, np.einsum("np,npi,np->ni", weight, slopes, residuals)[..., None])[..., 0]
            change = np.where((self.used.sum(1) >= FEWEST)[:, None], change + step, 0.0)
            # A factor that all lights share is the albedo's.
            change -= np.mean(np.sum(change * self.directions, 1)) * self.directions
        return change


def refined(lights: Lights, witness: Witness) -> Lights:
    """Return the lights as they are by calibration and scan together, each as sure as it is.

    Only lights whose change explains sectors that it was not fitted to are moved. Where the scan contradicts the
    calibration it alone is believed; what is not known of a light is no bar.
    """
    off, moved = witness.off(lights), witness.moved
    wide = np.where(off, LOOSE, 1.0)
    turn = np.deg2rad(np.nan_to_num(lights.direction_sigma_deg, nan=180.0)) * wide
    share = np.nan_to_num(lights.intensity_sigma, nan=1.0) * wide
    along = _outer(lights)
    known = (turn**2)[:, None, None] * (np.eye(3) - along) + (share**2)[:, None, None] * along
    known += 1e-12 * np.eye(3)
    gain = known @ np.linalg.inv(known + witness.covariance) * moved[:, None, None]
    change = np.einsum("nij,nj->ni", gain, witness.change)
    left = known - gain @ known
    across_sigma, along_sigma = _sigmas(left, lights)
    told = [["moved by the scan's shading"] if one else [] for one in moved]
    return replace(
        _changed(lights, change),
        direction_sigma_deg=np.where(moved, np.rad2deg(across_sigma), lights.direction_sigma_deg),
        intensity_sigma=np.where(moved, along_sigma, lights.intensity_sigma),
        flags=tuple((*flag, *more) for flag, more in zip(lights.flags, told, strict=True)),
    ).normalised()


def _changed(lights: Lights, change: Array) -> Lights:
    """Return the lights with a change (N, 3); near ones are turned about the reference point."""
    along = _along(change, lights)
    directions = unit(lights.directions + change - along)
    positions = lights.positions_mm
    if positions is not None:
        far = np.linalg.norm(positions - lights.reference_point_mm, axis=1, keepdims=True)
        positions = lights.reference_point_mm + far * directions
    brighter = np.exp(np.sum(along * lights.directions, 1, keepdims=True))
    return replace(lights, directions=directions, positions_mm=positions, intensities=lights.intensities * brighter)


def said(lights: Lights, witness: Witness) -> list[str]:
    """Return the warning that names the lights that the scan contradicts."""
    off = np.flatnonzero(witness.off(lights))
    if not len(off):
        return []
    turn, brighter = witness.turn_deg(lights), witness.brighter(lights)
    listed = ", ".join(f"{lights.names[n]} (by {turn[n]:.1f} degrees, {brighter[n]:+.0%} intensity)" for n in off)
    return [
        f"the scan's own shading says that lights are off: {listed}. Look at their highlights; reshoot, list them "
        "under frames.skip, or let the scan correct them with --refine-lights."
    ]


def _of_the_model(found: Witness, lights: Lights) -> Array:
    """Return (N, 3, 3), what the changes scatter by beyond what is known of light and witness: no object is matte."""
    across, along = _sigmas(found.covariance, lights)
    turn = np.median(np.deg2rad(found.turn_deg(lights))) / np.sqrt(2 * np.log(2))
    share = robust_sigma(found.brighter(lights))
    known = np.deg2rad(np.nan_to_num(lights.direction_sigma_deg)), np.nan_to_num(lights.intensity_sigma)
    turn_left = max(turn**2 - np.median(across**2 + known[0] ** 2), 0.0)
    share_left = max(share**2 - np.median(along**2 + known[1] ** 2), 0.0)
    return turn_left * (np.eye(3) - _outer(lights)) + share_left * _outer(lights)


def _sigmas(covariance: Array, lights: Lights) -> tuple[Array, Array]:
    """Return the standard deviations (N,) across, one axis, and along the lights."""
    along = np.einsum("nij,nij->n", _outer(lights), covariance)
    across = np.trace(covariance, axis1=1, axis2=2) - along
    return np.sqrt(np.maximum(across, 0) / 2), np.sqrt(np.maximum(along, 0))


def _outer(lights: Lights) -> Array:
    return lights.directions[:, :, None] * lights.directions[:, None, :]


def _along(change: Array, lights: Lights) -> Array:
    return np.sum(change * lights.directions, 1, keepdims=True) * lights.directions
