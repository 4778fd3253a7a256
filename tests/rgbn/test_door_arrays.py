"""`rgbn.solve` on arrays: the laws of shading, the session's own solve, clear refusals."""

from dataclasses import replace

import numpy as np
import pytest

import rgbn
from fixtures.lit_surfaces import ball_seen
from scene.camera import Camera
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg

HEIGHT, WIDTH = 30, 40


@pytest.fixture
def world():
    """A matte ball of changing colour under lights of unequal strength: images, light vectors, normals, mask."""
    rng = np.random.default_rng(5)
    _, normals, mask = ball_seen(Camera.orthographic(WIDTH, HEIGHT), (0, 0, -100), 22.0, rim=0.6**0.5)
    toward = rng.normal(size=(9, 3)) * [0.35, 0.35, 0.05] + [0, 0, 1]
    vectors = toward / np.linalg.norm(toward, axis=1, keepdims=True) * rng.uniform(0.6, 1.4, (9, 1))
    albedo = rng.uniform(0.3, 0.6, (HEIGHT, WIDTH, 3))
    images = np.clip(np.einsum("hwk,fk->fhw", normals, vectors), 0, None)[..., None] * albedo
    return images * mask[..., None], vectors, normals, mask, albedo


def off_deg(estimate, normals, mask):
    return angular_error_deg(estimate.normals, normals)[mask].max()


@pytest.mark.parametrize("method", ["ls", "iterative"])
def test_a_matte_world_comes_back(world, method):
    """Normals, and the albedo in the images' unit: rows of `lights` are direction times intensity."""
    images, vectors, normals, mask, albedo = world
    found = rgbn.solve(images, vectors, mask, method)
    assert found.method == method
    assert off_deg(found, normals, mask) < 0.01
    np.testing.assert_allclose(found.albedo[mask], albedo[mask], rtol=1e-3)
    assert np.isnan(found.normals[~mask]).all()
    grey = rgbn.solve(images[..., 1], vectors, mask, method)
    assert off_deg(grey, normals, mask) < 0.01
    np.testing.assert_allclose(grey.albedo[mask], np.repeat(albedo[mask][:, 1:2], 3, 1), rtol=1e-3)


def test_permuted_frames_and_other_units_leave_the_normals(world):
    images, vectors, _, mask, _ = world
    noisy = images * np.random.default_rng(2).normal(1, 0.05, images.shape)
    found = rgbn.solve(noisy, vectors, mask)
    order = np.random.default_rng(3).permutation(len(images))
    permuted = rgbn.solve(noisy[order], vectors[order], mask)
    brighter = rgbn.solve(3000 * noisy, vectors, mask)
    stronger = rgbn.solve(noisy, 4 * vectors, mask)
    for other, share in ((permuted, 1), (brighter, 3000), (stronger, 0.25)):
        assert off_deg(other, found.normals.astype(float), mask) < 0.02
        np.testing.assert_allclose(other.albedo[mask], share * found.albedo[mask], rtol=1e-3)
    # One light and its images, twice as strong together, are the same light.
    scale = np.ones(len(images))
    scale[4] = 2
    same = rgbn.solve(noisy * scale[:, None, None, None], vectors * scale[:, None], mask, "ls")
    plain = rgbn.solve(noisy, vectors, mask, "ls")
    unequal = rgbn.solve(noisy * scale[:, None, None, None], vectors, mask, "ls")
    assert off_deg(unequal, plain.normals.astype(float), mask) > 20 * off_deg(same, plain.normals.astype(float), mask)


def test_whole_numbers_are_shares_of_their_white_and_clipped_ones_are_left_out(world):
    images, vectors, normals, mask, albedo = world
    for dtype in (np.uint8, np.uint16):
        white = np.iinfo(dtype).max
        whole = np.round(images * white).astype(dtype)
        found = rgbn.solve(whole, vectors, mask, "ls")
        bar = 3 if dtype is np.uint8 else 0.02
        assert off_deg(found, normals, mask) < bar
        np.testing.assert_allclose(np.median(found.albedo[mask] / albedo[mask]), 1, atol=0.01)
    clipped = np.round(np.minimum(images * 1.6, 1) * 65535).astype(np.uint16)
    believed = rgbn.solve(clipped, vectors, mask, "ls", saturation=70000.0)
    left_out = rgbn.solve(clipped, vectors, mask, "ls")
    assert (clipped == 65535).any()
    assert off_deg(left_out, normals, mask) < 0.1 < 1 < off_deg(believed, normals, mask)
    floats = rgbn.solve(clipped.astype(float), vectors, mask, "ls", saturation=65000.0)
    assert off_deg(floats, left_out.normals.astype(float), mask) < 0.02


def test_near_lights_need_the_camera_and_use_it(world):
    _, vectors, normals, mask, albedo = world
    camera = Camera(WIDTH, HEIGHT, 60.0, 60.0, 19.5, 14.5)
    at = np.array([0.0, 0, -300])
    toward = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    names = tuple(map(str, range(len(vectors))))
    near = Lights(names, toward, np.ones((len(vectors), 3)), at + 400 * toward, at)
    points = camera.points_at_depth(camera.grid().reshape(-1, 2), -300.0)
    shading = np.einsum("fpck,pk->fpc", near.at(points), normals.reshape(-1, 3)).clip(0)
    images = shading.reshape(-1, HEIGHT, WIDTH, 3) * albedo
    assert off_deg(rgbn.solve(images, near, mask, "ls", camera), normals, mask) < 0.05
    assert off_deg(rgbn.solve(images, near.directions, mask, "ls"), normals, mask) > 2
    with pytest.raises(SceneError, match="camera"):
        rgbn.solve(images, near, mask)
    with pytest.raises(SceneError, match="41 x 30"):
        rgbn.solve(images, near, mask, camera=replace(camera, width=41))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda i, v, m: (i, v.T, m), r"\(3, 9\), expected \(9, 3\).*lights\.T"),
        (lambda i, v, m: (i[..., 0].transpose(1, 2, 0), v, m), r"\(30, 40, 9\).*moveaxis"),
        (lambda i, v, m: (i.transpose(1, 2, 3, 0), v, m), r"\(30, 40, 3, 9\).*moveaxis"),
        (lambda i, v, m: (i[0, ..., 0], v, m), r"\(30, 40\), expected \(F, H, W\)"),
        (lambda i, v, m: (i[..., :2], v, m), r"expected \(F, H, W\)"),
        (lambda i, v, m: ([i[0], i[1, :9]], v[:2], m), "one size"),
        (lambda i, v, m: ((i * 999).astype(int), v, m), "int64, expected floating point"),
        (lambda i, v, m: (i[:5], v, m), r"\(9, 3\), expected \(5, 3\)"),
        (lambda i, v, m: (i, v * (np.arange(9) != 4)[:, None], m), "row 4 has no direction"),
        (lambda i, v, m: (i, np.where(np.arange(9)[:, None] == 2, np.nan, v), m), "row 2 has no direction"),
        (lambda i, v, m: (i, v * np.logspace(0, 3, 9)[:, None], m), "lengths are their intensities"),
        (lambda i, v, m: (np.where(m[..., None], np.nan, i), v, m), r"images\[0\].*not finite"),
        (lambda i, v, m: (i, v, m[:, :9]), r"mask: found an array \(30, 9\)"),
        (lambda i, v, m: (i, v, m & False), "mask: it is empty"),
        (lambda i, v, m: (i, None, m), "ldr, entropy or tv"),
    ],
)
def test_what_does_not_fit_is_refused_with_a_cure(world, spoil, words):
    images, vectors, _, mask, _ = world
    with pytest.raises(SceneError, match=words):
        rgbn.solve(*spoil(images, vectors, mask))
