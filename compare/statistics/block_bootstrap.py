"""How uncertain an error map's median is: square blocks of its pixels drawn with replacement.

Neighbouring pixels err together. A block keeps neighbours together, so that the spread over draws of blocks is that of
the median, not of so many independent pixels [Kunsch1989].
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCKS = 36
"""Squares that the object is cut into, about: wide enough to hold what neighbours share, enough of them to be drawn."""
DRAWS = 400
MOST_PIXELS = 200_000
"""Of larger maps every n-th row and column is taken: more tell nothing that their neighbours do not."""
BINS = 512
SIGMAS = 2.0
"""A difference of two medians that is smaller than so many of its standard deviations ranks no method."""
FEWEST_PIXELS = 16


def thinned(error_deg: NDArray) -> NDArray[np.float32]:
    """Return every n-th row and column of a map (H, W), so that at most `MOST_PIXELS` remain."""
    step = int(np.ceil(np.sqrt(max(1.0, error_deg.size / MOST_PIXELS))))
    return np.array(error_deg[::step, ::step], np.float32)


def drawn_medians(maps: Sequence[NDArray], *, seed: int = 0) -> Array:
    """Return (DRAWS, M), the medians of M maps (H, W) over draws of blocks, the same blocks for all maps.

    Pixels that are NaN do not count. A draw that none of a sparse map's pixels is in has the median of the whole map.
    The median is read off a histogram whose bins hold as many pixels each, linear within a bin.
    """
    known = np.logical_or.reduce([np.isfinite(error) for error in maps])
    side = max(1, round(float(np.sqrt(np.count_nonzero(known) / BLOCKS))))
    rows, columns = np.indices(known.shape) // side
    label = np.zeros(known.shape, np.intp)
    _, label[known] = np.unique((rows * known.shape[1] + columns)[known], return_inverse=True)
    blocks = int(label.max()) + 1
    weights = np.random.default_rng(seed).multinomial(blocks, np.full(blocks, 1 / blocks), DRAWS)
    return np.stack([_medians(error, label, weights) for error in maps], 1)


def _medians(error: NDArray, label: NDArray[np.intp], weights: NDArray[np.int64]) -> Array:
    """Return (DRAWS,), the median of a map over blocks that are drawn so often; weights (DRAWS, blocks)."""
    known, blocks = np.isfinite(error), weights.shape[1]
    values = error[known].astype(np.float64)
    edges = np.unique(np.quantile(values, np.linspace(0, 1, min(BINS, max(2, values.size)) + 1)))
    if edges.size < 2:
        return np.full(len(weights), values[0])
    width = edges.size - 1
    bins = np.clip(np.searchsorted(edges, values, "right") - 1, 0, width - 1)
    table = np.bincount(label[known] * width + bins, minlength=blocks * width).reshape(blocks, width)
    weights = np.where(weights @ table.sum(1, keepdims=True) > 0, weights, 1)
    below = np.cumsum(weights.astype(np.float32) @ table.astype(np.float32), axis=1, dtype=np.float64)
    half = below[:, -1:] / 2
    at = np.minimum((below < half).sum(1, keepdims=True), width - 1)
    before = np.where(at > 0, np.take_along_axis(below, np.maximum(at - 1, 0), 1), 0.0)
    share = (half - before) / np.maximum(np.take_along_axis(below, at, 1) - before, 1e-12)
    return (edges[at] + share * (edges[at + 1] - edges[at]))[:, 0]


def level_methods(errors: Mapping[str, NDArray], truth_sigma_deg: float | None) -> dict[str, Any]:
    """Return the medians' standard deviations and which methods are level with the best.

    Parameters
    ----------
    errors : mapping of str to (H, W)
        Each method's angular error, degrees, NaN where unknown; of `thinned` maps.
    truth_sigma_deg : float or None
        The ground truth's own standard deviation, median of pixels.

    Returns
    -------
    dict
        best: the method of the least median, or None; median_sigma_deg: by method, of the median over draws of blocks
        of pixels; level: the other methods whose median exceeds the best one's by no more than `SIGMAS` standard
        deviations of that difference, or by what the truth's sigma accounts for (Notes). Which of these is better is
        not known.

    Notes
    -----
    A truth that errs by sigma along each of two axes adds 2 sigma^2 to the square of an angular error. Two medians
    whose squares differ by less are not told apart by such a truth. The blocks are the same for both methods of a
    difference: what makes both err is no difference.
    """
    errors = {name: error for name, error in errors.items() if np.isfinite(error).sum() >= FEWEST_PIXELS}
    if not errors:
        return {"best": None, "median_sigma_deg": {}, "level": []}
    medians = {name: float(np.nanmedian(error)) for name, error in errors.items()}
    best = min(medians, key=lambda name: medians[name])
    drawn = dict(zip(errors, drawn_medians([*errors.values()]).T, strict=True))
    bars = {name: SIGMAS * float(np.std(drawn[name] - drawn[best])) for name in errors}
    by_truth = 2 * (truth_sigma_deg or 0.0) ** 2
    level = [
        name
        for name, median in medians.items()
        if name != best and (median - medians[best] <= bars[name] or median**2 - medians[best] ** 2 <= by_truth)
    ]
    return {"best": best, "median_sigma_deg": {name: float(np.std(one)) for name, one in drawn.items()}, "level": level}
