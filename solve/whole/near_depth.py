"""The depth of every pixel under near lights, found in turn with its normal."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.fan_out import fan_out
from scene.normals import filled, unit
from solve.pixelwise import iterative
from solve.problem import Problem
from solve.samples import bands, read_band, samples_of, scale_of
from solve.surface.integration import IntegratedSurface, integrate
from solve.whole.depth_evidence import depth_evidence

Array = NDArray[np.float64]

_SCALE_PIXELS = 20_000
"""Pixels that the object's distance is estimated from, at most."""
_UNKNOWN = 0.05
"""Standard deviation of the distance, as a share of the lights', from which the shading is not asked about depth."""
_ALIKE = 100
"""Pixels whose errors are taken to be one and the same: gloss and mutual light come in patches."""
_ROUNDS, _AT_REST = 5, 3e-4
"""Times that normals and depth are found in turn, at most; nine tenths of the pixels move less than this share of the
lights' distance when they are at rest."""
_ROUGHNESS_PX = 0.11
"""How far a neighbour may lie off a pixel's tangent plane: the less, the less weighs what the shading says of depth."""


def find_depth(problem: Problem, settings: iterative.IterativeSettings) -> Problem:
    """Return the problem with the depth of each pixel, and cautions; its lights have positions.

    `settings`: of `solve.pixelwise.iterative`, which fits the normals.

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
    camera, mask = problem.camera, problem.mask
    task = _Task(problem, scale_of(problem), settings)
    reference = float(problem.lights.reference_point_mm[2])
    level = np.where(mask, reference, np.nan)
    normals, *_ = task.look(level)
    if not np.isfinite(normals[mask]).all(-1).any():
        return replace(problem, z_mm=level)
    surface = integrate(normals, camera, z_mm=reference)
    z_mm, sigma = task.placed(np.where(mask, filled(surface.z_mm, np.isfinite(surface.z_mm)), np.nan))
    is_known = sigma < _UNKNOWN
    if not is_known:
        problem = problem.warned(
            "the lights are too far, or too few, to tell the object's distance: it is taken to be that of their "
            "reference point."
        )
    moved = np.inf
    for _ in range(_ROUNDS):
        normals, step, spread = task.look(z_mm)
        if is_known:
            hint, weight = task.moved(z_mm, np.clip(step, -0.3 * task.unit, 0.3 * task.unit)), _weight(step, spread)
            weight *= (_ROUGHNESS_PX / np.sqrt(camera.fx * camera.fy)) ** 2
            middle = float(np.median(z_mm[mask]))
            surface = integrate(normals, camera, z_mm=middle, start=z_mm, hint=(hint, weight))
        else:
            surface = integrate(normals, camera, z_mm=reference, start=z_mm)
        before, z_mm = z_mm, np.where(mask, filled(surface.z_mm, np.isfinite(surface.z_mm)), np.nan)
        moved = float(np.percentile(np.abs(z_mm - before)[mask], 90)) / task.distance
        if moved < _AT_REST:
            break
    return replace(problem, z_mm=z_mm).warned(*_cautions(surface, moved))


def _weight(step: Array, spread: Array) -> Array:
    """Return the weight of a hint beside an edge's, for a roughness of 1."""
    known = np.isfinite(spread) & (spread > 0)
    spread = np.where(known, spread, 1.0)
    return np.where(known, 1 / (spread**2 * (1 + (step / (3 * spread)) ** 2) ** 2), 0.0)


def _cautions(surface: IntegratedSurface, moved: float) -> list[str]:
    cautions = []
    if moved > 5 * _AT_REST:
        cautions.append(
            f"depth did not come to rest: it still moved by {moved:.1%} of the lights' distance in the last round."
        )
    torn = surface.torn_share()
    if torn > 0.1:
        cautions.append(
            f"{torn:.0%} of the pixels lie at an edge of depth: the normals belong to no surface. Gloss, mutual light, "
            "or wrong positions of the lights."
        )
    return cautions


@dataclass(frozen=True)
class _Task:
    problem: Problem
    scale: float
    settings: iterative.IterativeSettings

    @property
    def distance(self) -> float:
        """Of the lights, mm."""
        lights = self.problem.lights
        assert lights.positions_mm is not None
        return float(np.median(np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)))

    @property
    def unit(self) -> float:
        """What a step of 1 is beside the object's distance: perspective, the step is relative; else in mm."""
        return self.distance if self.problem.camera.is_orthographic else 1.0

    def moved(self, z_mm: Array, step: Array | float) -> Array:
        """Return the depth, farther by a step."""
        return z_mm - step if self.problem.camera.is_orthographic else z_mm * np.exp(step)

    def look(self, z_mm: Array) -> tuple[Array, Array, Array]:
        """Return normals (H, W, 3), the step in depth (H, W) that the shading asks for at a depth, and its sigma."""
        mask = np.isfinite(z_mm)
        whole = replace(self.problem, mask=mask, z_mm=z_mm)
        normals = np.full((*mask.shape, 3), np.nan)
        step, spread = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan)
        squares, count = np.zeros(mask.shape), np.zeros(mask.shape)

        def work(rows: slice) -> None:
            part = whole.part(rows)
            inside = part.mask
            samples = samples_of(read_band(part), part)
            b, used = iterative.fit(samples, self.scale, self.settings)
            way = samples.points
            if part.camera.is_orthographic:
                way = np.broadcast_to([0.0, 0.0, -1.0], way.shape).copy()
            slope, information, left, size = depth_evidence(samples._replace(valid=used), b, way)
            normals[rows][inside] = unit(b)
            known = information > 0
            step[rows][inside] = np.divide(slope, information, out=np.full(len(b), np.nan), where=known)
            spread[rows][inside] = np.sqrt(np.divide(1, information, out=np.full(len(b), np.nan), where=known))
            squares[rows][inside], count[rows][inside] = left, size

        fan_out(work, list(bands(whole.frames, mask)))
        sure = count > 3
        variance = np.where(sure, squares / np.maximum(count - 3, 1), np.nan)
        if sure.any():
            # A pixel whose few samples agree by chance is no better than the rest.
            least = max(1e-2 * float(np.median(variance[sure])), (1e-5 * self.scale) ** 2)
            variance = np.maximum(variance, least)
        return normals, step, spread * np.sqrt(variance)

    def placed(self, z_mm: Array) -> tuple[Array, float]:
        """Return the depth moved to where the shading agrees best, and its sigma beside the lights' distance."""
        mask = self.problem.mask
        some = np.zeros(mask.shape, bool)
        every = self.problem.step_to(_SCALE_PIXELS)
        some[::every, ::every] = mask[::every, ::every]
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
            middle = float(np.quantile(step[known], 0.5, weights=weight, method="inverted_cdf"))
            moved = self.moved(moved, float(np.clip(middle, -0.2 * self.unit, 0.2 * self.unit)))
            if abs(middle) < 1e-4 * self.unit:
                break
        return moved, sigma
