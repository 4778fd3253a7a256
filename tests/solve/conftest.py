"""What programs of others are given."""

import numpy as np
import pytest

from fixtures.lit_surfaces import ball_seen, even_cap, lights_along, matte
from scene.camera import Camera
from scene.frames import Frames


@pytest.fixture
def asked():
    """Return what makes (frames, lights, camera, mask, normals) of a reddish ball off the middle, uneven if wished."""

    def made(strength=1.0, texture=0.0):
        camera = Camera(110, 90, 1.0, 1.0, 62.0, 40.0, projection="orthographic")
        _, normals, mask = ball_seen(camera, (0, 0, -100), 32.0, rim=0.45)
        normals = np.where(mask[..., None], normals, 0)
        lights = lights_along(even_cap(9, 26), strength).normalised()
        v, u = np.mgrid[:90, :110]
        albedo = [0.4, 0.25, 0.15] * (1 + texture * np.sin(np.stack([u / 5, v / 7, (u + v) / 6], -1)))
        return Frames.from_linear(lights.names, matte(lights, normals, normals, albedo)), lights, camera, mask, normals

    return made
