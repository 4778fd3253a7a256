"""The formats of lights: name, suffix, reader, writer; lights read from any of them, written for other programs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from formats.light_files.light_dome import read_dome, write_dome
from formats.light_files.light_frames import Photographs
from formats.light_files.light_json import read_json, write_alicevision
from formats.light_files.light_mat import read_mat, write_mat
from formats.light_files.light_tables import read_diligent, read_lp, write_lp, write_tables
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.files import write_json, write_text, write_whole
from scene.lights import Lights
from scene.reading import reading


class LightFormat(NamedTuple):
    """One format; `write` returns {file name: text, bytes or JSON} and what the format cannot say of the lights."""

    suffix: str
    expected: str
    read: Callable[[Path, Camera | None], Lights]
    write: Callable[[Lights, Photographs], tuple[dict[str, Any], list[str]]]
    has_positions: bool = False


FORMATS = {
    "lp": LightFormat(
        ".lp", "the number of lights, then a line each: name x y z, with a point for decimals", read_lp, write_lp
    ),
    "alicevision": LightFormat(
        ".json",
        "frames[] (this program's) with name, direction, intensity and, for near lights, position_mm, or lights[] "
        "(AliceVision's) with viewId or lightId, type, direction[3] and intensity[3]",
        read_json,
        write_alicevision,
    ),
    "diligent": LightFormat(".txt", "three numbers a line, one line a photograph", read_diligent, write_tables),
    "dome": LightFormat(
        ".dome",
        "lightConfiguration and directions[], positionsSphere[] or positions3d[] of {x, y, z}",
        read_dome,
        write_dome,
        has_positions=True,
    ),
    "mat": LightFormat(
        ".mat", "S (n x 3, mm), Phi (n x 3 or n x 1), mu (n x 1)", read_mat, write_mat, has_positions=True
    ),
}
"""`.lp` of the RTI programs; AliceVision's (Meshroom's) lights, and of the same suffix this program's lights.json;
DiLiGenT's tables; RelightLab's dome; light.mat and camera.mat of near_ps."""
SUFFIXES = tuple(known.suffix for known in FORMATS.values())


def read_light_file(path: Path, camera: Camera | None) -> Lights:
    """Return a file's lights in its own order, as they are written; without intensities these are NaN.

    Raises
    ------
    CalibrationError
        Unknown suffix, or a malformed file.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise CalibrationError(
            f"{path}: lights in {path.suffix or 'a file without suffix'} are not known; expected one of "
            f"{', '.join(SUFFIXES)} (.txt: DiLiGenT's light_directions.txt)."
        )
    known = next(known for known in FORMATS.values() if known.suffix == suffix)
    with reading(path, "cannot be read as lights", CalibrationError, do=f"Expected {known.expected}."):
        return known.read(path, camera)


def export_lights(
    folder: Path, name: str, lights: Lights, camera: Camera, *, files: tuple[str, ...], sfm: Path | None = None
) -> tuple[list[Path], list[str]]:
    """Write lights in another program's format.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    name : str
        One of `FORMATS`.
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
        raise CalibrationError(f"--format {name}: unknown; there are {', '.join(sorted(FORMATS))}.")
    contents, notes = FORMATS[name].write(lights, Photographs(camera, files, sfm))
    if lights.model == "near" and not FORMATS[name].has_positions:
        x, y, z = lights.reference_point_mm
        notes.append(f"{name} has no positions: directions as seen from ({x:.0f}, {y:.0f}, {z:.0f}) mm.")
    for file, content in contents.items():
        if isinstance(content, bytes):
            with write_whole(folder / file) as stream:
                stream.write(content)
        elif isinstance(content, str):
            write_text(folder / file, content)
        else:
            write_json(folder / file, content)
    return [folder / file for file in contents], notes
