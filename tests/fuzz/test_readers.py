"""Photographs, masks, lights, normals and scans: a value or one message."""

import pytest

from fixtures.bad_input.doors import DOORS
from fixtures.bad_input.law import Damaged

NAMES = tuple(
    name for name in DOORS if name.startswith(("photograph", "DNG", "texture", "mask", "lights", "normals", "scan "))
)
QUICK = tuple(name for name in NAMES if not name.endswith("mat") and "mat" not in name and "exr" not in name)


@pytest.mark.parametrize("door", NAMES)
def test_what_is_whole_is_read(worker, door):
    """Else nothing would be damaged that was ever read."""
    assert worker.judge(door, {}) == ("value", "")


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
