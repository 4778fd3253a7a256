"""Two captures of one thing, real and synthetic say: how much their errors differ, and whether they lie alike."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import drawn_medians, thinned
from compare.statistics.statistics import angular_statistics, error_correlation
from scene.errors import SceneError

Map = NDArray[np.float32]

INTERVAL = (0.025, 0.975)
"""The interval of a difference of medians: 95 % of the draws."""
UNLIKE_BELOW, ALIKE_FROM = 0.3, 0.6
"""Pearson's correlation of two error maps: of other places below, of the same places from this on."""
OVERLAP = 0.5
"""Of the smaller capture's pixels, that both must have before maps are laid over each other."""


def likeness(pearson: float | None) -> str:
    """Return whether two error maps lie alike, alike in part, not alike, or whether that is not known."""
    if pearson is None or not np.isfinite(pearson):
        return "not known"
    return "not alike" if pearson < UNLIKE_BELOW else "alike in part" if pearson < ALIKE_FROM else "alike"


def difference(real: NDArray, twin: NDArray) -> dict[str, float | int | None]:
    """Return `error_correlation` of two error maps of one shape (None where it is not defined), and an interval.

    median_difference_low_deg, median_difference_high_deg: of `median_difference_deg`, 95 %, over blocks of the pixels
    that both have, drawn for both together: what both share cancels.
    """
    found = error_correlation(real, twin)
    row = {key: value if np.isfinite(value) else None for key, value in found.items()}
    both = np.isfinite(real) & np.isfinite(twin)
    maps = [thinned(np.where(both, error, np.nan)) for error in (real, twin)]
    # Thinning may miss all of very few pixels.
    drawn = drawn_medians(maps) if np.isfinite(maps[0]).any() else np.full((1, 2), np.nan)
    return row | _interval(drawn[:, 0] - drawn[:, 1])


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
        row |= difference(real[name], twin[name]) if laid_over else _apart(real[name], twin[name])
        rows[name] = {**row, "likeness": likeness(row["pearson"])}
    return {
        "laid_over": laid_over,
        "left_out": [name for name in common if name not in known],
        "methods": rows,
        "verdict": next(iter(rows.values()))["likeness"],
    }


def _apart(real: Map, twin: Map) -> dict[str, Any]:
    """Return the difference of the medians of two captures that share no pixels."""
    drawn = [drawn_medians([thinned(error)], seed=seed)[:, 0] for seed, error in enumerate((real, twin))]
    found = float(np.nanmedian(real) - np.nanmedian(twin))
    nothing = {"pearson": None, "spearman": None, "pixels": 0}
    return {**nothing, "median_difference_deg": found, **_interval(drawn[0] - drawn[1])}


def _interval(drawn: NDArray) -> dict[str, float | None]:
    low, high = (float(end) if np.isfinite(end) else None for end in np.quantile(drawn, INTERVAL))
    return {"median_difference_low_deg": low, "median_difference_high_deg": high}
