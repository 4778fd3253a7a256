"""Scenes with known truth that calibrate must undo."""

import numpy as np
import pytest

from fixtures.ball_scene import World, flashes, render
from scene.camera import Camera


def table_scene(*, count=10, width=600, height=400, seed=0):
    """Two mirrors and a matte ball around an object of three merged lumps; near flashes."""
    rng = np.random.default_rng(seed)
    camera = Camera(width, height, 1.4 * width, 1.4 * width, width / 2 + 4.3, height / 2 - 3.1)
    powers = 0.55 * rng.uniform(0.7, 1.4, (count, 1)) * rng.uniform(0.96, 1.04, (count, 3))
    world = World(camera, [], flashes(count, seed=seed), powers)
    world.stand("chrome", -215, -110, 38).stand("chrome", 220, 130, 38).stand("white", 205, -130, 35)
    world.stand("object", -40, -10, 62).stand("object", 40, -25, 60).stand("object", 0, 55, 58)
    return world


@pytest.fixture(scope="session")
def table():
    """(world, frames) of the usual scene."""
    world = table_scene()
    return world, render(world)


def missed(found, true):
    """By how much a circle misses another: (u, v, radius), px."""
    return np.array([*(found.center_px - true.center_px), found.radius_px - true.radius_px])
