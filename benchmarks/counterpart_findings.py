"""What virtual captures beside their renderings say to the statements of the benchmark's section 4."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.counterpart_tables import Results
from benchmarks.virtual_pairs import Pair
from experiments.stagings import CALIBRATED
from experiments.sweeps.findings import verdict_of

ALIKE = 0.7
"""Correlation from which on two error maps count as similar."""
LEAST_DEG = 1.0
"""Errors that differ by less are not told apart."""
SIDES = {"real": "virtual", "twin": "rendered"}


@dataclass(frozen=True)
class Statement:
    """A statement of the benchmark's text.

    claim: In our words. rule: When it counts as so, and `judge`, by the results: whether it is, and in which numbers.
    """

    claim: str
    rule: str
    judge: Callable[[Results], tuple[bool, str]]


def _patterns(results: Results) -> tuple[bool, str]:
    pairs = [*results["spheres"], *results["cardboard"]]
    middle = float(np.nanmedian([pair.correlation("ls") for pair in pairs]))
    differ = sum(pair.found["reasons"]["pattern"] == "differ" for pair in pairs)
    return middle >= ALIKE and not differ, f"correlation {middle:.2f}; the place differs in {differ} of {len(pairs)}"


def _calibrated(pair: Pair, side: str) -> float:
    return float(np.mean([pair.medians(side)[name] for name in CALIBRATED]))


def _rise(experiment: str) -> Callable[[Results], tuple[bool, str]]:
    def judge(results: Results) -> tuple[bool, str]:
        ends = {side: [_calibrated(results[experiment][at], side) for at in (0, -1)] for side in SIDES}
        told = ", ".join(f"{first:.1f} to {last:.1f}° {SIDES[side]}" for side, (first, last) in ends.items())
        return all(last - first >= LEAST_DEG for first, last in ends.values()), told

    return judge


def _apart(pairs: Sequence[Pair]) -> tuple[float, float]:
    """Return by how much `ls` errs differently on both sides, as found and with the object's distance told; medians."""
    twins = [pair.medians("twin")["ls"] for pair in pairs]
    found = [abs(pair.medians("real")["ls"] - twin) for pair, twin in zip(pairs, twins, strict=True)]
    told = [abs(pair.known["ls_deg"] - twin) for pair, twin in zip(pairs, twins, strict=True)]
    return float(np.median(found)), float(np.median(told))


def _variation(results: Results) -> tuple[bool, str]:
    apart, _ = _apart(results["ring"])
    return apart >= LEAST_DEG, f"`ls` {apart:.1f}° apart (median)"


def _positions(results: Results) -> tuple[bool, str]:
    apart, told = _apart(results["ring"])
    return told >= apart / 2, f"`ls` {apart:.1f}° apart, {told:.1f}° with the object's distance told (medians)"


RISES = f"the calibrated methods' mean is {LEAST_DEG:g}° greater at the last level than at the first, on both sides"
STATEMENTS = (
    Statement(
        "Error patterns of real and synthetic are similar (spheres, folded card).",
        f"the error maps of `ls` correlate by {ALIKE:g} (median), and no pair differs in where the errors are",
        _patterns,
    ),
    Statement("Errors grow with the ambient light of the room.", RISES, _rise("ambient")),
    Statement("Folded cards: the errors grow as the angle closes.", RISES, _rise("cardboard")),
    Statement("A higher ISO, more noise and greater errors.", RISES, _rise("iso")),
    Statement(
        "A ring held by hand varies from the synthetic one.", f"`ls` differs by {LEAST_DEG:g}° or more", _variation
    ),
    Statement(
        "Uneven positions of the flash are the likely cause.",
        "with the lights as found, and the object's distance told, half of the difference is left",
        _positions,
    ),
)


def findings(results: Results) -> str:
    """Return the table of the statements and what the pairs say to each."""
    rows = ["| the benchmark says | counts as so if | here | verdict |", "|---" * 4 + "|"]
    for one in STATEMENTS:
        holds, words = one.judge(results)
        rows.append(f"| {one.claim} | {one.rule} | {words} | **{verdict_of([holds])}** |")
    return "\n".join(rows) + "\n"
