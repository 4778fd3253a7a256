"""Photographs, masks, lights, normals and scans: a value or one message."""

import pytest

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
