"""Whether a method errs at the same places on two captures: correlation of its error maps, blocks of pixels drawn."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import draw_blocks, drawn_correlation, memory_of, structured_share
from compare.statistics.solver_order import LEVEL
from compare.statistics.statistics import error_correlation

Map = NDArray[np.float32]

ALIKE_FROM = 0.3
"""Correlation of two error patterns from which they are alike: the report's bar."""
STRUCTURED = 0.5
"""Share of a map's variance that must be no pixel's own noise before its pattern can be called another one."""


def error_pattern(real: Map, twin: Map, count: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return how alike two error maps are, with 95 % intervals, and what that shows.

    Parameters
    ----------
    real, twin : (H, W) float32
        Degrees, NaN where unknown.
    count : int
        Draws of blocks.
    rng : numpy Generator

    Returns
    -------
    dict
        pixels known in both; pearson and spearman (None where a map is constant) with _low and _high; structured: the
        share of each map that is no pixel's own noise; verdict: alike, differ, not shown.
    """
    from scipy.stats import norm, rankdata

    found = error_correlation(real, twin)
    both = np.isfinite(real) & np.isfinite(twin)
    row: dict[str, Any] = {"pixels": found["pixels"]}
    if not (np.isfinite(found["pearson"]) and np.isfinite(found["spearman"])):
        return {**row, "pearson": None, "spearman": None, "verdict": "not shown"}
    for key, of in (("pearson", lambda values: values), ("spearman", rankdata)):
        a, b = (np.full(real.shape, np.nan) for _ in range(2))
        a[both], b[both] = of(real[both].astype(np.float64)), of(twin[both].astype(np.float64))
        product = (a - a[both].mean()) * (b - b[both].mean())
        memory = memory_of(product)
        blocks = draw_blocks(both, memory.length_px, count, rng)
        # Fisher's transform: there the spread does not depend on the correlation.
        spread = np.std(np.arctanh(np.clip(drawn_correlation(a, b, blocks), -0.999999, 0.999999)))
        middle, reach = np.arctanh(np.clip(found[key], -0.999999, 0.999999)), norm.isf(LEVEL / 2) * spread
        reach *= memory.inflation(blocks)
        row |= {
            key: float(found[key]),
            f"{key}_low": float(np.tanh(middle - reach)),
            f"{key}_high": float(np.tanh(middle + reach)),
        }
    structured = {"real": structured_share(real), "twin": structured_share(twin)}
    if row["pearson_low"] > ALIKE_FROM:
        verdict = "alike"
    elif row["pearson_high"] < ALIKE_FROM and min(structured.values()) > STRUCTURED:
        verdict = "differ"
    else:
        verdict = "not shown"
    return {**row, "structured": structured, "verdict": verdict}
