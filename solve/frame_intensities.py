"""Frames whose brightness contradicts the intensities that are stated for them: named, and used with what they show.

A flash that fired weaker, an exposure that was changed half-way, a list of intensities that is off for some frames.
What changes smoothly with the light's direction is not told apart from how the surface reflects, and a common factor
from its albedo: only frames that jump out of a smooth function of the direction are named.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from scene.camera import Camera
from scene.frames import Frames
from scene.intensities import solve_intensities
from scene.lights import Lights
from scene.reading import listed
from scene.robust import MAD
from solve.pixelwise.iterative import IterativeSettings
from solve.problem import Problem
from solve.whole.semicalibrated import CONTRAST, told_by_object

_PIXELS, _ROUNDS = 2_000, 4
"""Pixels from which the intensities are found, and rounds."""
_LEAST = 0.04
"""Log of the factor under which an error is not worth a word: how surfaces reflect makes jumps of up to 3 %."""
_CHANCE = 0.001
"""That a frame of a session jumps out by chance, the rest being normal."""
_SHARE = 1 / 3
"""Of the frames: if more jump out, nobody knows which of them are right."""
_SEEN = 1 / 3
"""Of the samples that the median frame has: a light that grazes the object shows what is odd about a small part."""
_FREE = 6
"""Frames there must be beyond what a linear function takes up; four times as many make it a quadratic one."""


def corrected(frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]) -> tuple[Lights, list[str]]:
    """Return the lights with the intensities of frames that contradict the rest corrected, and what is to be said.

    The same lights where nothing jumps out, where the object does not tell (a plane), of fewer than ten frames, and of
    lights without directions.

    Notes
    -----
    The object tells every frame's intensity beside the others' (see `solve.whole.semicalibrated`). A function of the
    direction, linear, of 24 frames or more quadratic, is fitted to the logs of their ratio to the stated ones, by
    least absolute deviations, then least squares without the frames that jump out: by 4 % at least, and farther than
    the scatter of the rest, and that between parts of the object, would let any do in one session of a thousand.
    """
    if len(lights) < 4 + _FREE or not mask.any() or not np.isfinite(lights.directions).all():
        return lights, []
    problem = Problem.of(frames, lights, camera, mask)
    found, parts, _ = told_by_object(problem, IterativeSettings(), pixels=_PIXELS, rounds=_ROUNDS)
    solved = [solve_intensities(part, with_sigma=True) for part in parts]
    sigma = np.sqrt(np.mean([part.sigma**2 for part in solved], axis=0))
    if min(part.contrast for part in solved) < CONTRAST:
        return lights, []
    seen = parts[0].noise.sum(0)
    sigma[seen < _SEEN * np.median(seen)] = np.nan
    stated = lights.seen_from(found.reference_point_mm).intensities
    jump = _jumps(np.log(found.intensities / stated).mean(1), sigma, lights.directions)
    off = np.abs(jump) > _LEAST
    if not off.any() or off.mean() > _SHARE:
        return lights, []
    factor = np.where(off, np.exp(jump), 1.0)
    # The others' stay as they are, not their mean: albedo does.
    own = replace(lights, intensities=lights.intensities * factor[:, None])
    return own, list(filter(None, (_said(lights.names, factor, word) for word in ("brighter", "darker"))))


def _jumps(log_ratio: NDArray, sigma: NDArray, directions: NDArray) -> NDArray:
    """Return how far each of F values lies off a smooth function of the direction, 0 where that may be chance."""
    jump, known = np.zeros(len(sigma)), np.isfinite(sigma)
    if np.count_nonzero(known) < 4 + _FREE:
        return jump
    x, y, z = directions[known].T
    terms = [np.ones_like(x), x, y, z]
    if len(x) >= 4 * _FREE:
        terms += [x * y, x * z, y * z, x * x - y * y, z * z]
    smooth, value, sigma = np.stack(terms, 1), log_ratio[known], sigma[known]
    weight = np.ones(len(x))
    for _ in range(50):
        left = value - smooth @ _fit(smooth, value, weight)
        weight = 1 / np.maximum(np.abs(left), 1e-4)
    # As many values as there are terms lie on the function.
    scatter, free = MAD * np.median(np.sort(np.abs(left))[len(terms) :]), len(x) - len(terms)
    agrees = np.ones(len(x), bool)
    for _ in range(20):
        spread = np.linalg.pinv(smooth[agrees].T @ smooth[agrees])
        # Of a frame that stands aside, the function is a forecast.
        lever = np.sqrt(1 + np.where(agrees, 0, np.einsum("ni,ij,nj->n", smooth, spread, smooth)))
        sigmas = student_t.isf(0.5 * _CHANCE / len(x), free)
        agrees = np.abs(left) <= sigmas * np.hypot(scatter, sigma) * lever
        free = np.count_nonzero(agrees) - len(terms)
        if free < _FREE // 2:
            return jump
        left = value - smooth @ _fit(smooth, value, agrees.astype(float))
        scatter = np.sqrt(np.sum(left[agrees] ** 2) / free)
    jump[known] = np.where(agrees, 0, left)
    return jump


def _fit(smooth: NDArray, value: NDArray, weight: NDArray) -> NDArray:
    root = np.sqrt(weight)
    return np.linalg.lstsq(smooth * root[:, None], value * root, rcond=1e-6)[0]


def _said(names: tuple[str, ...], factor: NDArray, word: str) -> str:
    """Return what is to be said of frames that are brighter, or darker; empty: there are none."""
    which = np.flatnonzero(factor > 1 if word == "brighter" else factor < 1)
    if not len(which):
        return ""
    share = np.abs(factor[which] - 1)
    by = " to ".join(dict.fromkeys(f"{end:.0%}" for end in (share.min(), share.max())))
    return (
        f"{listed([names[i] for i in which], 4)}: {by} {word} than the stated intensities say, beside the other frames "
        "of this object. Solved with the intensities that the frames show. Was the flash's power or the exposure "
        "changed, or the object moved?"
    )
