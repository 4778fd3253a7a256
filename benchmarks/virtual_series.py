"""A lab's own series, virtual: sessions of one object in which one factor changes, photographed in the virtual lab.

Each is a folder that `rgbn series` takes: RAW photographs, the camera, the balls' diameters, and the object's scan.
The true lights and the pose are written nowhere that a step reads.
"""

import json
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.virtual_lab import BALLS, CAMERA, CENTRE_MM, Experiment, Setup, lab_scene, object_scene, photograph_lab
from experiments.photographs import Images
from scene.files import write_text
from scene.mesh import Mesh
from scene.store import Store
from twin.camera.virtual_camera import Sensor

DARK_SHARE = 0.3
"""Of the median frame's light on and about the white ball: below, it stands in the object's shadow."""
SCAN_EDGE_MM = 3.0
"""Longest edge of the scan's faces, as a scanner's."""
_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)


def write_series(parent: Path, experiment: Experiment) -> None:
    """Photograph an experiment's levels, each into a session's folder below `parent`."""
    for number, (level, setup) in enumerate(zip(experiment.levels, experiment.setups(), strict=True)):
        write_session(parent / f"{number}", setup, experiment.name, level)


def write_session(folder: Path, setup: Setup, factor: str, value: float | str) -> None:
    """Photograph a setup, and write session.toml, raw/flash_NNN.dng and scan.ply."""
    from formats.meshes.ply import write_ply
    from twin.camera.virtual_photograph import write_photograph

    images, store = photograph_lab(setup), Store(folder)
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
    scan = scan_of(setup)
    write_ply(store.path("scan.ply"), {"x y z": scan.vertices.astype(np.float32)}, scan.faces)
    write_text(store.path("session.toml"), _manifest(in_shadow(names, images), factor, value))


def scan_of(setup: Setup) -> Mesh:
    """Return the object as a scanner has it: in axes of its own, with small faces."""
    import trimesh

    parts = [one.placed for one in object_scene(setup).objects]
    before = np.cumsum([0, *(len(one.vertices) for one in parts)])
    faces = np.concatenate([one.faces + first for one, first in zip(parts, before, strict=False)])
    points = np.concatenate([one.vertices for one in parts]) - CENTRE_MM
    vertices, small = trimesh.remesh.subdivide_to_size(points, faces, SCAN_EDGE_MM)[:2]
    fine = trimesh.Trimesh(vertices, small)
    return Mesh(np.array(fine.vertices, np.float64), np.array(fine.faces))


def in_shadow(names: Sequence[str], images: Images) -> list[str]:
    """Return the frames in which the white ball is dark: the object stands in its light, as a look at them tells."""
    center, radius = next((np.array(center), radius) for kind, radius, center in BALLS if kind == "white")
    u, v = CAMERA.project(center[None])[0]
    reach = int(CAMERA.fx * radius / -center[2])
    ball = images[:, int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach]
    brightness = ball.mean((1, 2, 3))
    dark: NDArray[np.bool_] = brightness < DARK_SHARE * np.median(brightness)
    return [name for name, left_out in zip(names, dark, strict=True) if left_out]


def _manifest(skip: Sequence[str], factor: str, value: float | str) -> str:
    lines = ['name = "virtual"', "[frames]", 'flash = "raw/flash_*.dng"']
    lines += [f"skip = {json.dumps([f'{one}.dng' for one in skip])}"] if skip else []
    lines += ["[camera]", *(f"{key} = {getattr(CAMERA, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy"))]
    for kind, radius, _ in BALLS:
        lines += ["[[spheres]]", f'kind = "{kind}"', f"diameter_mm = {2 * radius}"]
    lines += ["[object]", 'scan = "scan.ply"', 'scan_unit = "mm"']
    return "\n".join([*lines, "[series]", f'factor = "{factor}"', f"value = {json.dumps(value)}", ""])
