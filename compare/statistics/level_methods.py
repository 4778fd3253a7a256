"""Which methods are level with the best: their medians differ by less than the uncertainty of the difference."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import KEYS, draw_blocks, drawn_statistics, memory_of

DRAWS = 400
SIGMAS = 2.0
MOST_PIXELS = 200_000
"""Of one map; of larger ones every n-th row and column is taken."""
FEWEST_PIXELS = 16


def thinned(error_deg: NDArray) -> NDArray[np.float32]:
    """Return every n-th row and column of a map (H, W), so that at most `MOST_PIXELS` remain."""
    step = int(np.ceil(np.sqrt(max(1.0, error_deg.size / MOST_PIXELS))))
    return np.array(error_deg[::step, ::step], np.float32)


def level_methods(errors: dict[str, NDArray], truth_sigma_deg: float | None) -> dict[str, Any]:
    """Return the medians' standard deviations and which methods are level with the best.

    Parameters
    ----------
    errors : dict of str to (H, W)
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
    whose squares differ by less are not told apart by such a truth.

    The blocks are the same for both methods of a difference: what makes both err is no difference [Kunsch1989].
    """
    errors = {name: error for name, error in errors.items() if np.isfinite(error).sum() >= FEWEST_PIXELS}
    if not errors:
        return {"best": None, "median_sigma_deg": {}, "level": []}
    medians = {name: float(np.nanmedian(error)) for name, error in errors.items()}
    best = min(medians, key=lambda name: medians[name])
    memories = {name: memory_of(error) for name, error in errors.items()}
    known = np.logical_or.reduce([np.isfinite(error) for error in errors.values()])
    draws = draw_blocks(known, memories[best].length_px, DRAWS, np.random.default_rng(0))
    column = KEYS.index("median_deg")
    drawn = {name: drawn_statistics(error, draws)[:, column] for name, error in errors.items()}
    inflation = {name: memory.inflation(draws) for name, memory in memories.items()}
    level = []
    for name in errors:
        sigma = float(np.std(drawn[name] - drawn[best])) * max(inflation[name], inflation[best])
        by_truth = medians[name] ** 2 - medians[best] ** 2 <= 2 * (truth_sigma_deg or 0.0) ** 2
        if name != best and (by_truth or medians[name] - medians[best] <= SIGMAS * sigma):
            level.append(name)
    sigmas = {name: float(np.std(each)) * inflation[name] for name, each in drawn.items()}
    return {"best": best, "median_sigma_deg": sigmas, "level": level}
