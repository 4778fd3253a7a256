"""The next flash: its gain is what recomputing says; it goes where the shadow is; greedy is near the optimum."""

import numpy as np
import pytest

from scene.normals import unit
from solve.design.next_flash import choose_flashes, exchange_flashes, gains, known_before, with_flash
from solve.design.normal_information import information
from tests.solve.design.test_normal_information import upper

NOISE = 0.01


def score(b, covariances):
    """Return the normals' sigma, radians, one tangent axis, mean over pixels."""
    square = np.sum(b * b, -1)
    along = np.einsum("pi,pij,pj->p", b, covariances, b) / square
    return np.mean(np.sqrt((np.trace(covariances, axis1=1, axis2=2) - along) / square / 2))


def case(seed, flashes=20, pixels=30):
    rng = np.random.default_rng(seed)
    vectors = upper(rng, flashes) * rng.uniform(0.7, 1.3, (flashes, pixels, 1))
    noise, seen = rng.uniform(0.005, 0.02, (flashes, pixels)), rng.random((flashes, pixels)) < 0.7
    normals = unit(rng.normal(size=(pixels, 3)) * [0.5, 0.5, 0] + [0, 0, 1])
    return normals * rng.uniform(0.2, 0.9, (pixels, 1)), vectors, noise, seen


def test_a_gain_is_what_recomputing_says():
    b, vectors, noise, seen = case(0)
    so_far = information(vectors[:3], noise[:3], seen[:3])
    before = known_before(b, so_far)
    found = gains(b, before, vectors[3:], noise[3:], seen[3:])
    for c in range(3, len(vectors)):
        after = known_before(b, so_far + information(vectors[[c]], noise[[c]], seen[[c]]))
        assert with_flash(before, vectors[c], noise[c], seen[c]) == pytest.approx(after, rel=1e-6, abs=1e-12)
        change = score(b, before) - score(b, after)
        assert found[c - 3] == pytest.approx(change, rel=1e-6, abs=1e-12)
    assert (found > 0).all()
    assert gains(b, before, vectors, noise, np.zeros_like(seen)) == pytest.approx(0)


@pytest.mark.parametrize("count", [3, 4, 6, 12])
def test_greedy_is_near_the_known_optimum_of_a_flat_patch(count):
    """The two components across the normal share sum (x^2 + y^2) <= n: each has the variance 2 sigma^2 / n at least."""
    index = np.arange(2000) + 0.5
    z, turn = 1 - index / 2000, np.pi * (1 + 5**0.5) * index
    across = np.sqrt(1 - z * z)
    dome = np.stack([across * np.cos(turn), across * np.sin(turn), z], 1)[:, None]
    b, noise, seen = np.array([[0, 0, 1.0]]), np.full((2000, 1), NOISE), np.ones((2000, 1), bool)
    chosen = choose_flashes(b, known_before(b), dome, noise, seen, count)
    told = information(dome[chosen], noise[chosen], seen[chosen])
    variance = score(b, known_before(b, told)) ** 2
    assert 2 * NOISE**2 / count <= variance * (1 + 1e-9)
    assert variance < 1.15 * 2 * NOISE**2 / count


def test_an_exchange_never_harms_and_finds_the_best_set_of_all():
    from itertools import combinations

    b, vectors, noise, seen = case(4, flashes=9, pixels=20)
    start = known_before(b)

    def worth(flashes):
        some = list(flashes)
        return score(b, known_before(b, information(vectors[some], noise[some], seen[some])))

    greedy = choose_flashes(b, start, vectors, noise, seen, 4)
    better = exchange_flashes(b, start, vectors, noise, seen, greedy)
    assert len(set(better)) == 4
    best = min(worth(some) for some in combinations(range(9), 4))
    assert worth(better) <= worth(greedy) + 1e-12
    assert worth(better) == pytest.approx(best, rel=0.02, abs=0.02)
