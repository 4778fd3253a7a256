"""Whether two captures rank the methods alike, with the uncertainty of both."""

from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.counterpart_draws import Drawn

Array = NDArray[np.float64]

LEVEL = 0.05
INTERVAL = (0.05, 0.95)


def solver_order(methods: tuple[str, ...], real: Drawn, twin: Drawn) -> dict[str, Any]:
    """Return whether the methods' order by median error is the same on two captures.

    `real`, `twin`: the medians (M,) of the M methods, see `Drawn.medians`.

    Returns
    -------
    dict
        order: by capture, the best first; tau: Kendall's, -1 to 1, with tau_low and tau_high (90 %); pairs: a, b and,
        for real and twin, difference_deg (b's median minus a's), sigma_deg, significant; sentences; contradictions:
        pairs whose order is significant on both and opposite; verdict: same, differ, not shown.

    Notes
    -----
    Kendall's tau-b [Kendall1938]. A difference is significant when it exceeds, in either direction, what one of
    `LEVEL` / pairs of tests would exceed by chance (Student, two-sided). A pair contradicts when both differences are
    significant and of opposite signs: for the whole order the rule errs more seldom still, whatever the true
    differences are [Berger1982].
    """
    sides, sentences = {"real": real, "twin": twin}, {}
    rows: list[dict[str, Any]] = [{"a": a, "b": b} for a, b in combinations(methods, 2)]
    for kind, side in sides.items():
        for row, (a, b) in zip(rows, combinations(range(len(methods)), 2), strict=True):
            row[kind] = _between(side, b, a, len(rows))
        sentences[kind] = []
        for better, worse in pairwise(np.argsort(side.found, kind="stable")):
            one = _between(side, worse, better, len(rows))
            word = "significant" if one["significant"] else "not significant"
            sentences[kind].append(
                f"`{methods[better]}` beats `{methods[worse]}` by {one['difference_deg']:.2f}°, sigma "
                f"{one['sigma_deg']:.2f}°: {word}"
            )
    contradictions = [
        [row["a"], row["b"]]
        for row in rows
        if row["real"]["significant"]
        and row["twin"]["significant"]
        and row["real"]["difference_deg"] * row["twin"]["difference_deg"] < 0
    ]
    tau, low, high = None, None, None
    if rows:
        tau = float(kendall_tau(real.found[None], twin.found[None])[0])
        drawn = kendall_tau(real.found + real.spread, twin.found + twin.spread)
        low, high = (float(end) for end in np.quantile(drawn, INTERVAL))
    same = tau is not None and low is not None and min(tau, low) > 0
    return {
        "order": {kind: [methods[i] for i in np.argsort(side.found, kind="stable")] for kind, side in sides.items()},
        "tau": tau,
        "tau_low": low,
        "tau_high": high,
        "pairs": rows,
        "contradictions": contradictions,
        "sentences": sentences,
        "verdict": "differ" if contradictions else "same" if same else "not shown",
    }


def _between(side: Drawn, a: int, b: int, pairs: int) -> dict[str, Any]:
    """Return how much method a's median exceeds b's, its standard deviation, and whether that is more than chance."""
    from scipy.stats import t

    pixels = (side.draws[:, a] - side.draws[:, b]) * max(side.inflation[a], side.inflation[b])
    difference = float(side.found[a] - side.found[b])
    sigma = float(np.std(pixels + side.shifts[:, a] - side.shifts[:, b]))
    freedom = max(3.0, min(side.patches[a], side.patches[b]) - 1)
    significant = bool(abs(difference) > t.isf(LEVEL / 2 / pairs, freedom) * sigma)
    return {"difference_deg": difference, "sigma_deg": sigma, "significant": significant}


def kendall_tau(a: Array, b: Array) -> Array:
    """Return (B,), Kendall's tau-b of the rows of two tables (B, M); 0 where one has nothing but ties."""
    first, second = np.triu_indices(a.shape[1], 1)
    x, y = np.sign(a[:, first] - a[:, second]), np.sign(b[:, first] - b[:, second])
    scale = np.sqrt((x * x).sum(1) * (y * y).sum(1))
    return np.divide((x * y).sum(1), scale, out=np.zeros(len(a)), where=scale > 0)
