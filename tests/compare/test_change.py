"""Where normals changed between two sessions: laws on maps that the test makes."""

import numpy as np
import pytest

from compare.statistics import change
from compare.statistics.change import STATED, common_turn, fit_common, places
from scene.normals import unit

SIDE = 240
V, U = np.mgrid[:SIDE, :SIDE].astype(float)
X, Y = (U - SIDE / 2) / (0.48 * SIDE), (V - SIDE / 2) / (0.48 * SIDE)
MASK = X**2 + Y**2 < 1
SIGMA = np.radians(0.35)
MM = 0.3
"""Of a pixel."""
STEPS = np.broadcast_to(MM * np.eye(3)[:2], (SIDE, SIDE, 2, 3))
"""A plane that faces the camera."""


def noise(seed, sigma=SIGMA):
    """Turns of an unchanged object's normals: noise along both tangent axes."""
    turned = (
        np.random.default_rng(seed).standard_normal((SIDE, SIDE, 3)) * np.broadcast_to(sigma, MASK.shape)[..., None]
    )
    turned[..., 2] = 0
    turned[~MASK] = np.nan
    return turned


def flagged(found):
    known = np.isfinite(found.square)
    return np.mean(found.square[known] > -2 * np.log(STATED))


def told(found, turned):
    return places(found, np.degrees(np.linalg.norm(turned, axis=-1)), STEPS, U > SIDE / 2)


def compared(turned, sigma=SIGMA):
    return change.tested(turned, np.full(MASK.shape, sigma**2), STEPS)


def dents(where, depth_mm=0.1, across_mm=3.0):
    """Turns of the normals by round dents, a raised cosine deep: toward their middle."""
    out = np.zeros((SIDE, SIDE, 3))
    for u, v in where:
        away = np.stack([U - u, V - v], -1) * MM
        far = np.linalg.norm(away, axis=-1)
        slope = np.pi * depth_mm / across_mm * np.sin(2 * np.pi * far / across_mm) * (far < across_mm / 2)
        out[..., :2] -= slope[..., None] * away / np.maximum(far, 1e-9)[..., None]
    return out


def test_what_all_normals_share_is_found_and_not_what_a_part_of_them_does():
    """Normals turned by lights that are off, and a tenth of the object that changed: only the first is common."""
    generator = np.random.default_rng(1)
    place = np.stack([X, Y], -1)[MASK][::7]
    normals = unit(np.stack([*(0.7 * place.T), np.sqrt(1.2 - 0.49 * (place**2).sum(1))], -1))
    errors = 0.02 * generator.standard_normal((3, 3, 3))
    bent = normals + np.einsum("ijk,pj,pk->pi", errors, normals, np.concatenate([np.ones((len(place), 1)), place], 1))
    turned, changed = unit(bent) - normals, place[:, 0] < -0.75
    given = np.where(changed[:, None], turned + [0, 0.3, 0], turned) + 0.001 * generator.standard_normal(normals.shape)
    columns = common_turn(normals, place)
    found = columns @ fit_common(given, np.full(len(place), 1e-6), columns, np.zeros(0))
    assert np.linalg.norm(turned, axis=1).mean() > 0.02
    # What is left is of second order in the errors.
    assert np.abs(found - turned)[~changed].max() < 0.1 * np.linalg.norm(turned, axis=1).max()


def test_the_pose_moves_only_as_far_as_its_sigma_allows():
    generator = np.random.default_rng(2)
    columns = generator.standard_normal((5000, 3, 1))
    turned = 1.0 * columns[..., 0] + 0.01 * generator.standard_normal((5000, 3))
    variance = np.full(5000, 1e-4)
    assert fit_common(turned, variance, columns, np.array([1.0])) == pytest.approx(1, abs=0.01)
    assert abs(fit_common(turned, variance, columns, np.array([1e-4]))) < 0.2


@pytest.mark.parametrize("stated", [1.0, 0.5, 3.0])
@pytest.mark.parametrize("uneven", [False, True])
def test_an_unchanged_object_is_flagged_as_stated(stated, uneven):
    """Whatever sigma is stated, and where a part of the object errs twice as much."""
    sigma = SIGMA * np.where(uneven & (X > 0.2), 2, 1)
    shares, alarms = [], 0
    for seed in range(3):
        turned = noise(seed, sigma)
        found = compared(turned, stated * SIGMA)
        shares.append(flagged(found))
        alarms += len(told(found, turned))
        if not uneven:
            assert found.over_stated == pytest.approx(1 / stated, rel=0.02)
    assert 0.005 < np.mean(shares) < 0.02
    assert alarms == 0


@pytest.mark.parametrize("noisier", [1, 3])
def test_dents_of_a_tenth_of_a_millimetre_are_found_where_they_are_and_nothing_else(noisier):
    """Also where each normal errs by a degree, more than a dent turns most of its own."""
    places_px = [(60 + 40 * i, 70 + 33 * j) for i in range(4) for j in range(4)]
    turned = noise(5, noisier * SIGMA) + dents(places_px)
    found = compared(turned, noisier * SIGMA)
    seen = told(found, turned)
    nearest = np.linalg.norm(np.array([(one.u, one.v) for one in seen])[:, None] - np.array(places_px), axis=2)
    assert len(seen) == len(places_px)
    assert nearest.min(0).max() < 1.5
    assert all(one.chance < STATED for one in seen)
    assert {(one.u > SIDE / 2, one.lit_share) for one in seen} == {(False, 0), (True, 1)}
    assert np.median([one.height_mm for one in seen]) == pytest.approx(-0.1, rel=0.2)
    assert np.median([one.across_mm for one in seen]) == pytest.approx(3.0, rel=0.35)


def test_what_would_be_told_is_told():
    """Dents of half of the height that is stated are not, and nearly all of the whole are."""
    places_px = [(60 + 40 * i, 70 + 33 * j) for i in range(4) for j in range(4)]
    counts = {0.5: [], 1.0: []}
    for seed in range(7, 10):
        least = compared(noise(seed)).least_mm
        for times, found in counts.items():
            turned = noise(seed) + dents(places_px, depth_mm=times * least, across_mm=6.6 * MM)
            found.append(len(told(compared(turned), turned)))
    assert max(counts[0.5]) <= 1
    assert min(counts[1.0]) >= 14


def test_pixels_without_a_sigma_have_their_neighbours():
    turned, variance = noise(8), np.full(MASK.shape, SIGMA**2)
    variance[np.random.default_rng(8).random(MASK.shape) < 0.05] = np.nan
    whole, holed = compared(turned), change.tested(turned, variance, STEPS)
    assert np.isfinite(holed.square).sum() > 0.99 * np.isfinite(whole.square).sum()
    assert holed.least_mm == pytest.approx(whole.least_mm, rel=0.02)


def test_of_a_thread_nothing_is_told():
    turned = noise(9)
    turned[np.arange(SIDE) % 9 > 0] = np.nan
    found = compared(turned)
    assert np.isnan(found.least_mm)
    assert told(found, turned) == []


@pytest.mark.parametrize(("across_px", "height_mm"), [(40, 0.7), (60, -1.2)])
def test_a_large_change_is_no_error_and_one_place(across_px, height_mm):
    """It is wider than a window that tells errors, and its side lobes are as clear as a small dent."""
    turned = noise(6) + dents([(SIDE / 2, SIDE / 2)], depth_mm=-height_mm, across_mm=across_px * MM)
    (place, *more) = told(compared(turned), turned)
    assert not more
    assert (place.u, place.v) == pytest.approx((SIDE / 2, SIDE / 2), abs=2)
    assert place.height_mm == pytest.approx(height_mm, rel=0.3)
