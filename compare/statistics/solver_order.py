"""Whether two captures rank the methods alike, with the uncertainty of both."""

from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEVEL = 0.05
INTERVAL = (0.05, 0.95)


@dataclass(frozen=True)
class Medians:
    """The methods' median errors on one capture, degrees.

    Parameters
    ----------
    name : str
        Of the capture, in sentences.
    found : (M,) float64
    draws : (B, M) float64
        Of which `found` is one: over pixels, lights and registration, all methods together.
    inflation : (M,) float64
        What a standard deviation over the draws is to be multiplied by, see `block_bootstrap.Memory`.
    shifts : (B, M) float64
        The part of each draw that comes from lights and registration, which nothing inflates.
    patches : (M,) float64
        Independent patches of each method's map.
    """

    name: str
    found: Array
    draws: Array
    inflation: Array
    shifts: Array
    patches: Array

    @property
    def spread(self) -> Array:
        """(B, M) draws, each method's with its own inflation."""
        return self.found + (self.draws - self.draws.mean(0)) * self.inflation + self.shifts - self.shifts.mean(0)

    def between(self, a: int, b: int) -> tuple[float, float, float]:
        """Return how much method a's median exceeds b's, its standard deviation, and the degrees of freedom."""
        pixels = (self.draws[:, a] - self.draws[:, b]) * max(self.inflation[a], self.inflation[b])
        sigma = float(np.std(pixels + self.shifts[:, a] - self.shifts[:, b]))
        return float(self.found[a] - self.found[b]), sigma, max(3.0, min(self.patches[a], self.patches[b]) - 1)


def solver_order(methods: tuple[str, ...], real: Medians, twin: Medians) -> dict[str, Any]:
    """Return whether the methods' order by median error is the same on two captures.

    Parameters
    ----------
    methods : tuple of M str
    real, twin : Medians

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
    from scipy.stats import t

    pairs = list(combinations(range(len(methods)), 2))
    rows, contradictions = [], []
    for a, b in pairs:
        row: dict[str, Any] = {"a": methods[a], "b": methods[b]}
        signs = []
        for kind, side in (("real", real), ("twin", twin)):
            difference, sigma, freedom = side.between(b, a)
            significant = bool(abs(difference) > t.isf(LEVEL / 2 / len(pairs), freedom) * sigma)
            signs.append(np.sign(difference) * significant)
            row[kind] = {"difference_deg": difference, "sigma_deg": sigma, "significant": significant}
        if signs[0] * signs[1] < 0:
            contradictions.append([methods[a], methods[b]])
        rows.append(row)
    tau = kendall_tau(real.found[None], twin.found[None])
    drawn = kendall_tau(real.spread, twin.spread)
    low, high = np.quantile(drawn, INTERVAL) if pairs else (np.nan, np.nan)
    verdict = "differ" if contradictions else "same" if pairs and low > 0 and tau[0] > 0 else "not shown"
    return {
        "order": {
            kind: [methods[i] for i in np.argsort(side.found, kind="stable")]
            for kind, side in (("real", real), ("twin", twin))
        },
        "tau": float(tau[0]) if pairs else None,
        "tau_low": float(low) if pairs else None,
        "tau_high": float(high) if pairs else None,
        "pairs": rows,
        "contradictions": contradictions,
        "sentences": {kind: _sentences(methods, side, len(pairs)) for kind, side in (("real", real), ("twin", twin))},
        "verdict": verdict,
    }


def kendall_tau(a: Array, b: Array) -> Array:
    """Return (B,), Kendall's tau-b of the rows of two tables (B, M); 0 where one has nothing but ties."""
    first, second = np.triu_indices(a.shape[1], 1)
    x, y = np.sign(a[:, first] - a[:, second]), np.sign(b[:, first] - b[:, second])
    scale = np.sqrt((x * x).sum(1) * (y * y).sum(1))
    return np.divide((x * y).sum(1), scale, out=np.zeros(len(a)), where=scale > 0)


def _sentences(methods: tuple[str, ...], side: Medians, pairs: int) -> list[str]:
    """Return a sentence for each two methods that follow each other, the best first."""
    from scipy.stats import t

    order, told = np.argsort(side.found, kind="stable"), []
    for better, worse in pairwise(order):
        difference, sigma, freedom = side.between(worse, better)
        word = "significant" if difference > t.isf(LEVEL / 2 / pairs, freedom) * sigma else "not significant"
        told.append(f"`{methods[better]}` beats `{methods[worse]}` by {difference:.2f}°, sigma {sigma:.2f}°: {word}")
    return told
