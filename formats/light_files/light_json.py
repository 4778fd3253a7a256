"""Lights in JSON: this program's lights.json and AliceVision's, told apart by what is in them."""

from pathlib import Path
from typing import Any

import numpy as np

from formats.light_files.light_frames import BesideLights, from_opencv, nameless, places, to_opencv
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_text import lights_of_json
from scene.lights import Lights
from scene.reading import json_of, reading, shortened


def parsed(path: Path) -> dict[str, Any]:
    """Return the object that a JSON file holds."""
    data = json_of(path, error=CalibrationError, do="Write or export the file again.")
    if not isinstance(data, dict):
        raise CalibrationError(f"{path}: holds a {type(data).__name__}, expected an object with the lights in it.")
    return data


def read_json(path: Path, camera: Camera | None = None) -> Lights:
    """Read a lights.json: ours if it has `frames`, AliceVision's if it has `lights`."""
    data = parsed(path)
    if "frames" not in data and "lights" not in data:
        raise ValueError(f"its keys are {shortened(', '.join(sorted(data))) or 'none'}")
    return lights_of_json(data) if "frames" in data else _alicevision(path, data)


def _alicevision(path: Path, data: dict[str, Any]) -> Lights:
    """Read AliceVision's: numbers are strings, and the lights are in the order of its view ids, not of the frames."""
    rows = data["lights"]
    other = [str(row.get("type")) for row in rows if row.get("type", "directional") != "directional"]
    if other:
        raise CalibrationError(
            f"{path}: {len(other)} of {len(rows)} lights are of type {other[0]!r}; only directional ones can be read. "
            "Calibrate with one of AliceVision's directional methods."
        )
    directions = from_opencv(np.array([row["direction"] for row in rows], np.float64).reshape(-1, 3))
    intensities = np.array([row["intensity"] for row in rows], np.float64).reshape(-1, 3)
    names = nameless(len(rows))
    if all("name" in row for row in rows):
        names = tuple(str(row["name"]) for row in rows)
    elif any("viewId" in row for row in rows):
        views = [path for beside in sorted(path.parent.glob("*.sfm")) for path in view_paths(beside).items()]
        known = {view: file for file, view in views}
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


def view_paths(path: Path) -> dict[str, str]:
    """Return {photograph's path: view id} of an AliceVision .sfm file."""
    with reading(path, "not an AliceVision .sfm", CalibrationError):
        return {str(view["path"]): str(int(view["viewId"])) for view in parsed(path)["views"]}


def write_alicevision(lights: Lights, shot: BesideLights) -> tuple[dict[str, Any], list[str]]:
    """Return what AliceVision's PhotometricStereo reads: distant lights, its camera frame.

    Without an .sfm `lightId` instead of `viewId`, which AliceVision takes in the order of its view ids.
    """
    ids, notes = None, []
    if shot.sfm is None:
        notes.append(
            "lights_alicevision.json numbers its lights, and AliceVision takes them in the order of its own view ids: "
            "give its cameraInit.sfm with --sfm, or use the .lp file, which it matches by file name."
        )
    else:
        views = view_paths(shot.sfm)
        found = places(lights.names, list(views))
        wrong = [(name, len(rows)) for name, rows in zip(lights.names, found, strict=True) if len(rows) != 1]
        if wrong:
            raise CalibrationError(
                f"{shot.sfm}: has {wrong[0][1] or 'no'} view{'s' * (wrong[0][1] > 1)} for the frame {wrong[0][0]!r} "
                f"({len(wrong)} of {len(lights)} lack one of their own). Give the .sfm of the same photographs."
            )
        ids = [int(list(views.values())[row]) for (row,) in found]
    rows = [
        {
            **({"lightId": i} if ids is None else {"viewId": ids[i]}),
            "type": "directional",
            "direction": to_opencv(lights.directions[i]),
            "intensity": lights.intensities[i],
            "name": name,
        }
        for i, name in enumerate(lights.names)
    ]
    # Not lights.json: beside ours it would be taken for it.
    return {"lights_alicevision.json": {"lights": rows}}, notes
