"""Normals of noisy scans, against surfaces whose normals are known exactly."""

import numpy as np
import pytest

from align.scan.scan_noise import Neighbours, scan_noise
from align.scan.smooth_normals import smooth_normals
from fixtures.star_shapes import blob, brick, cube, relief, shaken
from scene.mesh import Mesh
from scene.normals import angular_error_deg

FACES = 30_000


def scan_of(shape, noise_mm=0.0, *, correlated=False, seed=10_000):
    """Return a scan of the shape and the true normals where its vertices belong."""
    generator = np.random.default_rng(seed)
    mesh = shape.mesh(FACES // 2, generator)
    normals = shape.normals(mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True))
    return shaken(mesh, noise_mm, generator, correlated=correlated), normals


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("make", [blob, brick, cube])
def test_the_noise_is_found_and_how_far_it_reaches(make, correlated):
    scan, _ = scan_of(make(10_003), 0.05, correlated=correlated)
    noise = scan_noise(scan, Neighbours.of(scan))
    assert noise.sigma_mm == pytest.approx(0.05, rel=0.5 if correlated else 0.1)
    assert noise.reach > 0 if correlated else noise.reach == 0


def test_a_shape_is_no_noise():
    """Half of the surface is all relief, with 0.4 mm amplitude: the other half tells that there is no noise."""
    scan, _ = scan_of(relief(10_004))
    assert scan_noise(scan, Neighbours.of(scan)).sigma_mm < 0.005


@pytest.mark.full
@pytest.mark.parametrize(("make", "bar_deg"), [(blob, 0.3), (brick, 0.5), (cube, 0.2)])
def test_noise_goes_and_sigma_says_what_is_left(make, bar_deg):
    scan, real = scan_of(make(10_005), 0.05)
    normals, sigma = smooth_normals(scan)
    error = angular_error_deg(normals, real)
    assert np.median(error) < bar_deg
    assert np.median(error) < 0.3 * np.median(angular_error_deg(scan.vertex_normals, real))
    assert (error < 2 * sigma).mean() > 0.9
    # Where sigma says sure, errors are small; where it says unsure, they are larger.
    parts = np.array_split(np.argsort(sigma), 4)
    rms = [np.sqrt(np.mean(np.sort(error[part])[: int(0.98 * len(part))] ** 2)) for part in parts]
    assert rms[0] < rms[3]
    assert np.sqrt(np.mean(sigma[parts[0]] ** 2)) < 2 * rms[0]


@pytest.mark.full
@pytest.mark.parametrize(("make", "share"), [(blob, 0.1), (brick, 0.6), (relief, 1.02)])
def test_a_scan_without_noise_is_not_smoothed(make, share):
    """Not a switch: the smallest fits win, or the faces' mean where they do not resolve the surface."""
    scan, real = scan_of(make(10_006))
    error, plain = (angular_error_deg(n, real) for n in (smooth_normals(scan)[0], scan.vertex_normals))
    assert np.sqrt(np.mean(error**2)) < share * np.sqrt(np.mean(plain**2))


@pytest.mark.full
@pytest.mark.parametrize("noise_mm", [0.0, 0.05])
def test_creases_stay_sharp(noise_mm):
    """On a box, normals beside an edge are one face's or the other's, not between."""
    scan, real = scan_of(cube(10_007), noise_mm)
    error = angular_error_deg(smooth_normals(scan)[0], real)
    assert np.quantile(error, 0.97) < 4
    assert np.quantile(angular_error_deg(scan.vertex_normals, real), 0.97) > 10


@pytest.mark.full
def test_turning_and_shrinking_the_scan_does_the_same_to_its_normals(rotations):
    scan, _ = scan_of(brick(10_008), 0.05)
    normals, sigma = smooth_normals(scan)
    turned, same = smooth_normals(Mesh(0.1 * scan.vertices @ rotations[0].T, scan.faces))
    assert np.quantile(angular_error_deg(turned, normals @ rotations[0].T), 0.99) < 0.05
    np.testing.assert_allclose(np.median(same), np.median(sigma), rtol=0.02)


def test_open_scraps_have_normals_too():
    """One triangle, a strip, and a vertex that no face uses: nothing to fit, nothing to stumble over."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [9, 9, 9.0]])
    normals, sigma = smooth_normals(Mesh(vertices, np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3]])))
    np.testing.assert_allclose(normals[:5], [[0, 0, 1]] * 5, atol=1e-6)
    assert np.isfinite(sigma[:5]).all()
