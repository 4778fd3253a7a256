"""Lights from lines of text and to them: `.lp` of the RTI programs, and DiLiGenT's tables."""

from pathlib import Path

import numpy as np

from formats.diligent_layout import FILENAMES, names_in, table_in
from formats.light_files.light_frames import Photographs, nameless, stem
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_text import light_tables, lp_file
from scene.lights import Lights
from scene.reading import shortened, text_of


def read_lp(path: Path, camera: Camera | None = None) -> Lights:
    """Read `.lp`: first line the count, then `name x y z`; the name may hold spaces. It has no intensities."""
    text = text_of(path, error=CalibrationError)
    lines = [line.split() for line in text.splitlines() if line.strip()]
    try:
        count = int(lines[0][0])
    except (IndexError, ValueError):
        raise CalibrationError(f"{path}: line 1 must be the number of lights, found {text[:40]!r}.") from None
    rows = lines[1:]
    if len(rows) != count:
        raise CalibrationError(f"{path}: line 1 says {count} lights, but {len(rows)} follow.")
    bad = next((i for i, row in enumerate(rows) if len(row) < 4), None)
    if bad is not None:
        found = shortened(" ".join(rows[bad]))
        raise CalibrationError(f"{path}: light {bad + 1} is {found!r}; expected: name x y z, with blanks between.")
    directions = np.array([[_number(path, word) for word in row[-3:]] for row in rows]).reshape(-1, 3)
    names = tuple(stem(" ".join(row[:-3])) for row in rows)
    return Lights(names, directions, np.full_like(directions, np.nan))


def _number(path: Path, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise CalibrationError(f"{path}: {shortened(word)!r} is not a number. Write a point for decimals.") from None


def write_lp(lights: Lights, shot: Photographs) -> tuple[dict[str, str], list[str]]:
    """Return lights.lp."""
    return lp_file(shot.files, lights), ["lp has no intensities."]


def read_diligent(path: Path, camera: Camera | None = None) -> Lights:
    """Read DiLiGenT's directions, one a line, with light_intensities.txt and filenames.txt beside them if there."""
    directions = table_in(path, CalibrationError)
    intensities = np.full_like(directions, np.nan)
    beside = path.with_name(path.name.replace("directions", "intensities"))
    if beside != path and beside.is_file():
        intensities = table_in(beside, CalibrationError)
        if len(intensities) != len(directions):
            raise CalibrationError(
                f"{beside}: {len(intensities)} intensities, but {path.name} has {len(directions)} lights."
            )
    listed = path.with_name(FILENAMES)
    names = tuple(map(stem, names_in(listed, CalibrationError))) if listed.is_file() else ()
    return Lights(names if len(names) == len(directions) else nameless(len(directions)), directions, intensities)


def write_tables(lights: Lights, shot: Photographs) -> tuple[dict[str, str], list[str]]:
    """Return DiLiGenT's three tables."""
    return light_tables(shot.files, lights), []
