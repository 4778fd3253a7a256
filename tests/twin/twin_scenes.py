"""Objects and lights about a place 300 mm before the camera: what the tests of the twin's engines render."""

import numpy as np
import pytest

from fixtures.lit_surfaces import flashes_at
from scene.camera import Camera
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import Diffuse
from twin.description.object_mesh import built_in
from twin.engines.variant import SLOW, pick_variant

MIDDLE = np.array([0.0, 0.0, -300.0])
NEEDS_LLVM = pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here")


def placed(name, shape, material, size=40.0, at=(0, 0, 0), turn=None):
    """Return a shape or a mesh of this size, or three, turned, `at` from the middle."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if turn is None else turn) * size
    matrix[:3, 3] = MIDDLE + at
    return TwinObject(name, built_in(shape) if isinstance(shape, str) else shape, material, matrix)


def ball_and_wall(given, material, sampling):
    """Return a ball of this material before a white wall: each throws light on the other."""
    objects = placed("ball", "sphere", "m", 25.0), placed("wall", "square", "w", 90.0, (0, 0, -26))
    camera, materials = Camera(48, 40, 150.0, 150.0, 23.5, 19.5), {"m": material, "w": Diffuse((0.8, 0.8, 0.8))}
    return TwinScene(camera, objects, materials, given, sampling=sampling)


def lights(*vectors, near=False, intensities=1.0, white=None, middle=MIDDLE):
    """Return flashes toward which, or `near`, at which the vectors from the middle point."""
    vectors = np.array(vectors, float)
    return flashes_at(middle + vectors, middle, intensities, near=near, digits=1, white_value=white)
