"""Point lights and perspective: the depth of every pixel is found with its normal, in turn."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from solve.pixelwise import iterative
from solve.samples import GRAY, Geometry, bands, points_of, read_band, scale_of
from solve.surface.integration import Surface, integrate
from solve.whole.depth_evidence import depth_evidence

Array = NDArray[np.float64]

POSITIONS = True

SETTINGS = {**iterative.SETTINGS, "rounds": 5, "depth_tolerance": 3e-4, "roughness_px": 0.11}

SEED_SETTINGS = {**iterative.SEED_SETTINGS, "rounds": 5, "depth_tolerance": 3e-4, "roughness_px": 0.11}
"""The same turns about the plain reading of `iterative`. (The seed has no such method.)"""

_SCALE_PIXELS = 20_000
"""Pixels that the object's distance is told by, at most."""
_UNKNOWN = 0.05
"""Standard deviation of the distance, as a share of the lights', from which the shading is not asked about depth."""
_ALIKE = 100
"""Pixels whose errors are taken to be one and the same: gloss and mutual light come in patches."""


def fit(gray, valid, points, directions, positions, reach, is_near, scale, *, rounds, depth_tolerance, roughness_px,
        **settings):  # fmt: skip
    """Fit b = albedo x normal as `solve.pixelwise.iterative.fit` does; `points` are from `find_depth`.

    Parameters
    ----------
    gray, valid, points, directions, positions, reach, is_near, scale
        See `solve.pixelwise.ls.fit`.
    rounds, depth_tolerance, roughness_px
        Of `find_depth`.
    **settings
        Of `solve.pixelwise.iterative.fit`.

    Returns
    -------
    b : (P, 3) float64
    used : (P, F) bool
    """
    return iterative.fit(gray, valid, points, directions, positions, reach, is_near, scale, **settings)


def find_depth(
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    *,
    rounds: int,
    depth_tolerance: float,
    roughness_px: float,
    **settings,
) -> tuple[Array | None, tuple[str, ...]]:
    """Return the depth of each pixel under the mask, and why it should not be believed.

    Parameters
    ----------
    frames, lights, camera, mask
        See `solve.solve.solve`.
    rounds : int
        Times that normals and depth are found in turn, at most.
    depth_tolerance : float
        At rest when nine tenths of the pixels move less than this share of the lights' distance.
    roughness_px : float
        By how much a neighbour may lie off a pixel's tangent plane, in pixels: what the shading says of depth weighs
        less the smaller this is.
    **settings
        Of `solve.pixelwise.iterative.fit`.

    Returns
    -------
    z_mm : (H, W) float64 or None
        Camera frame. None: the lights have no positions, and depth would change nothing.
    doubts : tuple of str

    Notes
    -----
    As in [Queau2018]: normals under the lights as each pixel's place sees them,
    l_f(p) = reach_f (q_f - p) / |q_f - p|^3; these integrated to depth (`solve.surface.integration`); again. It starts
    at the depth of `lights.reference_point_mm`.

    The shading itself tells depth, too, since only one place on the ray makes all samples agree (`depth_evidence`): a
    step t and its sigma for each pixel, whose median, weighted by 1 / sigma^2, first moves the whole object; then
    they are hints to the integration, weighed by (roughness / sigma)^2 / (1 + (t / 3 sigma)^2)^2. So parts that an
    edge of depth separates find their places, and drift cannot build up. The object's distance needs no ball.

    Do not believe it where the lights' positions are wrong by per cents of their distance (normals and depth follow
    them), nor where most pixels are glossy or lit by their neighbours: the shading's depth is then biased, by some
    per cent of the distance. Light is taken to leave a flash alike to all sides that the object is on.
    """
    if lights.positions_mm is None:
        return None, ("the lights have no positions: this is `iterative`.",)
    task = _Task(frames, lights, camera, mask, scale_of(frames, lights, mask), settings)
    reference = float(lights.reference_point_mm[2])
    level = np.where(mask, reference, np.nan)
    normals, *_ = task.look(level)
    if not np.isfinite(normals[mask]).all(-1).any():
        return level, ()
    surface = integrate(normals, mask, camera, z_mm=reference)
    z_mm, sigma = task.placed(_filled(surface.z_mm, mask))
    doubts = []
    told = sigma < _UNKNOWN
    if not told:
        doubts.append(
            "the lights are too far, or too few, to tell the object's distance: it is taken to be that of their "
            "reference point."
        )
    moved = np.inf
    for _ in range(rounds):
        normals, step, spread = task.look(z_mm)
        if told:
            hint, weight = task.moved(z_mm, np.clip(step, -0.3 * task.unit, 0.3 * task.unit)), _weight(step, spread)
            weight *= (roughness_px / np.sqrt(camera.fx * camera.fy)) ** 2
            middle = float(np.median(z_mm[mask]))
            surface = integrate(normals, mask, camera, z_mm=middle, start=z_mm, hint_mm=hint, hint_weight=weight)
        else:
            surface = integrate(normals, mask, camera, z_mm=reference, start=z_mm)
        before, z_mm = z_mm, _filled(surface.z_mm, mask)
        moved = float(np.percentile(np.abs(z_mm - before)[mask], 90)) / task.distance
        if moved < depth_tolerance:
            break
    return z_mm, (*doubts, *_doubts(surface, moved, depth_tolerance))


def _weight(step: Array, spread: Array) -> Array:
    """Return the weight of a hint beside an edge's, for a roughness of 1."""
    known = np.isfinite(spread) & (spread > 0)
    spread = np.where(known, spread, 1.0)
    return np.where(known, 1 / (spread**2 * (1 + (step / (3 * spread)) ** 2) ** 2), 0.0)


def _doubts(surface: Surface, moved: float, tolerance: float) -> list[str]:
    doubts = []
    if moved > 5 * tolerance:
        doubts.append(
            f"depth did not come to rest: it still moved by {moved:.1%} of the lights' distance in the last round."
        )
    torn = surface.torn_share()
    if torn > 0.1:
        doubts.append(
            f"{torn:.0%} of the pixels lie at an edge of depth: the normals belong to no surface. Gloss, mutual light, "
            "or wrong positions of the lights."
        )
    return doubts


def _filled(z_mm: Array, mask: NDArray[np.bool_]) -> Array:
    """Give pixels of the mask without a depth that of the nearest one with; NaN outside the mask."""
    known = np.isfinite(z_mm)
    nearest = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
    return np.where(mask, z_mm[tuple(nearest)], np.nan)


@dataclass(frozen=True)
class _Task:
    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    scale: float
    settings: dict

    @property
    def distance(self) -> float:
        """Of the lights, mm."""
        assert self.lights.positions_mm is not None
        return float(np.median(np.linalg.norm(self.lights.positions_mm - self.lights.reference_point_mm, axis=1)))

    @property
    def unit(self) -> float:
        """What a step of 1 is beside the object's distance: perspective, the step is relative; else in mm."""
        return self.distance if self.camera.is_orthographic else 1.0

    def moved(self, z_mm: Array, step: Array | float) -> Array:
        """Return the depth, farther by a step."""
        return z_mm - step if self.camera.is_orthographic else z_mm * np.exp(step)

    def look(self, z_mm: Array) -> tuple[Array, Array, Array]:
        """Return normals (H, W, 3), the step in depth (H, W) that the shading asks for at a depth, and its sigma."""
        mask = np.isfinite(z_mm)
        normals = np.full((*mask.shape, 3), np.nan)
        step, spread = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan)
        squares, count = np.zeros(mask.shape), np.zeros(mask.shape)

        def work(rows: slice) -> None:
            inside = mask[rows]
            points = points_of(self.camera, self.lights, inside, rows, z_mm[rows])
            geometry: tuple = tuple(Geometry.of(self.lights))
            gray, valid = read_band(self.frames, inside, rows).gray((GRAY / self.lights.intensities).astype(np.float32))
            samples: tuple = (gray, valid, points, *geometry, self.scale)
            b, used = iterative.fit(*samples, **self.settings)
            way = points
            if self.camera.is_orthographic:
                way = np.broadcast_to([0.0, 0.0, -1.0], points.shape).copy()
            rest: tuple = (gray, b, used, points, way, *geometry)
            slope, information, left, size = depth_evidence(*rest)
            normals[rows][inside] = unit(b)
            known = information > 0
            step[rows][inside] = np.divide(slope, information, out=np.full(len(b), np.nan), where=known)
            spread[rows][inside] = np.sqrt(np.divide(1, information, out=np.full(len(b), np.nan), where=known))
            squares[rows][inside], count[rows][inside] = left, size

        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            for _ in pool.map(work, bands(self.frames, mask)):
                pass
        sure = count > 3
        variance = np.where(sure, squares / np.maximum(count - 3, 1), np.nan)
        if sure.any():
            # A pixel whose few samples agree by chance is no better than the rest.
            least = max(1e-2 * float(np.median(variance[sure])), (1e-5 * self.scale) ** 2)
            variance = np.maximum(variance, least)
        return normals, step, spread * np.sqrt(variance)

    def placed(self, z_mm: Array) -> tuple[Array, float]:
        """Return the depth moved to where the shading agrees best, and its sigma beside the lights' distance."""
        some = np.zeros(self.mask.shape, bool)
        every = max(1, round(np.sqrt(self.mask.sum() / _SCALE_PIXELS)))
        some[::every, ::every] = self.mask[::every, ::every]
        sigma = np.inf
        moved = z_mm
        for _ in range(8):
            _, step, spread = self.look(np.where(some, moved, np.nan))
            known = np.isfinite(step) & np.isfinite(spread)
            if not known.any():
                return z_mm, np.inf
            weight = 1 / spread[known] ** 2
            sigma = float(np.sqrt(max(_ALIKE / every**2, 1) / weight.sum())) / self.unit
            if sigma > _UNKNOWN:
                return z_mm, sigma
            order = np.argsort(step[known])
            total = np.cumsum(weight[order])
            middle = float(step[known][order][np.searchsorted(total, total[-1] / 2)])
            moved = self.moved(moved, float(np.clip(middle, -0.2 * self.unit, 0.2 * self.unit)))
            if abs(middle) < 1e-4 * self.unit:
                break
        return moved, sigma
