"""Sessions, scene descriptions and folders of others: a value or one message."""

import pytest

from fixtures.bad_input.doors import DOORS

NAMES = tuple(
    name
    for name in DOORS
    if name.startswith(("session.toml", "charuco session", "scene description", "DiLiGenT layout", "picks"))
)
QUICK = ("session.toml", "charuco session", "DiLiGenT layout")


@pytest.mark.parametrize("door", QUICK)
def test_a_few(short, door):
    short(door)


@pytest.mark.full
@pytest.mark.parametrize("door", NAMES)
def test_many(full, door):
    full(door)
