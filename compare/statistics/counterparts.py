"""Error maps with their uncertainty: which methods are level; how two captures' errors differ, and lie alike.

Neighbouring pixels err together. Square blocks of pixels are drawn with replacement: a block keeps neighbours together,
so that the spread over draws is that of the median, not of so many independent pixels [Kunsch1989].
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.statistics import angular_statistics, error_correlation
from scene.errors import SceneError

Array = NDArray[np.float64]
Map = NDArray[np.float32]

BLOCKS = 36
"""Squares that the object is cut into, about: wide enough to hold what neighbours share, enough of them to be drawn."""
DRAWS = 400
MOST_PIXELS = 200_000
"""Of larger maps every n-th row and column is taken: more tell nothing that their neighbours do not."""
SIGMAS = 2.0
"""A difference of two medians that is smaller than so many of its standard deviations ranks no method."""
UNLIKE_BELOW, ALIKE_FROM = 0.3, 0.6
"""Pearson's correlation of two error maps: of other places below, of the same places from this on."""
OVERLAP = 0.5
"""Of the smaller capture's pixels, that both must have before maps are laid over each other."""


def sampling_step(pixels: int) -> int:
    """Return of how many rows and columns one is taken, so that at most `MOST_PIXELS` of a map remain."""
    return int(np.ceil(np.sqrt(max(1.0, pixels / MOST_PIXELS))))


def thinned(error_deg: NDArray) -> NDArray[np.float32]:
    """Return every n-th row and column of a map (H, W); see `sampling_step`."""
    step = sampling_step(error_deg.size)
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
    edges = np.unique(np.quantile(values, np.linspace(0, 1, min(512, max(2, values.size)) + 1)))
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
    errors = {name: error for name, error in errors.items() if np.isfinite(error).sum() >= 16}
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


def likeness(pearson: float | None) -> str:
    """Return whether two error maps lie alike, alike in part, not alike, or whether that is not known."""
    if pearson is None or not np.isfinite(pearson):
        return "not known"
    return "not alike" if pearson < UNLIKE_BELOW else "alike in part" if pearson < ALIKE_FROM else "alike"


def difference(real: NDArray, twin: NDArray, *, laid_over: bool = True) -> dict[str, float | int | None]:
    """Return `error_correlation` of two error maps of one shape (None where it is not defined), and an interval.

    median_difference_low_deg, median_difference_high_deg: of `median_difference_deg`, 95 %, over blocks of the pixels
    that both have, drawn for both together: what both share cancels. Not laid over each other, the two have their own
    pixels and blocks, and no correlation.
    """
    if laid_over:
        found = error_correlation(real, twin)
        both = np.isfinite(real) & np.isfinite(twin)
        maps = [thinned(np.where(both, error, np.nan)) for error in (real, twin)]
        # Thinning may miss all of very few pixels.
        drawn = drawn_medians(maps).T if np.isfinite(maps[0]).any() else np.full((2, 1), np.nan)
    else:
        apart = np.nanmedian(real) - np.nanmedian(twin)
        found = {"pearson": np.nan, "spearman": np.nan, "pixels": 0, "median_difference_deg": apart}
        drawn = [drawn_medians([thinned(error)], seed=seed)[:, 0] for seed, error in enumerate((real, twin))]
    low, high = np.quantile(drawn[0] - drawn[1], [0.025, 0.975])
    found |= {"median_difference_low_deg": low, "median_difference_high_deg": high}
    return {key: (value if isinstance(value, int) else float(value)) if np.isfinite(value) else None
            for key, value in found.items()}  # fmt: skip


def compare_counterparts(real: Mapping[str, Map], twin: Mapping[str, Map]) -> dict[str, Any]:
    """Compare the methods' errors on two captures.

    Parameters
    ----------
    real, twin : mapping of str to (H, W) float32
        By method: error in degrees, NaN where unknown.

    Returns
    -------
    dict
        laid_over: both are of one size and show the object at the same pixels; left_out: methods without any known
        error on one of the two; methods, by name, the least median of `real` first: real and twin
        (`angular_statistics`), `difference`, and likeness; verdict: the likeness of the first method, which leaves the
        least for calibration and scan to hide behind. Where the two are not laid over each other the medians are those
        of each capture's own pixels, and correlations are None.

    Raises
    ------
    SceneError
        No method has a known error on both.
    """
    common = [name for name in real if name in twin]
    known = [name for name in common if all(np.isfinite(side[name]).any() for side in (real, twin))]
    if not known:
        raise SceneError(
            f"no method has a known error on both (looked at: {', '.join(common)}). Process both again, or by other "
            "methods."
        )
    seen = [np.logical_or.reduce([np.isfinite(side[name]) for name in known]) for side in (real, twin)]
    laid_over = seen[0].shape == seen[1].shape
    laid_over = laid_over and bool((seen[0] & seen[1]).sum() >= OVERLAP * min(one.sum() for one in seen))
    rows = {}
    for name in sorted(known, key=lambda name: float(np.nanmedian(real[name]))):
        row: dict[str, Any] = {"real": angular_statistics(real[name]), "twin": angular_statistics(twin[name])}
        row |= difference(real[name], twin[name], laid_over=laid_over)
        rows[name] = {**row, "likeness": likeness(row["pearson"])}
    return {
        "laid_over": laid_over,
        "left_out": [name for name in common if name not in known],
        "methods": rows,
        "verdict": next(iter(rows.values()))["likeness"],
    }
