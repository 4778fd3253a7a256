"""A virtual capture and its synthetic counterpart, each a folder that the steps take, and what the lab knows of them.

The capture: the lab rendered and photographed by the virtual camera, a session for `process`. Its lights are found on
the balls, as a real session's are; the true ones are written nowhere that a step reads. The counterpart: the object
alone, as the setup has it, solved with the true lights.
"""

import json
import tempfile
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.harness import opened
from benchmarks.virtual_lab import (
    BALLS,
    CAMERA,
    CENTRE_MM,
    Setup,
    lab_scene,
    object_maps,
    object_scene,
    photograph_lab,
    photograph_object,
)
from experiments.photographs import Images
from lab.options import Solving
from lab.plan import STEPS
from scene.errors import SceneError
from scene.files import write_npy, write_text
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.virtual_camera import Sensor

DARK_SHARE = 0.3
"""Of the median frame's light on and about the white ball: below, it stands in the object's shadow."""
REFERENCE = Setup(shape="cardboard", fold_deg=160.0)
"""Where the balls are found for all sessions: beside a white sphere nothing tells the white ball from the object."""
_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)


def write_capture(folder: Path, setup: Setup, balls: Sequence[Sphere] = ()) -> None:
    """Photograph a setup, and write it as a session's folder: session.toml, raw/flash_NNN.dng, mask.png, truth.npy.

    balls: where another session found them, for camera and balls stand still. Without, each session finds its own.
    """
    from twin.camera.virtual_photograph import write_photograph

    (mask, truth), images, store = object_maps(setup), photograph_lab(setup), Store(folder)
    sensor, names = Sensor(iso=setup.iso), lab_scene(setup).lights.names
    for index, light in enumerate(names):
        write_photograph(
            store.path("raw", f"{light}.dng"),
            images[index],
            sensor,
            np.random.default_rng([setup.seed, 2, index]),
            focal_mm=CAMERA.fx * sensor.pixel_um / 1000,
            time=_FIRST_SHOT + timedelta(seconds=2 * index),
        )
    store.save_mask(mask)
    write_npy(store.path("truth.npy"), truth)
    write_text(store.path("session.toml"), _manifest(balls, in_shadow(names, images)))


def in_shadow(names: Sequence[str], images: Images) -> list[str]:
    """Return the frames in which the white ball is dark: the object stands in its light, as a look at them tells."""
    center, radius = next((np.array(center), radius) for kind, radius, center in BALLS if kind == "white")
    u, v = CAMERA.project(center[None])[0]
    reach = int(CAMERA.fx * radius / -center[2])
    ball = images[:, int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach]
    brightness = ball.mean((1, 2, 3))
    dark = brightness < DARK_SHARE * np.median(brightness)
    return [name for name, left_out in zip(names, dark, strict=True) if left_out]


def _manifest(balls: Sequence[Sphere], skip: Sequence[str]) -> str:
    lines = ['name = "virtual"', "[frames]", 'flash = "raw/flash_*.dng"']
    lines += [f"skip = {json.dumps([f'{one}.dng' for one in skip])}"] if skip else []
    lines += ["[camera]", *(f"{key} = {getattr(CAMERA, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy"))]
    for number, (kind, radius, _) in enumerate(BALLS):
        lines += ["[[spheres]]", f'kind = "{kind}"', f"diameter_mm = {2 * radius}"]
        if balls:
            u, v = balls[number].center_px
            lines += [f"center_px = [{u:.3f}, {v:.3f}]", f"radius_px = {balls[number].radius_px:.3f}"]
    return "\n".join([*lines, "[object]", 'mask = "mask.png"', 'normals = "truth.npy"', ""])


def process_capture(folder: Path, done: Path, setup: Setup, methods: Sequence[str]) -> None:
    """Photograph a setup into a session's folder, and process it into another."""
    write_capture(folder, setup, reference_balls())
    with opened(folder, done, Solving(",".join(methods))) as job:
        job.run(STEPS, "solve")


def write_rendering(folder: Path, setup: Setup, methods: Sequence[str]) -> None:
    """Render a setup's object, photograph it by a sensor of its ISO, and solve it.

    The folder gets a session with its true lights, and normals/, as a session's twin/ has.
    """
    from capture.photographs.decode import decode
    from capture.session.session import load_session
    from solve.solve import solve
    from twin.twin_session import Shooting, write_session

    (mask, truth), lights, store = object_maps(setup), object_scene(setup).lights.normalised(), Store(folder)
    frames = Frames.from_linear(lights.names, photograph_object(setup))
    # Neither lens nor colour filter: what the setup says is the noise.
    shooting = Shooting(Sensor(iso=setup.iso, cfa="none", blur_px=0.0), seed=setup.seed)
    path = write_session(store, frames, CAMERA, lights, mask, truth, shooting=shooting, name="rendering")
    taken, _ = decode(load_session(path), store)
    store.save_camera(CAMERA)
    for method in methods:
        store.save_estimate(solve(method, taken, lights, CAMERA, mask))


def against_the_lab(setup: Setup, processed: Store) -> tuple[float, float]:
    """Return what the lab knows of a processed capture and no step was told.

    The median angle between the light directions found and those held, at the object's centre; and the median error of
    `ls` by the lights found, with the object at its true distance from the camera: without a scan it is taken to stand
    at the balls' distance.
    """
    from solve.solve import solve

    found, held = processed.load_lights(), lab_scene(setup).lights
    kept = [held.names.index(name) for name in found.names]
    toward, expected = (unit(one.toward(CENTRE_MM[None])[:, 0]) for one in (found, held))
    mask, truth = object_maps(setup)
    told = solve("ls", processed.load_frames(), found.seen_from(CENTRE_MM), CAMERA, mask)
    return (
        float(np.median(angular_error_deg(toward, expected[kept]))),
        float(np.nanmedian(angular_error_deg(told.normals[mask], truth[mask]))),
    )


@cache
def reference_balls() -> list[Sphere]:
    """Return the balls, found in a session of their own by `calibrate`, in the order of `BALLS`."""
    with tempfile.TemporaryDirectory() as place:
        write_capture(folder := Path(place) / "session", REFERENCE)
        with opened(folder, Path(place) / "out") as job:
            job.run(STEPS, "calibrate")
            return in_order(job.store.load_spheres())


def in_order(found: Sequence[Sphere]) -> list[Sphere]:
    """Return balls in the order of `BALLS`, those of one kind by their places from left to right; or SceneError."""
    ordered: dict[int, Sphere] = {}
    for kind in {kind for kind, _, _ in BALLS}:
        numbers = sorted((i for i, ball in enumerate(BALLS) if ball[0] == kind), key=lambda i: BALLS[i][2][0])
        there = sorted((ball for ball in found if ball.kind == kind), key=lambda ball: ball.center_px[0])
        if len(there) != len(numbers):
            raise SceneError(
                f"found {len(there)} {kind} balls, expected {len(numbers)}; no other session can go by them."
            )
        ordered |= dict(zip(numbers, there, strict=True))
    return [ordered[i] for i in range(len(BALLS))]
