"""Other tools' models and ours on the same photographs: one ball off the axis, and whole sessions with two balls."""

import numpy as np
from numpy.typing import NDArray

from benchmarks import peer_models as peers
from benchmarks.calibration_sessions import OBJECT, Session, directions_to, reflection_points, requests_of, session
from calibrate.calibrate import calibrate
from fixtures.ball_scene import World, photograph
from scene.camera import Camera
from scene.errors import SceneError
from scene.normals import angular_error_deg
from twin.camera.virtual_camera import Sensor

Array = NDArray[np.float64]
OFF_AXIS_MM = (0.0, 100.0, 200.0, 300.0)
FOCAL_PX = 8333.0
LIGHTS = 24


def off_axis(offset_mm: float, seed: int, count: int = LIGHTS) -> dict[str, list[float]]:
    """Return each tool's errors, degrees, with a ball of 167 px `offset_mm` off the axis at 1 m.

    A window of a 6000 x 4000 picture with a 50 mm lens; flashes 0.7 to 1.5 m from the middle, 25 to 80 degrees over
    the table; against the true direction where the ball reflects.
    """
    rng = np.random.default_rng([seed, int(offset_mm)])
    full = Camera(6000, 4000, FOCAL_PX, FOCAL_PX, 2999.5, 1999.5)
    turn = rng.uniform(0, 2 * np.pi) if offset_mm < 250 else 0.0
    x, y = offset_mm * np.cos(turn), offset_mm * np.sin(turn)
    middle = full.project([x, y, -1000.0])
    left, top = np.clip(np.round(middle).astype(int) - [300, 280], 0, [5400, 3440])
    camera = Camera(600, 560, FOCAL_PX, FOCAL_PX, full.cx - left, full.cy - top)
    azimuth, height = rng.uniform(0, 2 * np.pi, count), np.deg2rad(rng.uniform(25, 80, count))
    way = np.stack([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)], -1)
    lights = OBJECT + way * rng.uniform(700, 1500, count)[:, None]
    powers = np.full((count, 3), 0.35)
    world = World(camera, [], lights, powers, np.array([0.0, 0.0, -1020.0]), np.array([0.0, 0.0, 1.0]), ambient=0.005)
    world.stand("chrome", x, y, 20.0)
    sensor = Sensor()
    frames = photograph(world, sensor, np.random.default_rng([seed, 3]))
    ball, sphere = world.balls[0], world.spheres()[0]
    truth = directions_to(lights, reflection_points(camera, ball, lights))
    patch = peers.patch_of(frames, camera, sphere, sensor.neutral)
    try:
        ours = calibrate(frames, camera, requests_of(world)).lights.directions
    except SceneError:
        ours = np.full((count, 3), np.nan)
    found = {
        "psbox": peers.psbox(patch, camera, sphere, rng),
        "meshroom": peers.meshroom(patch, camera, sphere),
        "relightlab": peers.relightlab(patch, camera, sphere, rng)[1],
        "ours": ours,
    }
    return {name: angular_error_deg(directions, truth).tolist() for name, directions in found.items()}


def two_balls(seed: int) -> dict[str, list[float]]:
    """Return the peers' errors on a session "two": directions at the object, intensities at the ball and the object.

    PSBox averages its two balls' directions, Meshroom takes one ball's, RelightLab intersects their rays.
    """
    made = session(seed, "two")
    world, camera = made.world, made.world.camera
    rng = np.random.default_rng([seed, 11])
    patches = [peers.patch_of(made.frames, camera, sphere, made.sensor.neutral) for sphere in world.spheres()]
    chrome = [i for i, sphere in enumerate(world.spheres()) if sphere.kind == "chrome"]
    truth = directions_to(world.lights, OBJECT)
    spheres = world.spheres()
    averaged = np.mean([peers.psbox(patches[i], camera, spheres[i], rng) for i in chrome], 0)
    averaged /= np.linalg.norm(averaged, axis=1, keepdims=True)
    rays = [peers.relightlab(patches[i], camera, spheres[i], rng) for i in chrome]
    met = peers.intersected(np.stack([points for points, _ in rays]), np.stack([ways for _, ways in rays]))
    found = {
        "psbox": averaged,
        "meshroom": peers.meshroom(patches[chrome[0]], camera, spheres[chrome[0]]),
        "relightlab": directions_to(met, OBJECT),
    }
    out = {name: angular_error_deg(directions, truth).tolist() for name, directions in found.items()}
    ranges = np.linalg.norm(world.lights - OBJECT, axis=1)
    out["relightlab_position"] = (100 * np.linalg.norm(met - world.lights, axis=1) / ranges).tolist()
    out |= _intensities(made, patches, camera)
    return out


def _intensities(made: Session, patches: list[peers.Patch], camera: Camera) -> dict[str, list[float]]:
    world = made.world
    number, sphere = next((i, s) for i, s in enumerate(world.spheres()) if s.kind == "white")
    ball = next(ball for ball in world.balls if ball.kind == "white")
    _, strengths = peers.white_ball(patches[number], camera, sphere)
    out = {}
    for name, point in (("white_at_ball", ball.center), ("white_at_object", OBJECT)):
        true = world.truth(point)[1]
        out[name] = (100 * (strengths / (true / true.mean(0)) - 1)).ravel().tolist()
    return out
