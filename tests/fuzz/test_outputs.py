"""Own files, damaged, that the next step reads back; and the command line as a whole: a value or one message."""

import pytest

from fixtures.bad_input.doors import DOORS

NAMES = tuple(name for name in DOORS if name.startswith(("output files", "rgbn", "process")))
QUICK = ("output files",)


@pytest.mark.parametrize("door", QUICK)
def test_a_few(short, door):
    short(door)


@pytest.mark.full
@pytest.mark.parametrize("door", NAMES)
def test_many(full, door):
    full(door)
