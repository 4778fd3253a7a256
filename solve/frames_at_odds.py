"""Frames that contradict the rest over a large part of the object: a shadow, a second light, a lamp. They are named.

One robust fit a pixel. What single pixels show is a method's to leave out; what half of the object shows has a cause
outside of it.
"""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.reading import listed
from solve.problem import Problem
from solve.samples import all_samples
from solve.whole import metal

Array = NDArray[np.float64]
PIXELS, ROUNDS, FLOOR = 1_000, 10, 0.01
"""Pixels that are fitted, about; reweighted fits of each; share of the albedo that residuals count as at least."""
FEWEST, SWITCHED_FEWEST = 6, 10
"""Frames of which something can be said, and of which a lamp that was switched can: it takes three unknowns more."""
NOT_MATTE = 0.15
"""Residuals of the middle pixel, mean, as a share of the albedo: matte and glossy objects have up to 0.1, bronzes more
than 0.2. Wrong lights have as much."""
FACING = 0.3
"""Cosine to the light from which a surface cannot be dark by its own turn."""
DARK, BRIGHT, LARGE = 0.4, 0.4, 0.3
"""Share of the expected brightness under which a sample is dark; share of the albedo by which one is too bright; and
share of the surface from which that is said. Objects of sound captures shade up to 0.13 of what faces a light, and have
gloss on up to 0.05."""
LIT = 0.1
"""Share of a pixel's 90th percentile under which a sample may be a shadow: no term explains it."""
SWITCHED, ALIKE = 0.12, 0.8
"""Light that came, as a share of the flash (median), from which it is said, and share of the surface that shows it with
one sign. Sound captures have up to 0.07 and 0.7; a lamp of a third of the flash 0.15 to 0.24 and 0.82 to 0.94."""


def at_odds(
    frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_], *, warned: bool = False
) -> tuple[metal.Metal | None, list[str]]:
    """Return the metal that the object is, or None and what is to be said of frames that contradict the others.

    Contradict over a large part of the object. Nothing of fewer than six frames, or of lights without directions.
    `warned`: capture or balls were warned of; wrong coding, a wrong focal length or a camera that moved may look like a
    lamp. Of a metal all frames contradict Lambert's law, and nothing can be said of single ones.

    Notes
    -----
    b = argmin sum_f |m_f - l_f . b| at a thousand pixels, l_f the light, m_f the sample divided by its intensity
    [Ikehata2012]. A frame is in shadow where samples are far below l_f . b over a large part of what faces its light;
    another light shone in it where they are far above, whichever way the surface faces. A lamp that was switched on
    before frame k adds an a of its own to each pixel from there on: m_f = l_f . b + c + (a + d l_f . b) [f >= k]; a is
    of one sign nearly everywhere. c is what all frames share, d an error that the lamp made in the intensities: without
    them both would count into a. Of all k the one is taken that leaves the least share of the residuals.
    """
    problem = Problem.of(frames, lights, camera, mask).thinned(PIXELS)
    if len(lights) < FEWEST or not problem.mask.any() or not np.isfinite(lights.directions).all():
        return None, []
    samples = all_samples(problem)
    toward, value = np.array(samples.toward(), np.float64), samples.gray.astype(np.float64)
    found, residual = _fitted(value, samples.valid, toward)
    is_matte = np.median(np.abs(residual).mean(1)) < NOT_MATTE
    if not is_matte and (one := metal.found(samples, problem.views())) is not None:
        return one, []
    told, odd = _hidden_or_lit(lights.names, samples.valid, toward, found, residual)
    # What one frame shows of itself is not to be taken for a change in all that follow.
    return None, [*told, *_switched(lights.names, value, samples.valid & ~odd, toward, warned=warned)]


def _fitted(value: Array, use: NDArray[np.bool_], design: Array) -> tuple[Array, Array]:
    """Return the coefficients (P, k) of least absolute deviations, and residuals (P, F), in units of the albedo.

    `use` (P, F): which samples count; `design` (P, F, k), its first three columns the lights'.
    """
    weight, found, residual = use.astype(np.float64), np.zeros(0), np.zeros(0)
    for _ in range(ROUNDS):
        weighted = np.swapaxes(design * weight[..., None], 1, 2)
        normal = weighted @ design + 1e-9 * np.eye(design.shape[2])
        found = np.linalg.solve(normal, weighted @ value[..., None])[..., 0]
        residual = value - (design @ found[..., None])[..., 0]
        albedo = np.maximum(np.linalg.norm(found[:, :3], axis=1, keepdims=True), 1e-12)
        found, residual = found / albedo, residual / albedo
        weight = use / np.maximum(np.abs(residual), FLOOR)
    return found, residual


def _hidden_or_lit(
    names: tuple[str, ...], valid: NDArray[np.bool_], toward: Array, found: Array, residual: Array
) -> tuple[list[str], NDArray[np.bool_]]:
    """Return what is to be said of single frames, and which (F,) are meant; `found` and `residual`: see `_fitted`."""
    expected = (toward @ found[..., None])[..., 0]
    facing = valid & (expected > FACING * np.linalg.norm(toward, axis=-1))
    dark = np.sum(facing & (expected + residual < DARK * expected), 0) / np.maximum(facing.sum(0), 1)
    # A light that hardly any of the surface faces says little.
    dark[facing.mean(0) < FACING] = 0
    bright = np.sum(valid & (residual > BRIGHT), 0) / np.maximum(valid.sum(0), 1)
    told = (
        (dark, f"of the object that faces the flash is dark (under {DARK:.0%} of what the other frames say): something "
         "stood in the flash's way, or the light's direction is wrong"),
        (bright, f"of the object is brighter (by more than {BRIGHT:.0%} of its albedo) than the other frames say: a "
         "second light shone with the flash, or the light's direction is wrong"),
    )  # fmt: skip
    said = [
        f"{listed([names[f] for f in np.flatnonzero(share > LARGE)])}: {share.max():.0%} {what}. Look at the frames; "
        "reshoot them, or list them under frames.skip."
        for share, what in told
        if share.max() > LARGE
    ]
    return said, (dark > LARGE) | (bright > LARGE)


def _switched(
    names: tuple[str, ...], value: Array, valid: NDArray[np.bool_], toward: Array, *, warned: bool
) -> list[str]:
    """Return what is to be said of light that came or went and stayed so."""
    lit = valid & (value > LIT * np.quantile(value, 0.9, axis=1, keepdims=True))
    seen = lit.sum(1) >= SWITCHED_FEWEST - 1
    if len(names) < SWITCHED_FEWEST or seen.mean() < LARGE:
        return []
    value, toward, lit = value[seen], toward[seen], lit[seen]
    steady = np.concatenate([toward, np.ones((*lit.shape, 1))], -1)
    shaded, before = _fitted(value, lit, steady)
    expected, best, step = (toward @ shaded[:, :3, None])[..., 0], 1.0, (0, 0.0)
    for first in range(3, len(names) - 2):
        after = np.broadcast_to(np.arange(len(names)) >= first, lit.shape)
        known = ((lit & after).sum(1) > 2) & ((lit & ~after).sum(1) > 2)
        if known.mean() < LARGE:
            continue
        terms: Array = np.concatenate([steady, np.stack([after * expected, 1.0 * after], -1)], -1, dtype=np.float64)
        found, left = _fitted(value[known], lit[known], terms[known])
        share, more = float(np.sum(np.abs(left * lit[known])) / np.sum(np.abs(before * lit)[known])), found[:, -1]
        middle = float(np.median(more))
        if share < best and abs(middle) > SWITCHED and np.mean(np.sign(more) == np.sign(middle)) > ALIKE:
            best, step = share, (first, middle)
    first, more = step
    if not first:
        return []
    how, word = ("brighter", "on") if more > 0 else ("darker", "off")
    unless = ", unless what is warned of photographs and balls makes it" if warned else ""
    return [
        f"{names[first]}: from about here on the object is {how} by {abs(more):.0%} of a flash, whichever way it "
        f"faces: a lamp was switched {word} after {names[first - 1]}{unless}. Darken the room and reshoot, or list "
        "the frames before or after under frames.skip."
    ]
