"""What comes in by each door, damaged: a value or one message. Seconds in `make test`, minutes in all tests."""

import random

import pytest

from fixtures.bad_input.doors import DOORS
from fixtures.bad_input.law import Damaged, Watched, fuzz, shares

FULL = 2000
"""Cases of `make test-all`, over all doors: about three minutes on two cores."""
SHORT = 300
"""Of `make test`, which leaves out the slow doors."""
SLOW = ("scene", "picks", "rgbn", "process", "session.json")
QUICK = [name for name in DOORS if not name.startswith(SLOW) and not name.endswith("mat") and "exr" not in name]
FOREIGN = ("photograph", "mask", "lights", "normals", "scan ")


@pytest.fixture(scope="module")
def worker(tmp_path_factory):
    """One watched process."""
    found = Watched(tmp_path_factory.mktemp("samples"))
    yield found
    found.close()


@pytest.mark.parametrize("door", [name for name in DOORS if name.startswith(FOREIGN)])
def test_what_is_whole_is_read(worker, door):
    """Else nothing would be damaged that was ever read."""
    assert worker.judge(door, {}) == ("value", "")


@pytest.mark.parametrize("door", QUICK)
def test_a_few(worker, door):
    """Always the same ones."""
    fuzz(worker, door, shares(SHORT)[door], 0)


@pytest.mark.full
@pytest.mark.parametrize("door", DOORS)
def test_many(worker, door):
    """Others each time; a failure names their seed."""
    fuzz(worker, door, shares(FULL)[door], random.SystemRandom().randrange(2**32))


def test_a_case_that_fails_is_shown_by_sizes():
    """Hypothesis warns of a long one, and would end with that instead of what failed."""
    assert repr(Damaged({"a.mat": b"\0" * 100_000, "b": None})) == "Damaged(a.mat: 100000 bytes, b: removed)"
