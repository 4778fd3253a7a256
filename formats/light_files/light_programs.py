"""Lights in other programs' files: AliceVision's JSON, RelightLab's `.dome`, and `light.mat` of near_ps [Queau2018].

| file | axes | origin | lengths |
|---|---|---|---|
| ours, `.lp`, DiLiGenT | x right, y up, z to the viewer: the camera frame as it is | camera | mm |
| AliceVision, near_ps | OpenCV's: x right, y down, z away from the viewer | camera | mm |
| RelightLab `.dome` | x right, y up, z to the viewer | the object, at the middle of the picture | mm |
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.light_files.light_names import nameless
from formats.mat_files import arrays_of_mat
from scene.camera import Camera, to_opencv
from scene.errors import CalibrationError, SceneError
from scene.light_text import BY_COLUMN, lights_of_json
from scene.lights import Lights
from scene.reading import json_of, numbers, reading, shortened

Array = NDArray[np.float64]
OTHER_CAMERA = "measured with another camera"
NO_SCALE = "its positions in mm are not used: they need [camera], and imageWidth in the file"
USUAL_DEPTH_MM = 700.0
"""Where near_ps takes the object to stand when it is not told."""


def parsed(path: Path) -> dict[str, Any]:
    """Return the object that a JSON file holds."""
    data = json_of(path, error=CalibrationError, do="Write or export the file again.")
    if not isinstance(data, dict):
        raise CalibrationError(f"{path}: holds a {type(data).__name__}, expected an object with the lights in it.")
    return data


def read_json(path: Path, camera: Camera | None) -> Lights:
    """Read a lights.json: ours, or a rig's with its camera, if it has `frames`; AliceVision's if it has `lights`."""
    data = parsed(path)
    if "frames" not in data and "lights" not in data:
        raise ValueError(f"its keys are {shortened(', '.join(sorted(data))) or 'none'}")
    if "frames" not in data:
        return _alicevision(path, data)
    lights, own, other = lights_of_json(data), data.get("camera"), ""
    if own and camera:
        try:
            other = camera.difference(Camera(**{**own, "distortion": tuple(own["distortion"])}))
        except SceneError as error:
            raise ValueError(str(error)) from error
    return replace(lights, flags=tuple((*own, f"{OTHER_CAMERA}: {other}") for own in lights.flags)) if other else lights


def _alicevision(path: Path, data: dict[str, Any]) -> Lights:
    """Read AliceVision's: numbers are strings, and the lights are in the order of its view ids, not of the frames."""
    rows = data["lights"]
    other = [str(row.get("type")) for row in rows if row.get("type", "directional") != "directional"]
    if other:
        raise CalibrationError(
            f"{path}: {len(other)} of {len(rows)} lights are of type {other[0]!r}; only directional ones can be read. "
            "Calibrate with one of AliceVision's directional methods."
        )
    directions = to_opencv(np.array([row["direction"] for row in rows], np.float64).reshape(-1, 3))
    intensities = np.array([row["intensity"] for row in rows], np.float64).reshape(-1, 3)
    names = nameless(len(rows))
    if all("name" in row for row in rows):
        names = tuple(str(row["name"]) for row in rows)
    elif any("viewId" in row for row in rows):
        known: dict[str, str] = {}
        for one in sorted(path.parent.glob("*.sfm")):
            with reading(one, "not an AliceVision .sfm", CalibrationError):
                known |= {str(int(view["viewId"])): str(view["path"]) for view in parsed(one)["views"]}
        unknown = [str(row.get("viewId")) for row in rows if str(row.get("viewId")) not in known]
        if unknown:
            raise CalibrationError(
                f"{path}: light of view {unknown[0]}, but no .sfm file beside it says which photograph that is "
                f"({len(unknown)} of {len(rows)}). Put the cameraInit.sfm that AliceVision calibrated from beside it."
            )
        names = tuple(known[str(row["viewId"])] for row in rows)
    else:
        order = np.argsort([int(row["lightId"]) for row in rows], kind="stable")
        directions, intensities = directions[order], intensities[order]
    return Lights(names, directions, intensities)


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
    origin = _dome_origin(camera, width_mm * camera.fx / camera.width)
    return Lights(names, directions, intensities, positions + origin, origin)


def dome_of(lights: Lights, camera: Camera) -> tuple[dict[str, Any], list[str]]:
    """Return lights.dome, and notes: positions where they and the camera are known, else directions."""
    notes = []
    if lights.model == "near" and camera.is_orthographic:
        notes.append("nothing is known of the camera: the dome has directions only.")
    origin, width_mm = np.zeros(3), 0.0
    near = lights.positions_mm is not None and not camera.is_orthographic
    if near:
        depth_mm = float(-lights.reference_point_mm[2])
        origin, width_mm = _dome_origin(camera, depth_mm), camera.width * depth_mm / camera.fx
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


def _dome_origin(camera: Camera, depth_mm: float) -> Array:
    """Return a dome's origin (3,), mm, camera frame: what the picture's middle shows of the plane z = -depth_mm."""
    return camera.points_at_depth([(camera.width - 1) / 2, (camera.height - 1) / 2], -depth_mm)


def _vectors(rows: list[dict[str, float]], keys: str) -> Array:
    return numbers([[row[key] for key in keys] for row in rows] or np.zeros((0, 3)), -1, 3)


def _objects(rows: Array, keys: str) -> list[dict[str, float]]:
    return [dict(zip(keys, map(float, row), strict=True)) for row in rows]


def read_mat(path: Path, camera: Camera | None) -> Lights:
    """Read `light.mat`: S (n, 3), mm, and where there Phi (n, 3) or (n, 1), mu (n, 1), Dir (n, 3).

    Notes
    -----
    Near lights: a white surface at x has Phi n.(S - x) / |S - x|^3. The file does not say where the object is: it is
    taken to stand 700 mm before the camera, and each light is flagged.
    """
    data = arrays_of_mat(path, error=CalibrationError)
    if "S" not in data:
        found = shortened(", ".join(sorted(data))) or "nothing"
        raise ValueError(f"it holds {found}, no S")
    places, phi = (np.asarray(data.get(key, np.nan), np.float64) for key in ("S", "Phi"))
    by_column = places.ndim == 2 and len(places) == 3 != places.shape[1]
    positions = to_opencv(places.T if by_column else places)
    phi = phi.reshape(-1, 1) if phi.size in (1, len(positions)) else phi.T if by_column else phi
    if positions.shape[1] != 3 or (phi.size > 1 and len(phi) != len(positions)):
        raise ValueError(f"S {places.shape}, Phi {phi.shape}")
    power = np.broadcast_to(phi, positions.shape)
    bent = float(np.max(np.abs(np.asarray(data.get("mu", 0.0), np.float64)), initial=0.0))
    reference = to_opencv([0, 0, USUAL_DEPTH_MM])
    flag = (f"the object is taken to stand {USUAL_DEPTH_MM:g} mm away: {path.name} does not tell",)
    flag += (f"{path.name} {BY_COLUMN}",) if by_column else ()
    if bent:
        flag += (f"taken as shining alike to all sides: mu up to {bent:g} is not used",)
    offset = positions - reference
    square = np.sum(offset**2, axis=1, keepdims=True)
    return Lights(
        nameless(len(positions)),
        offset,
        power / np.maximum(square, 1e-12),
        positions,
        reference,
        flags=(flag,) * len(positions),
    )
