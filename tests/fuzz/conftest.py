"""One watched process a test worker, and the two sizes of the fuzzer: seconds in `make test`, minutes in all tests."""

import random

import pytest

from fixtures.bad_input.law import Watched, fuzz, shares

FULL = 2000
"""Cases of `make test-all`, over all doors: about three minutes on two cores."""
SHORT = 300
"""Of `make test`, whose files leave out the slow doors."""


@pytest.fixture(scope="session")
def worker(tmp_path_factory):
    found = Watched(tmp_path_factory.mktemp("samples"))
    yield found
    found.close()


@pytest.fixture
def short(worker):
    """Take a few cases to a door, always the same ones."""
    return lambda door: fuzz(worker, door, shares(SHORT)[door], 0)


@pytest.fixture
def full(worker):
    """Take a door's share of all cases there, others each time; a failure names their seed."""
    return lambda door: fuzz(worker, door, shares(FULL)[door], random.SystemRandom().randrange(2**32))
