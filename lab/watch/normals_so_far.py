"""How well the object's normals are known by the flashes so far, and which flash would help most."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere

Array = NDArray[np.float64]
FIRST, AGAIN = 4, 2
"""Frames with which the object is first looked for; how many times as many there are when it is looked for again."""
PIXELS = 4000
"""Of the object that are looked at, at most, evenly over the picture."""
FLOOR = 0.1
"""Of the median sample: under it noise falls no further."""
ZENITHS_DEG, AZIMUTHS_DEG = (10, 25, 40, 55, 70), range(0, 360, 20)
"""Where the next flash may stand: angle from the camera's axis, and around it, 0 right, 90 up."""
GRAZING = 0.1
"""Cosine between normal and light under which a flash is not counted on: shadows."""


@dataclass(frozen=True)
class NextFlash:
    """Where the next flash helps most.

    Parameters
    ----------
    zenith_deg, azimuth_deg, distance_mm
        As `Lights.facts` tells them; distance None of distant lights.
    sigma_deg, before_deg : float
        The object's median sigma with it, and now.
    """

    zenith_deg: float
    azimuth_deg: float
    distance_mm: float | None
    sigma_deg: float
    before_deg: float


@dataclass(frozen=True)
class Known:
    """What is known of the normals.

    Parameters
    ----------
    sigma_deg : (h, w) float64
        Standard deviation of each normal along one tangent axis, noise and the lights' own sigma; NaN off the object.
    next_flash : NextFlash
    """

    sigma_deg: Array
    next_flash: NextFlash

    @property
    def median_deg(self) -> float:
        return float(np.nanmedian(self.sigma_deg))

    def share_under(self, wanted_deg: float) -> float:
        """Return the share of the object whose sigma is that small."""
        inside = np.isfinite(self.sigma_deg)
        return float(np.mean(self.sigma_deg[inside] < wanted_deg)) if inside.any() else 0.0


class NormalsSoFar:
    """The object's mask, found once and again, and its normals' sigma."""

    def __init__(self) -> None:
        self._mask: NDArray[np.bool_] | None = None
        self._looked_with = 0
        self.why = "waits for lights"
        """Why nothing is known; empty where it is."""

    def is_due(self, count: int) -> bool:
        """Whether the object is to be looked for, with so many frames."""
        return count >= max(FIRST, AGAIN * self._looked_with)

    def find_object(self, frames: Frames, camera: Camera, spheres: Sequence[Sphere]) -> None:
        """Look for the object in frames that are reduced, with their camera and balls."""
        from align.mask.object_mask import find_object

        self._looked_with = len(frames)
        try:
            self._mask = find_object(frames, camera, list(spheres)).mask
        except SceneError as error:
            self.why = str(error)

    def update(self, frames: Frames, camera: Camera, lights: Lights) -> Known | None:
        """Return what is known now; None, and `why`, where it cannot be said yet.

        Notes
        -----
        b = albedo x normal by the method `iterative`; a sample's noise is a share of its brightness, by the scatter of
        the residuals, so that gloss and shadow count too; the lights' sigma adds to it. See `solve.design`.
        """
        from solve.solve import solve

        if self._mask is None:
            return None
        step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(self._mask) / PIXELS))))
        some, view, mask = frames.every(step), camera.every(step), self._mask[::step, ::step]
        try:
            estimate = solve("iterative", some, lights, view, mask)
        except SceneError as error:
            self.why = str(error)
            return None
        b_map = estimate.normals * estimate.albedo.mean(-1, keepdims=True)
        inside = np.isfinite(b_map[..., 0]) & (np.linalg.norm(b_map, axis=-1) > 0)
        if not inside.any():
            self.why = "no part of the object is lit by three flashes"
            return None
        self.why = ""
        v, u = np.nonzero(inside)
        depth = float(lights.reference_point_mm[2])
        points = view.points_at_depth(np.stack([u, v], -1), depth) if depth < 0 else np.zeros((len(u), 3))
        samples = some.read()[:, v, u].mean(-1).astype(np.float64)
        clipped = some.saturated()[:, v, u]
        sigma, following = _known(b_map[v, u].astype(np.float64), samples, ~clipped, points, lights)
        sigma_map = np.full(mask.shape, np.nan)
        sigma_map[v, u] = sigma
        return Known(sigma_map, following)


def _known(
    b: Array, samples: Array, unclipped: NDArray[np.bool_], points: Array, lights: Lights
) -> tuple[Array, NextFlash]:
    """Return each pixel's sigma, and the next flash; b (P, 3), samples (F, P), points (P, 3)."""
    from solve.design.next_flash import gains, known_before, with_flash
    from solve.design.normal_information import information, sigma_of_normals

    strength = lights.intensities.mean(1)[:, None, None]
    vectors = strength * lights.toward(points)
    shown = np.einsum("fpi,pi->fp", vectors, b)
    floor = FLOOR * float(np.median(shown[shown > 0]))
    # What is much darker than its shading lies in a shadow, what is much brighter in a highlight.
    seen = unclipped & (shown > floor) & (samples > 0.5 * shown) & (samples < 2 * shown)
    share = _scatter(samples - shown, np.maximum(shown, floor), seen)
    tilt = np.radians(np.nan_to_num(lights.direction_sigma_deg))
    noise = np.hypot(share * np.maximum(shown, floor), _by_direction(vectors, b, tilt))
    covariances = known_before(b, information(vectors, noise, seen))
    sigma = sigma_of_normals(b, covariances)
    places, candidates = _candidates(lights)
    further = candidates.toward(points)
    more = np.einsum("cpi,pi->cp", further, b)
    length = np.linalg.norm(further, axis=-1) * np.linalg.norm(b, axis=-1)
    lit = more > GRAZING * length
    usual = np.full(len(places), np.median(tilt))
    more_noise = np.hypot(share * np.maximum(more, floor), _by_direction(further, b, usual))
    best = int(gains(b, covariances, further, more_noise, lit).argmax())
    after = sigma_of_normals(b, with_flash(covariances, further[best], more_noise[best], lit[best]))
    place = None if candidates.positions_mm is None else candidates.positions_mm[best]
    away = None if place is None else float(np.linalg.norm(place - lights.reference_point_mm))
    return sigma, NextFlash(*places[best], away, float(np.median(after)), float(np.median(sigma)))


def _scatter(residuals: Array, scale: Array, seen: NDArray[np.bool_]) -> float:
    """Return the standard deviation of the residuals (F, P) as a share of `scale`, from their median."""
    enough = seen & (seen.sum(0) > 3)
    if not enough.any():
        return 0.02
    counts = np.broadcast_to(seen.sum(0), seen.shape)[enough]
    # Three numbers were fitted to each pixel's samples.
    free = np.sqrt(counts / (counts - 3))
    return float(max(1.4826 * np.median(np.abs(residuals[enough] / scale[enough]) * free), 1e-4))


def _by_direction(vectors: Array, b: Array, sigma: Array) -> Array:
    """Return (F, P), what a light's direction that is off by sigma (F,), radians a tangent axis, does to a sample."""
    length = np.linalg.norm(vectors, axis=-1)
    along = np.einsum("fpi,pi->fp", vectors, b) / np.maximum(length, 1e-12)
    return sigma[:, None] * length * np.sqrt(np.maximum(np.sum(b * b, -1) - along**2, 0))


def _candidates(lights: Lights) -> tuple[list[tuple[float, float]], Lights]:
    """Return places of the next flash, (zenith, azimuth), and its lights there: as far and as bright as the others."""
    places = [(float(zenith), float(azimuth)) for zenith in ZENITHS_DEG for azimuth in AZIMUTHS_DEG]
    zenith, azimuth = np.radians(places).T
    directions = np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], -1)
    point, positions = lights.reference_point_mm, None
    if lights.positions_mm is not None:
        away = float(np.median(np.linalg.norm(lights.positions_mm - point, axis=1)))
        positions = point + away * directions
    names = tuple(f"{zenith:g}, {azimuth:g}" for zenith, azimuth in places)
    return places, Lights(names, directions, np.ones((len(places), 3)), positions, point)
