"""Sessions of the virtual camera with known truth, for the benchmark of calibrate.

Seeds 0 to 999 are the benchmark's; nothing was tuned on them. Every figure is against what the ray tracer was given.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fixtures.ball_scene import Ball, World, distant, flashes, photograph
from scene.camera import Camera
from scene.frames import Frames
from twin.camera.virtual_camera import Sensor

Array = NDArray[np.float64]
CAMERA = Camera(1200, 800, 1666.7, 1666.7, 606.8, 394.9)
OBJECT = np.array([0.0, 0.0, -1000.0])
FLASHES = 12


@dataclass(frozen=True)
class Session:
    """A world and its photographs."""

    world: World
    frames: Frames
    sensor: Sensor


def session(seed: int, kind: str) -> Session:
    """Make a session: see `session_world`."""
    world = session_world(seed, kind)
    rng = np.random.default_rng([seed, 7])
    sensor = Sensor(full_well_e=float(rng.choice([15000, 40000])), blur_px=float(rng.uniform(0.45, 0.85)))
    return Session(world, photograph(world, sensor, rng), sensor)


def session_world(seed: int, kind: str) -> World:
    """Draw a world.

    `kind`: "two" chrome balls of 67 px and a white one beside an object; "four" chrome balls of 67 px and a white one;
    "one" chrome ball of 170 px; "far": as "two", the flashes so far that their rays are parallel.
    """
    rng = np.random.default_rng([seed, sum(kind.encode())])
    lights = flashes(FLASHES, near_mm=700, far_mm=1200, center=OBJECT, seed=int(rng.integers(1 << 31)))
    world = World(CAMERA, [], lights, np.zeros((FLASHES, 3)))
    tilt = np.array([rng.normal(0, 0.04), rng.normal(0.08, 0.04), 1.0])
    world.table_normal = tilt / np.linalg.norm(tilt)
    world.table_texture = str(rng.choice(["plain", "wood", "noise"]))
    world.table_albedo = rng.uniform(0.08, 0.4) * rng.uniform(0.9, 1.1, 3)
    world.table_second = world.table_albedo * rng.uniform(0.4, 0.8)
    world.table_half = rng.uniform(420, 700)
    world.ambient = rng.uniform(0.004, 0.02) * rng.uniform(0.8, 1.2, 3)
    px = 1020.0 / CAMERA.fx
    jitter = rng.uniform(-25, 25, (6, 2))
    if kind == "one":
        angle = rng.uniform(0, 2 * np.pi)
        world.stand("chrome", 170 * np.cos(angle), 90 * np.sin(angle), 170 * px)
    else:
        sides = [(-235, -105), (240, 115), (-230, 120), (235, -115)]
        order = sides if kind == "four" else [sides[i] for i in ((0, 1, 2) if rng.random() < 0.5 else (2, 3, 0))]
        for (x, y), (a, b) in zip(order[: 4 if kind == "four" else 2], jitter[:4], strict=False):
            world.stand("chrome", x + a, y + b, 67 * px)
        x, y = (0, 140) if kind == "four" else order[2]
        white = {"gloss": rng.uniform(0.0, 0.08), "shininess": rng.uniform(30, 150)} if rng.random() < 0.5 else {}
        world.stand("white", x + jitter[4, 0], y + jitter[4, 1], 60 * px, albedo=rng.uniform(0.75, 0.9), **white)
        lump = 45 if kind == "four" else 60
        for x, y in ((-0.6, -0.3), (0.6, -0.4), (0.0, 0.7)):
            middle = world.on_table(lump * x, lump * y - 30) + 0.8 * lump * world.table_normal
            world.balls.append(Ball("object", middle, lump * rng.uniform(0.95, 1.05), 0.45, 0.1, 60.0))
    # Half of the flashes are balls, half are flash heads of 70 x 45 mm.
    world.flash_radius, world.flash_aspect = (25.0, 0.0) if seed % 2 == 0 else (35.0, 45 / 70)
    relative = rng.uniform(0.75, 1.3, (FLASHES, 1)) * rng.uniform(0.96, 1.04, (FLASHES, 3))
    if kind == "far":
        distant(world, lights - OBJECT, 0.6 * relative / relative.max())
        world.flash_aspect = 0.0
    else:
        brightest = max(float(world_peak(world, ball, relative)) for ball in world.balls)
        world.powers = relative * rng.uniform(0.65, 0.8) / brightest
    return world


def world_peak(world: World, ball: Ball, powers: ArrayLike) -> float:
    """Return the greatest irradiance of flashes of some powers (F, 3) on a ball's nearest point."""
    distance = np.linalg.norm(world.lights - ball.center, axis=1) - ball.radius
    return float(np.max(np.asarray(powers) * (1000 / distance[:, None]) ** 2))


def reflection_points(camera: Camera, ball: Ball, lights: Array) -> Array:
    """Return the points (F, 3) of a mirror that show each light: where the normal halves view and light."""
    out = []
    for light in lights:
        normal = np.array([0.0, 0.0, 1.0])
        for _ in range(200):
            point = ball.center + ball.radius * normal
            view = np.array([0.0, 0.0, 1.0]) if camera.is_orthographic else -point / np.linalg.norm(point)
            normal = view + (light - point) / np.linalg.norm(light - point)
            normal /= np.linalg.norm(normal)
        out.append(point)
    return np.array(out)


def directions_to(lights: Array, points: ArrayLike) -> Array:
    """Return unit vectors (F, 3) from a point, or from a point for each light."""
    toward = lights - np.asarray(points)
    return toward / np.linalg.norm(toward, axis=1, keepdims=True)
