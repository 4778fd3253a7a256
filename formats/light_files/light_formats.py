"""The formats of lights: name, suffix, reader, writer; lights read from any of them, written for other programs."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from formats.light_files.light_names import nameless
from formats.light_files.light_programs import (
    BesideLights,
    read_dome,
    read_json,
    read_mat,
    write_alicevision,
    write_dome,
    write_mat,
)
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.files import write_json, write_text, write_whole
from scene.light_text import FILENAMES, light_tables, lp_file, names_in, table_in
from scene.lights import Lights
from scene.reading import reading, shortened, text_of


def _read_lp(path: Path, camera: Camera | None = None) -> Lights:
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


def _write_lp(lights: Lights, shot: BesideLights) -> tuple[dict[str, str], list[str]]:
    """Return lights.lp."""
    blank = next((file for file in shot.files if " " in file), None)
    notes = [f"lp: RelightLab and AliceVision cannot read names with blanks ({blank})."] if blank else []
    return lp_file(shot.files, lights), ["lp has no intensities.", *notes]


def _read_diligent(path: Path, camera: Camera | None = None) -> Lights:
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


class LightFormat(NamedTuple):
    """One format; `write` returns {file name: text, bytes or JSON} and what the format cannot say of the lights."""

    suffix: str
    expected: str
    read: Callable[[Path, Camera | None], Lights]
    write: Callable[[Lights, BesideLights], tuple[dict[str, Any], list[str]]]
    has_positions: bool = False


FORMATS = {
    "lp": LightFormat(
        ".lp", "the number of lights, then a line each: name x y z, with a point for decimals", _read_lp, _write_lp
    ),
    "alicevision": LightFormat(
        ".json",
        "frames[] (this program's) with name, direction, intensity and, for near lights, position_mm, or lights[] "
        "(AliceVision's) with viewId or lightId, type, direction[3] and intensity[3]",
        read_json,
        write_alicevision,
    ),
    "diligent": LightFormat(
        ".txt",
        "three numbers a line, one line a photograph",
        _read_diligent,
        lambda lights, shot: (light_tables(shot.files, lights), []),
    ),
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
    known = {one.suffix: one for one in FORMATS.values()}.get(path.suffix.lower())
    if known is None:
        raise CalibrationError(
            f"{path}: lights in {path.suffix or 'a file without suffix'} are not known; expected one of "
            f"{', '.join(SUFFIXES)} (.txt: DiLiGenT's light_directions.txt)."
        )
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
    contents, notes = FORMATS[name].write(lights, BesideLights(camera, files, sfm))
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
