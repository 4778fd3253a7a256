"""Lights from lines of text and to them: `.lp` of the RTI programs, and DiLiGenT's tables."""

import re
from pathlib import Path

import numpy as np

from formats.light_files.light_frames import Photographs, nameless
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_text import FILENAMES, light_tables, lp_file, names_in, table_in
from scene.lights import Lights
from scene.reading import shortened, text_of


def read_lp(path: Path, camera: Camera | None = None) -> Lights:
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


def write_lp(lights: Lights, shot: Photographs) -> tuple[dict[str, str], list[str]]:
    """Return lights.lp."""
    blank = next((file for file in shot.files if " " in file), None)
    notes = [f"lp: RelightLab and AliceVision cannot read names with blanks ({blank})."] if blank else []
    return lp_file(shot.files, lights), ["lp has no intensities.", *notes]


def read_diligent(path: Path, camera: Camera | None = None) -> Lights:
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


def write_tables(lights: Lights, shot: Photographs) -> tuple[dict[str, str], list[str]]:
    """Return DiLiGenT's three tables."""
    return light_tables(shot.files, lights), []
