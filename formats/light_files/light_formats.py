"""The formats of lights: lights read from any of them, written for other programs."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from formats.light_files.light_names import nameless
from formats.light_files.light_programs import dome_of, read_dome, read_json, read_mat
from formats.sfm_data import sfm_lights
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.files import write_json, write_text
from scene.light_text import FILENAMES, light_tables, lp_file, names_in, table_in
from scene.lights import Lights
from scene.reading import reading, shortened, text_of


def _read_lp(path: Path, camera: Camera | None) -> Lights:
    """Read `.lp`: first line the count, then `name x y z`; the name may hold spaces. It has no intensities."""
    text = text_of(path, error=CalibrationError, names=True)
    first, *rows = [line.strip() for line in text.splitlines() if line.strip()] or [""]
    if not re.fullmatch(r"\d{1,9}", first):
        raise ValueError(f"line 1 must be the number of lights, found {shortened(first, 40)!r}")
    if len(rows) != int(first):
        raise ValueError(f"line 1 says {int(first)} lights, but {len(rows)} follow")
    parts = [row.rsplit(None, 3) for row in rows]
    bad = next((i for i, part in enumerate(parts) if len(part) < 4), None)
    if bad is not None:
        raise ValueError(f"light {bad + 1} is {shortened(rows[bad])!r}, not: name x y z, with blanks between")
    directions = np.array([part[1:] for part in parts], np.float64).reshape(-1, 3)
    return Lights(tuple(part[0] for part in parts), directions, np.full_like(directions, np.nan))


def _read_diligent(path: Path, camera: Camera | None) -> Lights:
    """Read DiLiGenT's directions, one a line, with light_intensities.txt and filenames.txt beside them if there."""
    directions, note = table_in(path, CalibrationError)
    intensities = np.full_like(directions, np.nan)
    beside = path.with_name(path.name.replace("directions", "intensities"))
    if beside != path and beside.is_file():
        intensities, _ = table_in(beside, CalibrationError, note)
        if len(intensities) != len(directions):
            raise CalibrationError(
                f"{beside}: {len(intensities)} intensities, but {path.name} has {len(directions)} lights."
            )
    listed = path.with_name(FILENAMES)
    names = tuple(names_in(listed, CalibrationError)) if listed.is_file() else ()
    flags = ((f"{path.name} {note}",),) * len(directions) if note else ()
    return Lights(
        names if len(names) == len(directions) else nameless(len(directions)), directions, intensities, flags=flags
    )


READERS: dict[str, tuple[Callable[[Path, Camera | None], Lights], str]] = {
    ".lp": (_read_lp, "the number of lights, then a line each: name x y z, with a point for decimals"),
    ".json": (
        read_json,
        "frames[] (this program's) with name, direction, intensity and, for near lights, position_mm, or lights[] "
        "(AliceVision's) with viewId or lightId, type, direction[3] and intensity[3]",
    ),
    ".txt": (_read_diligent, "three numbers a line, one line a photograph"),
    ".dome": (read_dome, "lightConfiguration and directions[], positionsSphere[] or positions3d[] of {x, y, z}"),
    ".mat": (read_mat, "S (n x 3, mm), Phi (n x 3 or n x 1), mu (n x 1)"),
}
"""Each suffix' reader, and what it expects; .txt: DiLiGenT's tables, .dome: RelightLab's, .mat: near_ps's light.mat."""
SUFFIXES = tuple(READERS)
WRITTEN = ("diligent", "dome", "lp", "meshroom")


def read_light_file(path: Path, camera: Camera | None) -> Lights:
    """Return a file's lights in its own order, as they are written; without intensities these are NaN.

    Raises
    ------
    CalibrationError
        Unknown suffix, or a malformed file.
    """
    if path.suffix.lower() not in READERS:
        raise CalibrationError(
            f"{path}: lights in {path.suffix or 'a file without suffix'} are not known; expected one of "
            f"{', '.join(SUFFIXES)} (.txt: DiLiGenT's light_directions.txt)."
        )
    read, expected = READERS[path.suffix.lower()]
    with reading(path, "cannot be read as lights", CalibrationError, do=f"Expected {expected}."):
        return read(path, camera)


def export_lights(
    folder: Path, name: str, lights: Lights, camera: Camera, *, files: tuple[str, ...]
) -> tuple[list[Path], list[str]]:
    """Write lights in another program's format.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    name : str
        One of `WRITTEN`.
    lights : Lights
        Formats without positions get the directions as seen from `reference_point_mm`.
    camera : Camera
    files : tuple of N str
        The photographs' file names, for the formats that name files.

    Returns
    -------
    paths : list of Path
        What was written.
    notes : list of str
        What the format cannot say of these lights.
    """
    contents: dict[str, Any]
    notes: list[str] = []
    if name == "dome":
        contents, notes = dome_of(lights, camera)
    elif name == "lp":
        contents, notes = lp_file(files, lights), ["lp has no intensities."]
        if blank := next((file for file in files if " " in file), None):
            notes.append(f"lp: RelightLab and AliceVision cannot read names with blanks ({blank}).")
    else:
        contents = light_tables(files, lights) if name == "diligent" else sfm_lights(lights)
    if lights.model == "near" and name != "dome":
        x, y, z = lights.reference_point_mm
        notes.append(f"{name} has no positions: directions as seen from ({x:.0f}, {y:.0f}, {z:.0f}) mm.")
    for file, content in contents.items():
        (write_text if isinstance(content, str) else write_json)(folder / file, content)
    return [folder / file for file in contents], notes
