"""RelightLab's `.dome`: lights about the middle of the picture, in millimetres."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.light_files.light_frames import BesideLights, dome_origin, nameless
from formats.light_files.light_json import parsed
from scene.camera import Camera
from scene.lights import Lights
from scene.reading import numbers

Array = NDArray[np.float64]
NO_SCALE = "its positions in mm are not used: they need [camera], and imageWidth in the file"


def read_dome(path: Path, camera: Camera | None) -> Lights:
    """Read a `.dome`.

    Parameters
    ----------
    path : Path
    camera : Camera or None
        Positions are about the object, and only a perspective camera and the file's `imageWidth` tell how far away
        that is; without them the lights are distant, as seen from the middle of the picture, and flagged.

    Notes
    -----
    `ledAdjust` multiplies the pixels to make the lamps alike: their power is its reciprocal. RelightLab undoes the
    fall-off with the distance by itself.
    """
    data = parsed(path)
    kind = data.get("lightConfiguration", "directional")
    if kind == "directional":
        positions, directions = None, _vectors(data["directions"], "xyz")
    elif kind == "spherical":
        positions = _vectors(data.get("positionsSphere") or [], "xyz")
        if not len(positions):
            turned = _vectors(data["directions"], "xyz") * (float(data["domeDiameter"]) / 2)
            positions = turned + [0, 0, float(data.get("verticalOffset", 0))]
        directions = positions
    elif kind == "lights3d":
        positions = directions = _vectors(data["positions3d"], "xyz")
    else:
        raise ValueError(f"lightConfiguration is {kind!r}, expected directional, spherical or lights3d")
    adjust = _vectors(data.get("ledAdjust") or [], "rgb")
    width_mm = float(data.get("imageWidth") or 0)
    names = tuple(str(name) for name in data.get("names") or nameless(len(directions)))
    if len(adjust) not in (0, len(directions)) or len(names) != len(directions):
        raise ValueError(f"{len(directions)} lights, but {len(adjust)} entries in ledAdjust, {len(names)} names")
    if (adjust <= 0).any():
        raise ValueError(f"ledAdjust must be positive, found {adjust.min():g}")
    intensities = 1 / adjust if len(adjust) else np.full_like(directions, np.nan)
    if positions is None:
        return Lights(names, directions, intensities)
    distance = np.linalg.norm(positions, axis=1, keepdims=True)
    intensities = intensities * (np.mean(distance) / np.maximum(distance, 1e-9)) ** 2
    if camera is None or camera.is_orthographic or width_mm <= 0:
        return Lights(names, directions, intensities, flags=((NO_SCALE,),) * len(names))
    origin = dome_origin(camera, width_mm * camera.fx / camera.width)
    return Lights(names, directions, intensities, positions + origin, origin)


def write_dome(lights: Lights, shot: BesideLights) -> tuple[dict[str, Any], list[str]]:
    """Return a `.dome` of lights: positions where they and the camera are known, else directions."""
    camera, notes = shot.camera, []
    if lights.model == "near" and camera.is_orthographic:
        notes.append("nothing is known of the camera: the dome has directions only.")
    origin, width_mm = np.zeros(3), 0.0
    near = lights.positions_mm is not None and not camera.is_orthographic
    if near:
        depth_mm = float(-lights.reference_point_mm[2])
        origin, width_mm = dome_origin(camera, depth_mm), camera.width * depth_mm / camera.fx
        lights = lights.seen_from(origin)
    positions = lights.positions_mm - origin if near and lights.positions_mm is not None else np.zeros((0, 3))
    distance = np.linalg.norm(positions, axis=1, keepdims=True) if near else np.ones((len(lights), 1))
    power = lights.intensities * distance**2
    data = {
        "label": "rgbn",
        "notes": "x right, y up, z to the camera; millimetres about the object at the middle of the picture",
        "imageWidth": width_mm,
        "domeDiameter": 2 * float(distance.mean()) if near else 0.0,
        "verticalOffset": 0.0,
        "lightConfiguration": "lights3d" if near else "directional",
        "directions": _objects(lights.directions, "xyz"),
        "positionsSphere": _objects(distance.mean() * lights.directions if near else positions, "xyz"),
        "positions3d": _objects(positions, "xyz"),
        "ledAdjust": _objects(power.mean(0) / power, "rgb"),
        "names": lights.names,
    }
    return {"lights.dome": data}, notes


def _vectors(rows: list[dict[str, float]], keys: str) -> Array:
    return numbers([[row[key] for key in keys] for row in rows] or np.zeros((0, 3)), -1, 3)


def _objects(rows: Array, keys: str) -> list[dict[str, float]]:
    return [dict(zip(keys, map(float, row), strict=True)) for row in rows]
