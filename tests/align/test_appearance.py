"""How the scan would look: its outline is where it ends, its shading is what the albedo leaves of a photograph."""

import numpy as np
import pytest

from align.pose.scan_outline import outline_strokes
from align.pose.scan_view import View
from align.pose.shading import scan_shading
from scene.camera import Camera
from scene.pose import Pose
from scene.rays import RayCaster

CURVED = Camera(320, 240, 600.0, 590.0, 166.0, 114.0, (-0.3, 0.1, 0.002, -0.003, 0.0))


@pytest.mark.parametrize("camera", [CURVED, Camera(320, 240, 2.0, 2.0, 166.0, 114.0, projection="orthographic")])
def test_a_hundredth_of_a_pixel_inside_the_outline_is_the_scan_and_outside_is_not(bumpy, rotations, camera):
    target = np.array([6.0, -4.0, -600.0])
    pose = Pose.from_rotation_translation(rotations[1], target - rotations[1] @ bumpy.center_mm)
    strokes = outline_strokes(bumpy, pose, camera)
    middles, along = strokes.mean(1), strokes[:, 1] - strokes[:, 0]
    across = np.stack([along[:, 1], -along[:, 0]], -1) / np.linalg.norm(along, axis=1, keepdims=True)
    caster = RayCaster(bumpy)
    inside, outside = (View(caster, camera, pose).hits(middles + sign * 0.02 * across).hit for sign in (-1, 1))
    assert (inside != outside).mean() > 0.99
    # They join: from the end of each it is less than half a stroke to another's middle.
    gap = np.linalg.norm(strokes[:, None, 1] - middles[None], axis=-1)
    np.fill_diagonal(gap, np.inf)
    assert np.quantile(gap.min(1), 0.99) < 1


def test_a_photograph_divided_by_the_shading_is_the_same_under_every_light(world):
    """It is the albedo; a wrong fall-off, light, shadow or normal would differ from frame to frame."""
    pixels = world.camera.grid()
    shaded = np.stack(
        [
            scan_shading(world.mesh, world.pose, world.camera, world.lights, index, pixels)
            for index in range(len(world.lights))
        ]
    )
    assert (np.isfinite(shaded[0]) == world.mask).mean() > 0.995
    photographs = world.frames.read()[..., 1] / world.lights.intensities[:, None, None, 1]
    inner = (
        View(RayCaster(world.mesh), world.camera, world.pose).hits(pixels.reshape(-1, 2)).hit.reshape(world.mask.shape)
    )
    lit = (shaded > 0.3) & inner
    albedo = np.where(lit, photographs / np.where(lit, shaded, 1), np.nan)[:, lit.sum(0) >= 4]
    spread = np.nanstd(albedo, 0) / np.nanmean(albedo, 0)
    assert np.median(spread) < 0.02
    # Cast shadows are in it: some of them fall where the surface faces the light.
    assert np.median(photographs[(shaded == 0) & inner]) < 0.01
