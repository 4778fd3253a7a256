"""A virtual capture and its synthetic counterpart, each as a folder that the steps take.

The capture: the lab rendered and photographed by the virtual camera, a session for `process`. Its lights are found on
the balls, as a real session's are; the true ones are written nowhere that a step reads. The counterpart: the object
alone, as the setup has it, solved with the true lights.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime, timedelta

import numpy as np

from experiments.catalogue import SOLVERS
from experiments.counterparts.compare_folders import VIRTUAL
from experiments.photographs import LAB_SAMPLES, Images, object_maps, photograph_lab, photograph_object
from experiments.recipe import Setup
from experiments.scenes import BALLS, CAMERA, lab_scene, object_scene
from scene.files import write_json, write_npy, write_text
from scene.frames import Frames
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.virtual_camera import Sensor

METHODS = tuple(SOLVERS)
DARK_SHARE = 0.3
"""Of the median frame's light on and about the white ball: below, it stands in the object's shadow."""
_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)


def write_capture(folder: Store, setup: Setup, name: str, balls: Sequence[Sphere] = ()) -> None:
    """Photograph a setup, and write it as a session's folder; its name begins with `virtual`.

    The folder gets session.toml (last), raw/flash_NNN.dng, mask.png, truth.npy and virtual.json, which says that no
    camera was there. balls: where another session found them, for camera and balls stand still. Without, each session
    finds its own.
    """
    from twin.camera.virtual_photograph import write_photograph

    (mask, truth), images = object_maps(setup), photograph_lab(setup)
    sensor, names = Sensor(iso=setup.iso), lab_scene(setup).lights.names
    for index, light in enumerate(names):
        write_photograph(
            folder.path("raw", f"{light}.dng"),
            images[index],
            sensor,
            np.random.default_rng([setup.seed, 2, index]),
            focal_mm=CAMERA.fx * sensor.pixel_um / 1000,
            time=_FIRST_SHOT + timedelta(seconds=2 * index),
        )
    folder.save_mask(mask)
    write_npy(folder.path("truth.npy"), truth)
    write_json(folder.path(VIRTUAL), {"virtual": True, "setup": asdict(setup), "samples": LAB_SAMPLES})
    write_text(folder.path("session.toml"), _manifest(name, balls, in_shadow(names, images)))


def in_shadow(names: Sequence[str], images: Images) -> list[str]:
    """Return the frames in which the white ball is dark: the object stands in its light, as a look at them tells."""
    center, radius = next((np.array(center), radius) for kind, radius, center in BALLS if kind == "white")
    u, v = CAMERA.project(center[None])[0]
    reach = int(CAMERA.fx * radius / -center[2])
    ball = images[:, int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach]
    brightness = ball.mean((1, 2, 3))
    dark = brightness < DARK_SHARE * np.median(brightness)
    return [name for name, left_out in zip(names, dark, strict=True) if left_out]


def _manifest(name: str, balls: Sequence[Sphere], skip: Sequence[str]) -> str:
    lines = [
        "# A virtual capture: rendered by rgbn, photographed by its virtual camera.",
        "version = 1",
        f'name = "{name}"',
        "",
        "[frames]",
        'flash = "raw/flash_*.dng"',
        *([f"skip = {json.dumps([f'{one}.dng' for one in skip])}"] if skip else []),
        "",
        "[camera]",
        *(f"{key} = {getattr(CAMERA, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy")),
    ]
    for number, (kind, radius, _) in enumerate(BALLS):
        lines += ["", "[[spheres]]", f'kind = "{kind}"', f"diameter_mm = {2 * radius}"]
        if balls:
            u, v = balls[number].center_px
            lines += [f"center_px = [{u:.3f}, {v:.3f}]", f"radius_px = {balls[number].radius_px:.3f}"]
    return "\n".join([*lines, "", "[object]", 'mask = "mask.png"', 'normals = "truth.npy"', ""])


def write_rendering(folder: Store, setup: Setup, name: str) -> None:
    """Render a setup's object, photograph it by a sensor of its ISO, and solve it.

    The folder gets a session with its true lights, and normals/, as a session's twin/ has.
    """
    from capture.photographs.decode import decode
    from capture.session.session import load_session
    from solve.solve import solve
    from twin.twin_session import Shooting, write_session

    scene = object_scene(setup)
    mask, truth = object_maps(setup)
    frames = Frames.from_linear(scene.lights.names, photograph_object(setup))
    # Neither lens nor colour filter: what the setup says is the noise.
    sensor, lights = Sensor(iso=setup.iso, cfa="none", blur_px=0.0), scene.lights.normalised()
    path = write_session(
        folder, frames, CAMERA, lights, mask, truth, shooting=Shooting(sensor, seed=setup.seed), name=name
    )
    taken, _ = decode(load_session(path), folder)
    folder.save_camera(CAMERA)
    for method in METHODS:
        folder.save_estimate(solve(method, taken, lights, CAMERA, mask))
