"""The backdrop: one smooth surface, and the pixels that contradict it."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scene.fan_out import fan_out
from scene.robust import spread

TEXTURE = 0.12
"""A backdrop's own texture and unevenness, relative: what it may differ from a smooth surface by."""
SAME = 0.07
"""A backdrop's brightness follows its smooth model, times the pixel's albedo, to this share."""
SHADOW = 0.25
"""A frame that shows less than this share of the pixel's upper quartile (relative to the backdrop) is in shadow."""
FEWEST_VOTES = 3
LEAST_AGREEING = 0.55
"""Share of the other lit frames that agree with one's albedo, at least, where the backdrop is seen."""
BORDER = 0.15
"""Share of the image, at each side, where the backdrop is looked for at first."""
FITTED = 20_000
"""Pixels, at least, to which a frame's model is fitted, where there are so many."""


@dataclass(frozen=True)
class Contradiction:
    """How each pixel contradicts the backdrop."""

    bright: NDArray[np.float32]
    """(h, w): share of frames in which it is brighter than the backdrop can be."""
    lit: NDArray[np.float32]
    """(h, w): share of frames in which it looks like lit backdrop."""
    object_likely: NDArray[np.bool_]
    """(h, w)."""
    backdrop: NDArray[np.float32]
    """(h, w): the backdrop's mean over the frames, had it no shadows."""
    backdrop_noise: float
    """Relative rms of the backdrop about its smooth model."""


def contradict_backdrop(stack: NDArray[np.float32], ignore: NDArray[np.bool_]) -> Contradiction:
    """Fit the backdrop to a stack of gray frames (F, h, w), and say where it cannot be; `ignore` (h, w): balls.

    In each frame the backdrop is a polynomial of the pixel, fitted robustly, at first to the image's border,
    then to all that agreed. A backdrop pixel may be darker in some frames (cast shadow) but not brighter;
    one that never looks like lit backdrop is dark object.
    """
    height, width = stack.shape[1:]
    v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    edge = (np.abs(u) > 1 - 2 * BORDER) | (np.abs(v) > 1 - 2 * BORDER)
    member = edge & ~ignore
    # Eight-bit black is constant, and still no surface: what is under a percent of the scene's bright parts is noise.
    step = np.abs(np.diff(stack[:, member], axis=1))
    noise = max(float(np.median(step)), 0.01 * float(np.percentile(stack, 99)), 1e-6)
    bright = lit = np.zeros((height, width), np.float32)
    models = np.zeros(stack.shape, np.float32)
    relative = 1.0
    # Few terms reach from the border into the middle without swinging; more once the middle is known.
    for degree in (2, 2, 3, 4):
        terms = [u**i * v**j for i in range(degree + 1) for j in range(degree + 1 - i)]
        compare = partial(_compare_frame, np.stack(terms, -1), member, noise)
        models, brighter, agrees, misses = zip(*fan_out(compare, list(stack)), strict=True)
        bright, lit = (np.stack(frames).mean(0, dtype=np.float32) for frames in (brighter, agrees))
        models, relative = np.stack(models), float(np.mean(misses))
        member = (bright < 0.15) & (lit > 0.4) & ~ignore
        if member.sum() < 10 * len(terms):
            break
    likely = (bright > 0.35) | ((lit < 0.2) & (bright > 0.05)) | (lit < 0.05)
    likely |= _other_shape(stack, models, noise)
    return Contradiction(bright, lit, likely & ~ignore, np.asarray(models.mean(0)), relative)


def _other_shape(stack: NDArray[np.float32], models: NDArray[np.float32], noise: float) -> NDArray[np.bool_]:
    """Return (h, w): no albedo makes the pixel follow the backdrop's brightness from frame to frame.

    A textured backdrop is its smooth model times an albedo, in every frame in which it is lit; whatever is inclined
    otherwise changes otherwise, be it as bright as the backdrop or not. The albedo is the one that most frames agree
    with; shadows do not vote.
    """
    seen = models > 4 * noise
    ratio = np.where(seen, stack / np.maximum(models, 1e-9), np.nan)
    most = np.zeros(stack.shape[1:], np.int64)
    # Not the brightest: a light so low that it misses the backdrop makes any other surface ten times as bright.
    dark = SHADOW * np.partition(np.where(seen, ratio, 0), (3 * len(stack)) // 4, axis=0)[(3 * len(stack)) // 4]
    voting = seen & (ratio > np.maximum(dark, 2 * noise / np.maximum(models, 1e-9)))
    # Rows at a time: every frame's albedo is tried on every frame.
    for row in range(stack.shape[1]):
        mine, votes = np.where(voting[:, row], ratio[:, row], np.nan), voting[:, row]
        slack = SAME * mine + noise / np.maximum(models[:, row], 1e-9)
        agree = (np.abs(mine[:, None] - mine) <= slack[:, None]) & votes
        most[row] = agree.sum(1).max(0)
    enough = voting.sum(0)
    return (enough >= FEWEST_VOTES) & (most - 1 < LEAST_AGREEING * (enough - 1))


def _compare_frame(
    basis: NDArray, member: NDArray[np.bool_], noise: float, frame: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], float]:
    """Fit the backdrop's model to one frame; return it, where the frame is brighter, where it agrees, and its rms."""
    chosen = np.flatnonzero(member)
    chosen = chosen[:: max(1, len(chosen) // FITTED)]
    solution = _robust_fit(basis.reshape(-1, basis.shape[-1])[chosen], frame.ravel()[chosen], noise)
    model = np.maximum(basis @ solution, 0).astype(np.float32)
    tolerance = np.hypot(np.float32(3 * noise), 3 * TEXTURE * model)
    excess = frame - model
    agrees = np.abs(excess) <= tolerance
    seen = agrees & member
    return model, excess > tolerance, agrees, float(np.std(excess[seen] / np.maximum(model[seen], noise)))


def _robust_fit(basis: NDArray, values: NDArray, noise: float) -> NDArray[np.float64]:
    """Return coefficients by reweighted least squares that shadows below and objects above do not pull."""
    values = values.astype(np.float64)
    # The brighter half at first: shadows are many, and go one way.
    weight = (values > np.median(values)).astype(np.float64) + 0.2
    solution = np.zeros(basis.shape[1])
    for _ in range(8):
        weighted = basis * weight[:, None]
        solution = np.linalg.lstsq(weighted.T @ basis, weighted.T @ values, rcond=None)[0]
        residual = values - basis @ solution
        scale = max(spread(residual), noise)
        weight = 1 / (1 + (residual / (2 * scale)) ** 2) ** 2
    return solution
