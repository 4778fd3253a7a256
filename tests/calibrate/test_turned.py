"""Known lights with the usual mistakes: named, or not a word where there is none."""

import numpy as np
import pytest

from calibrate.known_lights.with_known import contradiction


def directions(count=12, seed=0):
    rng = np.random.default_rng(seed)
    tilt = np.radians(rng.uniform(15, 65, count))
    turn = rng.uniform(0, 2 * np.pi, count)
    return np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)


def names(rows):
    return tuple(f"flash_{i:03d}" for i in range(len(rows)))


def blurred(rows, degrees, seed=1):
    noise = np.random.default_rng(seed).normal(size=rows.shape) * np.radians(degrees)
    return (rows + noise) / np.linalg.norm(rows + noise, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda d: d * [1, -1, 1], "y flipped: is the file y-down"),
        (lambda d: d * [1, -1, -1], "OpenCV"),
        (lambda d: d * [1, 1, -1], "z-away"),
        (lambda d: d * [-1, 1, 1], "mirrored"),
        (lambda d: d * [-1, -1, 1], "upside down"),
        (lambda d: -d, "every sign"),
        (lambda d: d[:, [1, 0, 2]], "x and y exchanged"),
        (lambda d: d[:, [0, 2, 1]], "y and z exchanged"),
        (lambda d: d[:, [1, 0, 2]] * [1, -1, 1], "turned by 90 degrees to the left"),
        (lambda d: d[:, [1, 0, 2]] * [-1, 1, 1], "turned by 90 degrees to the right"),
        (lambda d: d[::-1], "reverse order"),
        (lambda d: np.roll(d, -1, 0), "1 frame later"),
        (lambda d: directions(seed=77), "no flip or roll"),
    ],
)
def test_the_mistake_is_named(mistake, words, seed):
    true = directions(seed=seed)
    told = contradiction("chrome ball 1", names(true), blurred(true, 1.0), mistake(true))
    assert words in told
    assert told.startswith("lights.file: chrome ball 1 sees its lights")


def test_two_exchanged_lights_are_named():
    """Two of twelve: the median does not see them."""
    true = directions(seed=1)
    a, b = np.unravel_index(np.argmin(true @ true.T), (12, 12))
    order = np.arange(12)
    order[[a, b]] = b, a
    told = contradiction("chrome ball 1", names(true), blurred(true, 1.0), true[order])
    assert told.startswith("lights.file: ")
    assert f"flash_{min(a, b):03d}, flash_{max(a, b):03d}" in told
    assert "exchanged" in told


@pytest.mark.parametrize("seed", range(5))
def test_coarse_but_right_is_no_mistake(seed):
    true = directions(seed=seed)
    seen = blurred(true, 2.0)
    seen[::4] = np.nan
    assert contradiction("x", names(true), seen, true) is None
    assert contradiction("x", names(true), np.full_like(true, np.nan), -true) is None
