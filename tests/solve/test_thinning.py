"""Every n-th pixel of a problem lies where it lay."""

import numpy as np

from fixtures.lit_surfaces import even_cap, lights_along
from scene.camera import Camera
from scene.frames import Frames
from solve.problem import Problem
from solve.thinning import step_for, thinned


def test_every_third_pixel_is_seen_along_its_own_ray():
    lights = lights_along(even_cap(4, 40.0))
    frames = Frames.from_linear(lights.names, np.random.default_rng(0).random((4, 31, 40, 3)))
    camera, mask = Camera(40, 31, 80.0, 80.0, 19.0, 15.0), np.ones((31, 40), bool)
    whole = Problem(frames, lights, camera, mask, slice(0, 31))
    assert step_for(whole, 31 * 40 / 9) == 3
    few = thinned(whole, 3)
    assert few.mask.shape == (11, 14)
    np.testing.assert_array_equal(few.frames.frame(2), frames.frame(2)[::3, ::3])
    np.testing.assert_allclose(few.views().reshape(11, 14, 3), whole.views().reshape(31, 40, 3)[::3, ::3], atol=1e-12)
