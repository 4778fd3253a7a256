"""Robust principal components: the stack is a low-rank matrix, sparsely corrupted, with shadows missing.

Memory: some 20 bytes a sample beside the samples themselves, 1 GB for a megapixel under 48 lights.
"""

from typing import NamedTuple

import numpy as np

from solve.methods import Method, Whole
from solve.pixelwise.kernels import least_squares
from solve.problem import Problem
from solve.samples import Samples
from solve.whole.low_rank import low_rank


class RpcaSettings(NamedTuple):
    """Settings of `rpca`.

    Parameters
    ----------
    shadow_threshold : float or None
        Missing is what lies under this share of the pixel's own 75th percentile, and what is clipped.
        None: nothing is missing.
    sparsity : float or None
        lambda = sparsity / sqrt(P F): how large the entries of U V' may be for D to pass uncorrupted. None:
        the textbook's 1 / sqrt(max(H W, F)).
    outlier_share : float or None
        Corrupted are samples farther from the low-rank part than this share of the pixel's own 75th
        percentile; b is fitted to the others. None: to the low-rank part itself, in all frames.
    tolerance : float
        Of |D - A - E| / |D|.
    rounds : int
    """

    shadow_threshold: float | None = 0.03
    sparsity: float | None = 7.0
    outlier_share: float | None = 0.04
    tolerance: float = 1e-5
    rounds: int = 100


SEED = RpcaSettings(shadow_threshold=None, sparsity=None, outlier_share=None, tolerance=1e-6)
"""The textbook's: nothing is missing, and lambda counts the background's pixels too, which makes it too small. The
benchmark names neither; an error that no gloss moves, as it has, is what such a lambda does."""

FEWEST_LIGHTS = 10
COMMON_GLOSS = 0.3


def fit_whole(problem: Problem, samples: Samples, settings: RpcaSettings) -> Whole:
    """Fit b = albedo x normal to the samples that a low-rank stack explains.

    Notes
    -----
    min |A|_* + lambda |E|_1, D = A + E on the samples that are there [Wu2010]; then, by default, least squares on the
    samples where E is next to nothing: the nuclear norm shrinks A, and leaves a bias in it that the samples
    themselves have not.

    Do not believe it where gloss covers a third of the samples, nor under fewer than ten lights: low rank and
    sparse cannot be told apart. With a lambda too small the error has a floor of several degrees.
    """
    gray, valid = samples.gray, samples.valid
    shadow_threshold, sparsity, outlier_share, tolerance, rounds = settings
    scale = samples.scale()
    data = gray / np.float32(scale)
    pixels, frames = data.shape
    place = int(0.75 * (frames - 1))
    level = np.partition(np.where(valid, data, 0), place, axis=1)[:, place].astype(np.float64)
    there = np.ones_like(valid) if shadow_threshold is None else valid & (data > shadow_threshold * level[:, None])
    weight = 1 / np.sqrt(max(problem.mask.size, frames)) if sparsity is None else sparsity / np.sqrt(pixels * frames)
    low, residual = low_rank(data, there, weight, tolerance=tolerance, rounds=rounds)
    cautions = []
    if residual > tolerance:
        cautions.append(f"it did not converge in {rounds} rounds: |D - A - E| is {residual:.1g} of |D|.")
    b, used = _fit_to_low_rank(samples._replace(gray=data, valid=there), low, level, outlier_share)
    corrupted = 1 - np.count_nonzero(used) / max(np.count_nonzero(there), 1)
    if corrupted > COMMON_GLOSS:
        cautions.append(f"{corrupted:.0%} of the lit samples are taken as corrupted: sparse is what a few are.")
    if frames < FEWEST_LIGHTS:
        cautions.append(
            f"{frames} lights: low rank and sparse are hard to tell apart under fewer than {FEWEST_LIGHTS}."
        )
    return Whole(b * scale, used, tuple(cautions))


def _fit_to_low_rank(samples, low, level, outlier_share):
    """Return b (P, 3) and the samples used (P, F); `low` (P, F) is the low-rank part, `level` (P,) a pixel's own."""
    data, there = samples.gray, samples.valid
    everything = np.ones_like(there)
    if outlier_share is None:
        return least_squares(samples._replace(gray=low.astype(np.float32)), everything, everything), everything
    used = there & (np.abs(data - low) <= outlier_share * level[:, None])
    few = used.sum(1) < 4
    used[few] = there[few]
    b = least_squares(samples, used, used)
    # The low rank has filled the gaps in: a bound where the samples themselves say nothing.
    lost = np.flatnonzero(~b.any(1))
    used[lost] = True
    b[lost] = least_squares(samples._replace(gray=low.astype(np.float32)).some(lost), used[lost], used[lost])
    return b, used


METHOD = Method("rpca", {"default": RpcaSettings(), "seed": SEED}, fit_whole=fit_whole)
