"""`light.mat` and `camera.mat` of near_ps, MATLAB's near-light solver [Queau2018]."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from formats.light_files.light_frames import BesideLights, from_opencv, matlab_matrix, nameless, to_opencv
from formats.mat_files import arrays_of_mat
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_text import BY_COLUMN
from scene.lights import Lights
from scene.reading import numbers, shortened

USUAL_DEPTH_MM = 700.0
"""Where near_ps takes the object to stand when it is not told."""


def read_mat(path: Path, camera: Camera | None = None) -> Lights:
    """Read `light.mat`: S (n, 3), mm, and where there Phi (n, 3) or (n, 1), mu (n, 1), Dir (n, 3).

    Notes
    -----
    Near lights: a white surface at x has Phi n.(S - x) / |S - x|^3. The file does not say where the object is; a
    variable `reference` (1, 3), which this program adds, does. Without it the object is taken to stand 700 mm before
    the camera, and each light is flagged.
    """
    data = arrays_of_mat(path, error=CalibrationError)
    if "S" not in data:
        found = shortened(", ".join(sorted(data))) or "nothing"
        raise ValueError(f"it holds {found}, no S")
    places, phi = (np.asarray(data.get(key, np.nan), np.float64) for key in ("S", "Phi"))
    by_column = places.ndim == 2 and len(places) == 3 != places.shape[1]
    positions = from_opencv(places.T if by_column else places)
    phi = phi.reshape(-1, 1) if phi.size in (1, len(positions)) else phi.T if by_column else phi
    if positions.shape[1] != 3 or (phi.size > 1 and len(phi) != len(positions)):
        raise ValueError(f"S {places.shape}, Phi {phi.shape}")
    power = np.broadcast_to(phi, positions.shape)
    bent = float(np.max(np.abs(np.asarray(data.get("mu", 0.0), np.float64)), initial=0.0))
    names = tuple(str(name) for name in np.ravel(data.get("names", ())))
    known = "reference" in data
    reference = from_opencv(numbers(np.ravel(data.get("reference", [0, 0, USUAL_DEPTH_MM])), 3))
    flag = (f"{path.name} {BY_COLUMN}",) if by_column else ()
    flag += () if known else (f"the object is taken to stand {USUAL_DEPTH_MM:g} mm away: {path.name} does not tell",)
    if bent:
        flag += (f"taken as shining alike to all sides: mu up to {bent:g} is not used",)
    offset = positions - reference
    square = np.sum(offset**2, axis=1, keepdims=True)
    return Lights(
        names if len(names) == len(positions) else nameless(len(positions)),
        offset,
        power / np.maximum(square, 1e-12),
        positions,
        reference,
        flags=(flag,) * len(positions),
    )


def write_mat(lights: Lights, shot: BesideLights) -> tuple[dict[str, bytes], list[str]]:
    """Return `light.mat` of near lights, and `camera.mat`: K, whose pixels count from 1."""
    camera = shot.camera
    if lights.positions_mm is None or camera.is_orthographic:
        raise CalibrationError(
            "--format mat: near_ps wants positions in mm and a perspective camera, but these lights are "
            f"{lights.model} and the camera is {camera.projection}. Give two chrome balls of known diameter_mm, and "
            "[camera]; or export lp or diligent."
        )
    square = np.sum((lights.positions_mm - lights.reference_point_mm) ** 2, axis=1, keepdims=True)
    white = np.ones(3) if lights.white_value is None else lights.white_value
    light = {
        "S": to_opencv(lights.positions_mm),
        "Phi": lights.intensities * white * square,
        "mu": np.zeros((len(lights), 1)),
        "Dir": np.tile([0.0, 0.0, 1.0], (len(lights), 1)),
        "reference": to_opencv(lights.reference_point_mm)[None],
        "names": np.array(lights.names, dtype=object)[:, None],
    }
    notes = ["camera.mat has no lens distortion: undistort the photographs before near_ps."]
    files = {"light.mat": _mat(light), "camera.mat": _mat({"K": matlab_matrix(camera)})}
    return files, notes if any(camera.distortion) else []


def _mat(variables: dict[str, Any]) -> bytes:
    import scipy.io

    buffer = io.BytesIO()
    scipy.io.savemat(buffer, variables)
    return buffer.getvalue()
