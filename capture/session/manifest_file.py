"""A `session.toml` read into its `Manifest`, with all that is wrong in it at once: each fault with its key path."""

import copy
import difflib
import functools
import operator
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from capture.session.manifest import TABLES, Manifest, ManifestTable
from formats.toml_documents import Location, fault_line
from scene.errors import SessionError
from scene.reading import reading, shortened, text_of

LONGEST = 1 << 20
"""Bytes of a session.toml."""
CURES = (
    (r"[“”„«»‘’]", 'Write plain quotation marks, as in "text".'),
    (r"\\", "Write / between folders, also on Windows."),
    (r"=\s*\d+,\d", "Write a point for decimals, as in 76.2."),
    (r"=\s*(True|False)\b", "Write true and false in small letters."),
    (r'^[^"=]*:', "Write = between a key and its value."),
    (r'^[^"]*"[^"]*$', "A quotation mark is missing: a text stands between two."),
    (r"=\s*[\d.]+\s*[a-zA-Z]", "Write the number without its unit."),
    (r"=\s*[a-zA-Z./*]", 'Write a text between quotation marks, as in "text".'),
)
"""What people write, as it is found in the line, and what to do; the first that fits."""
MISSING = {
    "frames": 'Add a table [frames] with flash = "raw/flash_*.dng".',
    "frames.flash": 'Add flash = "raw/flash_*.dng" under [frames]: one light per frame.',
    "lights.file": 'Add file = "lights.lp", or drop [lights].',
    "spheres": 'Add kind = "chrome" or "white".',
}
BALLS = {
    "spheres": "expected [[spheres]], with two brackets, above each ball",
    "spheres.kind": "expected 'chrome' or 'white' (chrome: a mirror; white: a matte ball)",
}


def toml_tables(path: Path) -> dict[str, Any]:
    """Return what a session.toml holds; SessionError: it is no TOML, or no text."""
    text = text_of(path, "is not TOML", SessionError, most=LONGEST, do="Correct it.")
    with reading(path, "is not TOML", SessionError, do="Correct it."):
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise SessionError(f"{path}: {_told(text, str(error))}") from error


def _told(text: str, said: str) -> str:
    """Return which line is no TOML, and what to do about it; `said`: tomllib's own words, with the line's number."""
    words, _, place = said.partition(" (at line ")
    number = int(place.split(",")[0]) if place else text.rstrip().count("\n") + 1
    line = text.split("\n")[number - 1].split("#")[0]
    where = f"line {number} is not TOML: {shortened(line, 80)}"
    if "twice" in words or "overwrite" in words:
        balls = " Balls stand each under [[spheres]], with two brackets." if "spheres" in words else ""
        return f"{where} stands there a second time. Keep one.{balls}"
    do = next((cure for sign, cure in CURES if re.search(sign, line)), "Correct that line.")
    return f"{where} ({words[0].lower()}{words[1:]}). {do}"


def parse(data: dict[str, Any]) -> tuple[Manifest | None, list[str]]:
    """Return what can be understood of a manifest, and a line of "key.path: what was found, what to do" a fault.

    The manifest is without the tables at fault, so that the files that the others name can be checked in the same run.
    """
    try:
        return Manifest.model_validate(data), []
    except ValidationError as error:
        faults = error.errors(include_url=False)
    try:
        manifest = Manifest.model_validate(_without(data, faults))
    except ValidationError:
        manifest = None
    return manifest, _lines(faults)


def table_of(name: str, data: dict[str, Any]) -> ManifestTable:
    """Return a table of a manifest by itself; SessionError: all that it may not have, in the words of `parse`."""
    try:
        return TABLES[name].model_validate(data)
    except ValidationError as error:
        faults = [fault | {"loc": (name, *fault["loc"])} for fault in error.errors(include_url=False)]
        raise SessionError("; ".join(_lines(faults))) from None


def _lines(faults: Iterable[Mapping[str, Any]]) -> list[str]:
    return [fault_line(fault, _suggestion, missing=MISSING, expected=BALLS) for fault in faults]


def _without(data: dict[str, Any], faults: list) -> dict[str, Any]:
    """Drop unknown keys, keys of [frames] at fault, and whole other tables at fault: half a camera would mislead."""
    data, paths = copy.deepcopy(data), []
    for fault in faults:
        location = list(fault["loc"])
        deep = len(location) if fault["type"] == "extra_forbidden" else 2 if location[0] == "frames" else 1
        paths.append(location[:deep])
    for *above, key in sorted(paths, key=len, reverse=True):
        holder: Any = functools.reduce(operator.getitem, above, data)
        if isinstance(holder, dict):
            holder.pop(key, None)
    return data


def _suggestion(location: Location) -> str:
    """Say which key may have been meant: a like one in the same table, else the same one elsewhere."""
    own = ".".join(part for part in location[:-1] if isinstance(part, str))
    key = str(location[-1])
    if own == "spheres" and re.match("radius(?!_px$)", key):
        return "Write diameter_mm: twice the radius, in millimetres."
    if key.lower() in ("ball", "balls"):
        return "Write [[spheres]] above each ball."
    known = list(TABLES[own].model_fields) if own in TABLES else []
    for close in difflib.get_close_matches(key, known, n=1, cutoff=0.6):
        unit = " It is in millimetres." if close.endswith("_mm") and not key.endswith("_mm") else ""
        return f"Did you mean {close}?{unit}"
    for name, table in TABLES.items():
        if name not in ("", own, "camera.board") and key in table.model_fields:
            return f"It belongs under {'[[spheres]]' if name == 'spheres' else f'[{name}]'}."
    return f"Known here: {', '.join(known)}."
