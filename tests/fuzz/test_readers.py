"""Photographs, masks, lights, normals and scans: a value or one message."""

import pytest

from fixtures.bad_input.cases import Damaged
from fixtures.bad_input.doors import DOORS

NAMES = tuple(
    name for name in DOORS if name.startswith(("photograph", "DNG", "texture", "mask", "lights", "normals", "scan "))
)
QUICK = tuple(name for name in NAMES if not name.endswith("mat") and "mat" not in name and "exr" not in name)


@pytest.mark.parametrize("door", QUICK)
def test_a_few(short, door):
    short(door)


@pytest.mark.full
@pytest.mark.parametrize("door", NAMES)
def test_many(full, door):
    full(door)


def test_a_case_that_fails_is_shown_by_sizes():
    """Hypothesis warns of a long one, and would end with that instead of what failed."""
    assert repr(Damaged({"a.mat": b"\0" * 100_000, "b": None})) == "Damaged(a.mat: 100000 bytes, b: removed)"
