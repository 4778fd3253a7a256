"""Predicted sigma of normals, and the next flash: known optima, numpy, Monte Carlo; it goes where the shadow is."""

from itertools import combinations

import numpy as np
import pytest

from fixtures.lit_surfaces import even_cap, spiral
from scene.normals import angular_error_deg, unit
from solve.design.next_flash import choose_flashes, exchange_flashes, gains, known_before, with_flash
from solve.design.normal_information import covariance_by_weights, information, inverted, sigma_of_normals

NOISE = 0.01


def ring(count, zenith_deg):
    """Directions (F, 1, 3) evenly on a ring about z."""
    return spiral(np.full(count, np.cos(np.radians(zenith_deg))), turn=2 * np.pi / count)[:, None]


def trace(vectors):
    return float(np.trace(inverted(information(vectors, NOISE))[0]))


def upper(rng, count):
    found = unit(rng.normal(size=(count, 1, 3)))
    found[..., 2] = np.abs(found[..., 2])
    return found


@pytest.mark.parametrize("count", [3, 4, 7, 20])
def test_an_even_ring_at_54_7_degrees_is_the_optimum(count):
    best = np.degrees(np.arctan(np.sqrt(2)))
    assert trace(ring(count, best)) == pytest.approx(9 * NOISE**2 / count, rel=1e-12)
    for zenith in (best - 5, best + 5):
        assert trace(ring(count, zenith)) > 1.005 * trace(ring(count, best))
    rng = np.random.default_rng(count)
    assert min(trace(upper(rng, count)) for _ in range(200)) > 9 * NOISE**2 / count


def test_sigma_is_that_of_least_squares_with_any_weights_by_monte_carlo():
    rng = np.random.default_rng(1)
    vectors, noise, weights = upper(rng, 12), rng.uniform(0.002, 0.01, (12, 1)), rng.uniform(0, 1, (12, 1))
    b = 0.6 * unit(np.array([[0.2, -0.3, 0.9]]))
    predicted = sigma_of_normals(b, covariance_by_weights(vectors, weights, noise))
    root = np.sqrt(weights)
    samples = (vectors[:, 0] @ b[0])[:, None] + noise * rng.standard_normal((12, 20000))
    found = np.linalg.lstsq(root * vectors[:, 0], root * samples, rcond=None)[0].T
    angle = np.radians(angular_error_deg(unit(found), unit(b)))
    assert np.degrees(np.sqrt(np.mean(angle**2) / 2)) == pytest.approx(predicted[0], rel=0.02)
    # The right weights are the best: those of the information.
    best = covariance_by_weights(vectors, 1 / noise**2, noise)
    assert best == pytest.approx(inverted(information(vectors, noise)))
    assert sigma_of_normals(b, best)[0] < predicted[0]


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
    dome = even_cap(2000, 90)[:, None]
    b, noise, seen = np.array([[0, 0, 1.0]]), np.full((2000, 1), NOISE), np.ones((2000, 1), bool)
    chosen = choose_flashes(b, known_before(b), dome, noise, seen, count)
    told = information(dome[chosen], noise[chosen], seen[chosen])
    variance = score(b, known_before(b, told)) ** 2
    assert 2 * NOISE**2 / count <= variance * (1 + 1e-9)
    assert variance < 1.15 * 2 * NOISE**2 / count


def test_an_exchange_never_harms_and_finds_the_best_set_of_all():
    b, vectors, noise, seen = case(4, flashes=9, pixels=20)

    def worth(flashes):
        some = list(flashes)
        return score(b, known_before(b, information(vectors[some], noise[some], seen[some])))

    greedy = choose_flashes(b, known_before(b), vectors, noise, seen, 4)
    better = exchange_flashes(b, 0.0, vectors, noise, seen, greedy)
    assert len(set(better)) == 4
    best = min(worth(some) for some in combinations(range(9), 4))
    assert worth(better) <= worth(greedy) + 1e-12
    assert worth(better) == pytest.approx(best, rel=0.02, abs=0.02)
