"""Lights in JSON: this program's lights.json and AliceVision's, told apart by what is in them."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.light_files.light_frames import from_opencv, to_opencv
from formats.light_files.light_tables import nameless, stem
from scene.errors import CalibrationError
from scene.lights import Lights
from scene.reading import json_of, numbers, reading, shortened

Array = NDArray[np.float64]


def parsed(path: Path) -> dict[str, Any]:
    """Return the object that a JSON file holds."""
    data = json_of(path, error=CalibrationError, do="Write or export the file again.")
    if not isinstance(data, dict):
        raise CalibrationError(f"{path}: holds a {type(data).__name__}, expected an object with the lights in it.")
    return data


def read_json(path: Path) -> Lights:
    """Read a lights.json: ours if it has `frames`, AliceVision's if it has `lights`."""
    data = parsed(path)
    if "frames" not in data and "lights" not in data:
        raise CalibrationError(
            f"{path}: not a lights.json (its keys are {shortened(', '.join(sorted(data))) or 'none'}). Expected "
            "frames[] (this program's) or lights[] (AliceVision's)."
        )
    reader, what = (_ours, OURS) if "frames" in data else (_alicevision, ALICEVISION)
    with reading(path, "not a lights.json", CalibrationError, do=f"Expected {what}."):
        return reader(path, data)


OURS = "frames[] with name, direction, intensity and, for near lights, position_mm"
ALICEVISION = "lights[] with viewId or lightId, type, direction[3] and intensity[3]"


def _ours(path: Path, data: dict[str, Any]) -> Lights:
    rows = data["frames"]
    near = data.get("model") == "near"
    white, ambient = data.get("white_value"), data.get("ambient")

    def column(name: str) -> Array:
        return np.array([np.nan if row.get(name) is None else row[name] for row in rows], np.float64)

    return Lights(
        tuple(str(row["name"]) for row in rows),
        np.array([row["direction"] for row in rows], np.float64).reshape(-1, 3),
        np.array([row["intensity"] for row in rows], np.float64).reshape(-1, 3),
        numbers([row["position_mm"] for row in rows], -1, 3, what="position_mm") if near else None,
        numbers(data.get("reference_point_mm") or [0.0, 0.0, 0.0], 3, what="reference_point_mm"),
        column("direction_sigma_deg"),
        column("intensity_sigma"),
        None if ambient is None else numbers(ambient, 3, what="ambient"),
        None if white is None else numbers(white, 3, what="white_value"),
        tuple(tuple(map(str, row.get("flags", ()))) for row in rows),
    )


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
        known = {view: stem(file) for file, view in views}
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
        return {str(view["path"]): str(view["viewId"]) for view in parsed(path)["views"]}


def alicevision_json(lights: Lights, views: dict[str, str] | None) -> dict[str, Any]:
    """Return what AliceVision's PhotometricStereo reads: distant lights, its camera frame.

    Parameters
    ----------
    lights : Lights
        Near lights as they are seen from `reference_point_mm`: the format has no positions.
    views : dict of str to str, or None
        Of `view_paths`. None: `lightId` instead of `viewId`, which AliceVision takes in the order of its view ids.

    Raises
    ------
    CalibrationError
        A frame is not among the views.
    """
    ids = None if views is None else {stem(file): view for file, view in views.items()}
    missing = [name for name in lights.names if ids is not None and name not in ids]
    if missing:
        raise CalibrationError(
            f"the .sfm has no view for the frame {missing[0]!r} ({len(missing)} of {len(lights)} missing). Give the "
            ".sfm of the same photographs."
        )
    rows = []
    for i, name in enumerate(lights.names):
        rows.append(
            {
                **({"lightId": i} if ids is None else {"viewId": int(ids[name])}),
                "type": "directional",
                "direction": to_opencv(lights.directions[i]),
                "intensity": lights.intensities[i],
                "name": name,
            }
        )
    return {"lights": rows}
