"""Each statement of the benchmark that is reproduced, on the smallest sweep that shows it."""

from dataclasses import replace

import pytest

from experiments.stagings import SOLVERS, benchmark
from experiments.sweeps.cell import run_cell
from experiments.sweeps.findings import FINDINGS, answers
from twin.engines.variant import SLOW, pick_variant

pytestmark = [
    pytest.mark.full,
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here"),
]
SIDE = 64
SHOWN = {
    "images": ((0, -1), ("Three images",)),
    "noise": ((0, -1), ("Most methods' normals", "Least squares gets")),
    "ring": ((0, 2, 4, -1), ("A ring in between", "A ring near the camera", "A ring near the ground")),
    "roughness": ((0, 2, -1), ("With the roughness",)),
    "shadow": ((0, -1), ("All calibrated",)),
    "specularity": ((0, -1), ("More specularity",)),
}
"""By experiment: the levels that suffice, and how the statements begin that they show."""


@pytest.mark.parametrize("name", SHOWN)
def test_what_the_benchmark_says_is_seen(name):
    places, beginnings = SHOWN[name]
    one = benchmark()[name]
    few = replace(one, levels=tuple(one.levels[place] for place in places), seeds=1)
    rows = []
    for cell in few.cells(methods=tuple(SOLVERS)):
        rows += run_cell(replace(cell, recipe=replace(cell.recipe, side=SIDE)))["rows"]
    found = {one.finding.claim: one for one in answers(rows)}
    for beginning in beginnings:
        (answer,) = (one for claim, one in found.items() if claim.startswith(beginning))
        assert answer.verdict == "reproduced", answer.numbers


def test_every_statement_shown_is_one_of_the_text():
    beginnings = [beginning for _, all_of in SHOWN.values() for beginning in all_of]
    for beginning in beginnings:
        assert sum(finding.claim.startswith(beginning) for finding in FINDINGS) == 1
