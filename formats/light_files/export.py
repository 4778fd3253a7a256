"""Lights for other programs: one file, or the few that belong together, a format."""

from pathlib import Path
from typing import Any

from formats.light_files.light_dome import dome_json
from formats.light_files.light_json import alicevision_json, view_paths
from formats.light_files.light_mat import camera_mat, light_mat
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.files import write_json, write_text, write_whole
from scene.light_text import light_tables, lp_file
from scene.lights import Lights

FORMATS = ("alicevision", "diligent", "dome", "lp", "mat")


def export_lights(
    folder: Path, name: str, lights: Lights, camera: Camera, *, files: tuple[str, ...], sfm: Path | None = None
) -> tuple[list[Path], list[str]]:
    """Write lights in another program's format.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    name : str
        One of `FORMATS`: AliceVision's (Meshroom's) lights, DiLiGenT's text, RelightLab's dome, `.lp` of the RTI
        programs, light.mat and camera.mat of near_ps.
    lights : Lights
        Formats without positions get the directions as seen from `reference_point_mm`.
    camera : Camera
    files : tuple of N str
        The photographs' file names, for the formats that name files.
    sfm : Path, optional
        AliceVision's .sfm of the photographs: its view ids.

    Returns
    -------
    paths : list of Path
        What was written.
    notes : list of str
        What the format cannot say of these lights.

    Raises
    ------
    CalibrationError
        Unknown format, or one that cannot hold these lights.
    """
    if name not in FORMATS:
        raise CalibrationError(f"--format {name}: unknown; there are {', '.join(FORMATS)}, and mitsuba.")
    contents, notes = {
        "alicevision": _alicevision,
        "diligent": _diligent,
        "dome": _dome,
        "lp": _lp,
        "mat": _mat,
    }[name](lights, camera, files, sfm)
    if lights.model == "near" and name in ("alicevision", "diligent", "lp"):
        x, y, z = lights.reference_point_mm
        notes.append(f"{name} has no positions: directions as seen from ({x:.0f}, {y:.0f}, {z:.0f}) mm.")
    paths = []
    for file, content in contents.items():
        path = folder / file
        if isinstance(content, bytes):
            with write_whole(path) as stream:
                stream.write(content)
        elif isinstance(content, str):
            write_text(path, content)
        else:
            write_json(path, content)
        paths.append(path)
    return paths, notes


_Contents = tuple[dict[str, Any], list[str]]


def _alicevision(lights: Lights, camera: Camera, files: tuple[str, ...], sfm: Path | None) -> _Contents:
    notes = []
    if sfm is None:
        notes.append(
            "lights_alicevision.json numbers its lights, and AliceVision takes them in the order of its own view ids: "
            "give its cameraInit.sfm with --sfm, or use the .lp file, which it matches by file name."
        )
    views = None if sfm is None else view_paths(sfm)
    # Not lights.json: beside ours it would be taken for it.
    return {"lights_alicevision.json": alicevision_json(lights, views)}, notes


def _diligent(lights: Lights, camera: Camera, files: tuple[str, ...], sfm: Path | None) -> _Contents:
    return dict(light_tables(files, lights)), []


def _dome(lights: Lights, camera: Camera, files: tuple[str, ...], sfm: Path | None) -> _Contents:
    notes = []
    if lights.model == "near" and camera.is_orthographic:
        notes.append("nothing is known of the camera: the dome has directions only.")
    return {"lights.dome": dome_json(lights, camera)}, notes


def _lp(lights: Lights, camera: Camera, files: tuple[str, ...], sfm: Path | None) -> _Contents:
    return dict(lp_file(files, lights)), ["lp has no intensities."]


def _mat(lights: Lights, camera: Camera, files: tuple[str, ...], sfm: Path | None) -> _Contents:
    if lights.positions_mm is None or camera.is_orthographic:
        raise CalibrationError(
            "--format mat: near_ps wants positions in mm and a perspective camera, but these lights are "
            f"{lights.model} and the camera is {camera.projection}. Give two chrome balls of known diameter_mm, and "
            "[camera]; or export lp or diligent."
        )
    notes = []
    if any(camera.distortion):
        notes.append("camera.mat has no lens distortion: undistort the photographs before near_ps.")
    return {"light.mat": light_mat(lights), "camera.mat": camera_mat(camera)}, notes
