"""Predicted sigma of normals: known optima, against numpy, and against Monte Carlo of least squares."""

import numpy as np
import pytest

from scene.normals import angular_error_deg, unit
from solve.design.normal_information import (
    information,
    inverted,
    lights_covariance,
    noise_covariance,
    pulls,
    sigma_of_normals,
)

NOISE = 0.01


def ring(count, zenith_deg):
    """Directions (F, 1, 3) evenly on a ring about z."""
    angle, tilt = 2 * np.pi * np.arange(count) / count, np.radians(zenith_deg)
    return np.stack([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), np.full(count, np.cos(tilt))], 1)[
        :, None
    ]


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
    predicted = sigma_of_normals(b, noise_covariance(pulls(vectors, weights), noise))
    root = np.sqrt(weights)
    samples = (vectors[:, 0] @ b[0])[:, None] + noise * rng.standard_normal((12, 20000))
    found = np.linalg.lstsq(root * vectors[:, 0], root * samples, rcond=None)[0].T
    angle = np.radians(angular_error_deg(unit(found), unit(b)))
    assert np.degrees(np.sqrt(np.mean(angle**2) / 2)) == pytest.approx(predicted[0], rel=0.02)
    # The right weights are the best: those of the information.
    best = noise_covariance(pulls(vectors, 1 / noise**2), noise)
    assert best == pytest.approx(inverted(information(vectors, noise)))
    assert sigma_of_normals(b, best)[0] < predicted[0]


def test_errors_that_lights_share_do_not_average_away():
    """One turn of all lights turns the normal by as much; the same size, each light for itself, is less with more."""
    count, turn = 50, np.radians(0.5)
    vectors = ring(count, 45)
    b = np.array([[0.0, 0.0, 0.8]])
    pull = pulls(vectors, np.ones((count, 1)))
    # Numbers: rotations about x and y. dv = w x v.
    slopes = np.stack([np.cross(axis, vectors) @ b[0] for axis in np.eye(3)[:2]], -1)
    together = np.einsum("kl,fg->fkgl", np.eye(2), np.ones((count, count))) * turn**2
    apart = np.zeros((count, 2, count, 2))
    apart[np.arange(count), :, np.arange(count)] = turn**2 * np.eye(2)
    shared = sigma_of_normals(b, lights_covariance(pull, slopes, together))
    assert shared == pytest.approx(0.5)
    assert sigma_of_normals(b, lights_covariance(pull, slopes, apart)) < 0.21 * shared
