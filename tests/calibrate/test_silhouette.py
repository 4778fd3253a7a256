"""Outlines to a tenth of a pixel, on images whose truth is geometry; a metal's reflectance rises towards its own."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from calibrate.silhouette.ball_silhouette import fit_mask, fit_outline
from calibrate.silhouette.explained_profiles import LAWS, fresnel, index_of, laws_of, schlick
from fixtures.ball_scene import Ball, World, distant, radiance
from fixtures.lit_surfaces import spiral
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere


def test_no_outline_is_said():
    noise = 0.2 + 0.01 * np.random.default_rng(0).normal(size=(4, 120, 120, 3))
    frames = Frames.from_linear(tuple("abcd"), noise)
    camera = Camera(120, 120, 200.0, 200.0, 60.0, 60.0)
    assert fit_outline(frames, camera, Sphere("chrome", np.array([60.0, 60.0]), 30.0), search_px=3.0) is None


@pytest.mark.parametrize(("radius", "near"), [(15.0, 0.03), (67.0, 0.015)])
def test_limb_darkening_does_not_shrink_a_matte_ball(radius, near):
    """Its steepest gradient lies a fifth of a pixel inside the outline."""
    size = int(2 * radius + 30)
    camera = Camera(size, size, 900.0, 900.0, size / 2 + 0.3, size / 2 - 0.4)
    rng = np.random.default_rng(10001)
    center = np.array([1.3, -0.7, -900.0])
    # The table stands so far behind that no shadow is in the picture.
    table = {"table_point": 4 * center, "table_normal": np.array([0, 0, 1.0]), "table_half": 9000.0, "bounce": False}
    world = World(camera, [Ball("white", center, radius, albedo=1.0)], np.zeros((8, 3)), np.ones((8, 3)), **table)
    toward = spiral(np.cos(np.deg2rad(rng.uniform(20, 60, 8))), turn=np.pi / 4)
    images, _ = radiance(distant(world, toward, np.full((8, 3), 0.6)), blur_px=0.7)
    frames = Frames.from_linear(tuple("abcdefgh"), images + 2e-3 * rng.normal(size=images.shape))
    start = Sphere("white", camera.project(center) + [0.6, -0.5], radius + 0.7)
    fit = fit_outline(frames, camera, start, search_px=2.0)
    error = np.array([*(fit.sphere.center_px - camera.project(center)), fit.sphere.radius_px - radius])
    np.testing.assert_allclose(error, 0, atol=near)
    assert np.all(np.abs(error) < 3 * np.sqrt(np.diag(fit.covariance)))
    # The blur, with the pixel's own area and the interpolation between pixels.
    assert fit.blur_px == pytest.approx(np.hypot(0.7, 0.45), abs=0.12)


@pytest.mark.parametrize("facing", [0.5, 0.6, 0.7])
def test_a_mirror_is_as_large_as_it_is(facing):
    """It continues, dimmed, what lies behind it, and squeezes half of the room into its last pixels.

    The picture ends beside the ball: none of the table that it mirrors is seen. Its reflectance rises to 1, as a
    metal's: its outline shows no edge. In scenes by others a profile of one reflectance missed it by 3 to 14 sigma.
    """
    radius, size = 67.0, 156
    camera = Camera(size, size, 900.0, 900.0, size / 2 + 0.3, size / 2 - 0.4)
    rng = np.random.default_rng(10002)
    v, u = np.mgrid[0:size:0.25, 0:size:0.25] - 0.375
    far = np.hypot(u - camera.cx, v - camera.cy) / radius
    # A ray that meets the ball at this slope leaves it by twice the slope; an uneven room grows darker that way.
    turned = 2 * np.arccos(np.minimum(far, 1))
    images = []
    for k in range(6):
        room = 0.3 + 0.1 * np.cos(np.arctan2(v - camera.cy, u - camera.cx) - k)
        reflects = facing + (1 - facing) * (1 - np.sqrt(1 - np.minimum(far, 1) ** 2)) ** 5
        inside = reflects * room * np.maximum(1 - 0.4 * turned, 0)
        fine = np.where(far < 1, inside, room)
        images.append(gaussian_filter(fine.reshape(size, 4, size, 4).mean((1, 3)), 0.7))
    noisy = np.stack(images) + rng.normal(size=(6, size, size)) * 2e-3
    frames = Frames.from_linear(tuple("abcdef"), np.repeat(noisy[..., None], 3, -1).astype(np.float32))
    start = Sphere("chrome", np.array([camera.cx + 0.5, camera.cy - 0.6]), radius - 0.5)
    fit = fit_outline(frames, camera, start, search_px=2)
    np.testing.assert_allclose(fit.sphere.center_px, [camera.cx, camera.cy], atol=0.05)
    # An orthographic picture of the ball: its outline is a circle of this radius.
    off = fit.sphere.outline(camera, 90)[0, 0] - camera.cx - radius
    sigma = np.sqrt(fit.covariance[2, 2])
    assert abs(off) < 2 * sigma < 0.6


@pytest.mark.parametrize("radius_px", [25.3, 40.2, 67.9])
def test_a_mask_of_a_ball_off_the_axis_gives_the_ball(radius_px):
    """The mask divided by itself showed an edge 2.6 px outside, and at 68 px it won."""
    camera = Camera(600, 400, 840.0, 840.0, 304.3, 196.9)
    ball = Sphere("white", np.array([476.4, 302.2]), radius_px)
    fit = fit_mask(ball.mask(camera), camera, ball)
    np.testing.assert_allclose(fit.sphere.center_px, ball.center_px, atol=0.06)
    assert fit.sphere.radius_px == pytest.approx(radius_px, abs=0.05)


@pytest.mark.parametrize("facing", [0.5, 0.67, 0.9])
@pytest.mark.parametrize("law", LAWS)
def test_none_facing_the_camera_all_at_the_outline(law, facing):
    assert law(np.array([1.0, 0.0]), facing, 3.0) == pytest.approx([0, 1], abs=1e-12)
    assert np.all(np.diff(law(np.linspace(0.05, 0, 50), facing, 3.0)) > 0)


@pytest.mark.parametrize(
    ("balls", "laws"), [([0.3, -0.1], [fresnel]), ([-0.5, -0.8], [schlick]), ([-0.5], LAWS), ([], LAWS)]
)
def test_where_balls_leave_the_law_open_both_are_tried(balls, laws):
    """One ball of a plain table said -0.5 of Fresnel's, which was taken: both of the session came out 0.3 px small."""
    assert list(laws_of(balls)) == list(laws)


@pytest.mark.parametrize(("facing", "refraction"), [(0.45, 3.0), (0.67, 3.0), (0.9, 3.0), (0.64, 1.9), (0.92, 0.96)])
def test_the_law_of_metals_is_fresnels(facing, refraction):
    """As Mitsuba computes it, of a metal that reflects so much."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    cosine, index = np.linspace(0, 1, 100), index_of(facing, refraction)
    there = np.array(mi.fresnel_conductor(mi.Float(cosine), mi.Complex2f(index.real, index.imag)))
    assert there[-1] == pytest.approx(facing, abs=1e-5)
    assert fresnel(cosine, facing, refraction) == pytest.approx((there - there[-1]) / (1 - there[-1]), abs=1e-4)
