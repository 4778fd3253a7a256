"""Directions known, intensities not: they are found with the normals. For a flash that does not fire alike.

First each flash's intensity, per channel, from some thousand pixels; then the normals band by band, by `iterative`.
"""

from dataclasses import replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames
from scene.intensities import Evidence, evidence, solve_intensities
from scene.lights import Lights
from scene.reading import listed
from scene.robust import spread
from solve.assess import FACING
from solve.methods import Method
from solve.pixelwise import iterative
from solve.problem import Problem, spread_over
from solve.samples import GRAY, Geometry, Samples, row_medians

PIXELS, ROUNDS = 12_000, 12
"""Pixels from which the intensities are found, evenly spread over the mask, and rounds; both at most. Three to six
rounds are typical."""
CONTRAST = 3.0
"""The next best intensities must leave this many times the misfit of the best."""
SIGMA = 0.1
"""Relative standard deviation beyond which an intensity is not believed."""
_STANDS_STILL = 1e-4
_WORTH_MOVING = 0.02
"""Of a step of depth."""


def find_lights(problem: Problem, settings: iterative.IterativeSettings) -> Problem:
    """Return the problem under lights with the intensities that the object itself tells, and cautions.

    Directions (and positions) are taken as they are; intensities where the object tells none; and a trend of the
    intensities with the direction as far as the object's own reflection could pretend it, see `_pretended`.

    Intensities are on the scale of the given ones, at the reference point; of near lights that is moved to the depth of
    the visible surface that leaves the least misfit. `intensity_sigma`: what is left uncertain, and what that
    depth's own error does.

    From a plane, or with three lights, they are undetermined: then the given ones stay, and a caution says so. Nor can
    that of a light be told without which the rest lie in one plane: it keeps what was given.
    """
    lights = problem.lights
    found, parts, points = told_by_object(problem, settings)
    own, cautions = _believed(lights, found, parts)
    if own is lights:
        return problem.under(lights).warned(*cautions)
    given = lights.seen_from(found.reference_point_mm).intensities
    ratio = np.log(own.intensities / given)
    pretended = _pretended(ratio, parts, found.directions)
    intensities = given * np.exp(ratio - pretended)
    # The scale is a gauge: albedo stays comparable with the other methods'.
    intensities *= np.exp(np.mean(np.log(lights.intensities / intensities), axis=0))
    # Shared by all lights: what the depth does; and what was taken away, which may have been true.
    shared = np.stack([_fall_off(found, points), pretended.mean(1)])
    covariance = np.diag(np.nan_to_num(own.intensity_sigma) ** 2) + shared.T @ shared
    own = replace(own, intensities=intensities, intensity_sigma=np.hypot(own.intensity_sigma, np.hypot(*shared)))
    return replace(problem.under(own), intensity_covariance=covariance).warned(*cautions)


def _pretended(ratio: NDArray, parts: list[Evidence], directions: NDArray) -> NDArray:
    """Return what the object's reflection may pretend of the logs (F, C) of intensities over given ones.

    Notes
    -----
    Lambert's law leaves e_f -> (1 + a . l_f) e_f nearly free over a narrow cap of lights: there a little of what is not
    Lambert's law looks like a large a. The linear part t counts by 1 - q / (q' - q), 0 at least, q and q' being the
    misfits with and without it: t beside its variance as James and Stein shrink it, under a misfit that is the same all
    over the object, so that more pixels do not lessen it.
    """
    terms = np.concatenate([np.ones((len(directions), 1)), directions], 1)
    ratio = ratio - ratio.mean(0)
    trend = terms @ np.linalg.lstsq(terms, ratio, rcond=None)[0]
    with_it, without = (
        sum(
            (x @ part.misfit.sum(0) @ x) / max(x @ (part.noise.sum(0) * x), 1e-30)
            for part, x in zip(parts, np.exp(each).T, strict=True)
        )
        for each in (0 * trend, trend)
    )
    return trend * min(with_it / max(without - with_it, 1e-30), 1.0)


def told_by_object(
    problem: Problem, how: iterative.IterativeSettings, *, pixels: int = PIXELS, rounds: int = ROUNDS
) -> tuple[Lights, list[Evidence], NDArray]:
    """Return the lights with intensities by the object alone, what it says of each channel, and its points (P, 3), mm.

    Near lights are seen from the depth of the visible surface.

    Notes
    -----
    In turn: the intensities from the samples that obey Lambert's law, by one eigenvector (see `intensities`),
    then which samples these are, by `iterative` on these intensities. There each frame's own median ratio of
    sample to shading is divided out first: a flash whose intensity is still wrong would be an outlier
    everywhere, and be believed never again.
    """
    lights, camera = problem.lights, problem.camera
    color, valid, pixel = _samples(problem.frames, problem.mask, pixels)
    found, here, used, parts = lights.intensities, lights, None, []
    for turn in range(rounds):
        gray = np.einsum("pfc,fc->pf", color, (GRAY / found).astype(np.float32))
        scale = float(np.percentile(gray[valid], 99)) if valid.any() else 1.0
        lit = valid & (gray > how.shadow_threshold * np.quantile(gray, 0.75, axis=1)[:, None])
        points, toward = _seen(here, camera, pixel)
        if used is None:
            used = lit
        else:
            b, _ = iterative.fit(Samples(gray, valid, points, Geometry.of(here)), scale, how)
            used = _lambertian(gray, lit, toward, b, how.outlier_sigmas, how.noise_floor * scale)
        divided = color / found.astype(np.float32)
        parts = evidence(divided, used, toward)
        solved = [solve_intensities(part) for part in parts]
        if min(part.relative.min() for part in solved) <= 0:
            continue  # the next round believes other samples
        now = found * np.stack([part.relative for part in solved], 1)
        now /= np.exp(np.mean(np.log(now / lights.intensities), axis=0))
        change, found = np.abs(now / found - 1).max(), now
        there = here
        if turn and lights.positions_mm is not None:
            there = _at_better_depth(here, camera, pixel, 0.5 * _width(points), (divided, used), solved)
        if change < _STANDS_STILL and there is here:
            break
        here = there
    return replace(here, intensities=found), parts, _seen(here, camera, pixel)[0]


def _at_better_depth(lights: Lights, camera: Camera, pixel, step: float, samples: tuple, solved) -> Lights:
    """Return near lights seen from the depth, some `step` (mm) away at most, that leaves less misfit; or themselves."""

    def misfit(depth: float) -> float:
        divided, used = samples
        _, toward = _seen(_at_depth(lights, depth), camera, pixel)
        return sum(solve_intensities(part).misfit for part in evidence(divided, used, toward))

    depth = float(lights.reference_point_mm[2])
    before, now, after = misfit(depth - step), sum(part.misfit for part in solved), misfit(depth + step)
    bend = before - 2 * now + after
    move = 0.5 * (before - after) / bend if bend > 0 else np.sign(before - after)
    target = depth + step * float(np.clip(move, -1, 1))
    # Not for the noise's sake, and not by a parabola that is none.
    if abs(move) < _WORTH_MOVING or misfit(target) >= now:
        return lights
    return _at_depth(lights, target)


def _at_depth(lights: Lights, depth: float) -> Lights:
    """Return near lights with another depth of the reference point, mm."""
    assert lights.positions_mm is not None
    point = np.array([*lights.reference_point_mm[:2], depth])
    arm = lights.positions_mm - point
    return replace(lights, reference_point_mm=point, directions=arm / np.linalg.norm(arm, axis=1, keepdims=True))


def _width(points: NDArray) -> float:
    """Return how far points (P, 3) lie from their middle across the view, rms, mm."""
    return float(np.sqrt(np.mean(np.sum((points[:, :2] - points[:, :2].mean(0)) ** 2, 1))))


def _fall_off(lights: Lights, points: NDArray) -> NDArray:
    """Return what the depth's own error does to the intensities (F,), relative: a quarter of the object's width."""
    center = points.mean(0)
    nearer = center + [0, 0, 0.25 * _width(points)]
    here, there = (np.linalg.norm(lights.toward(place[None])[:, 0], axis=1) for place in (center, nearer))
    change = np.log(there / here)
    return change - change.mean()


def _believed(given: Lights, lights: Lights, parts: list[Evidence]) -> tuple[Lights, tuple[str, ...]]:
    """Return the found lights, or the given ones, and why."""
    solved = [solve_intensities(part, with_sigma=True) for part in parts]
    sigma = np.sqrt(np.mean([part.sigma**2 for part in solved], axis=0))
    silent = ~np.isfinite(sigma)
    if min(part.contrast for part in solved) < CONTRAST or not np.median(sigma[~silent]) < SIGMA:
        said = (
            "the intensities cannot be told from this object (it is too flat, or its lights too few or too alike): "
            "those given are used, as by `iterative`."
        )
        return given, (said,)
    found, cautions = lights.intensities, []
    if silent.any():
        # A frame that no pixel ties to the others keeps what was given, on the scale of those that are found.
        factor = np.exp(np.mean(np.log(found[~silent] / given.intensities[~silent]), axis=0))
        found = np.where(silent[:, None], given.intensities * factor, found)
        named = listed([*compress(given.names, silent)], 3)
        cautions.append(f"nothing on the object tells the intensity of {named}: as given.")
    if (vague := sigma > SIGMA).any():
        named = listed([*compress(given.names, vague)], 3)
        cautions.append(f"the intensity of {named} is known to {np.nanmax(sigma):.0%} only: too few pixels tell it.")
    return replace(lights, intensities=found, intensity_sigma=sigma), tuple(cautions)


def _samples(frames: Frames, mask: NDArray[np.bool_], pixels: int):
    """Return color (P, F, 3), valid (P, F) and (u, v) (P, 2) of pixels evenly spread over the mask."""
    row, column = np.nonzero(spread_over(mask, pixels))
    read = (frames.read_pixels(index, row, column) for index in range(len(frames)))
    color, clipped = (np.stack(each, 1) for each in zip(*read, strict=True))
    return color, ~clipped, np.stack([column, row], -1)


def _seen(lights: Lights, camera: Camera, pixel: NDArray) -> tuple[NDArray, NDArray]:
    """Return the pixels' points (P, 3) at the reference depth, and the lights as seen from there (P, F, 3)."""
    points = camera.points_at_depth(pixel, lights.reference_point_mm[2])
    return points, np.ascontiguousarray(lights.toward(points).transpose(1, 0, 2))


def _lambertian(gray, lit, toward, b, sigmas, floor) -> NDArray[np.bool_]:
    """Return the samples (P, F) that agree with b, each frame's median ratio to it divided out."""
    shade = np.einsum("pfi,pi->pf", toward, b)
    size = np.linalg.norm(b, axis=1, keepdims=True)
    facing = lit & (shade > FACING * size)
    shade = np.where(facing, shade, 1)
    ratio = row_medians((gray / shade).T, facing.T)
    ratio = np.where(ratio > 0, ratio, 1)
    residual = np.abs(gray / ratio - shade) / np.maximum(size, 1e-12)
    # One spread for all pixels: one that is shadowed half the time would believe anything by its own.
    return facing & (residual <= sigmas * np.maximum(spread(residual[facing]), floor / np.maximum(size, 1e-12)))


METHOD = Method("semicalibrated", {"default": iterative.IterativeSettings()}, fit=iterative.fit, prepare=find_lights)
