"""What is wrong with a `session.toml`, all of it at once: each fault with its key path, and what to do."""

import copy
import difflib
import re
from typing import Any

from pydantic import ValidationError

from capture.session.manifest import TABLES, Manifest
from scene.reading import shortened


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
    return manifest, [_line(fault) for fault in faults]


def _without(data: dict[str, Any], faults: list) -> dict[str, Any]:
    """Drop unknown keys, keys of [frames] at fault, and whole other tables at fault: half a camera would mislead."""
    data = copy.deepcopy(data)
    for fault in faults:
        location = list(fault["loc"])
        holder: Any = data
        if fault["type"] == "extra_forbidden":
            for part in location[:-1]:
                holder = holder[part]
            holder.pop(location[-1], None)
        elif location[0] == "frames" and len(location) > 1 and isinstance(data.get("frames"), dict):
            data["frames"].pop(location[1], None)
    for fault in faults:
        if fault["type"] != "extra_forbidden" and fault["loc"][0] != "frames":
            data.pop(fault["loc"][0], None)
    return data


def _line(fault: Any) -> str:
    # pydantic's own wrappers (validators, unions) appear in the path as names that no file holds.
    location = [part for part in fault["loc"] if isinstance(part, int) or not part.startswith("function-")]
    path = _path(location)
    if fault["type"] == "extra_forbidden":
        return f"{path}: unknown key. {_suggestion(location)}"
    if fault["type"] == "missing":
        return f"{path}: missing. {_PURPOSE.get(path.split('[')[0], 'Add it.')}"
    found = fault["input"]
    shown = f"a table with {', '.join(found) or 'nothing'}" if isinstance(found, dict) else repr(found)
    shown = shortened(shown, 80)
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be ", "expected ")
    message = f"{message[0].lower()}{message[1:]}{_KINDS.get(path.split('.')[-1], '')}"
    return f"{path}: found {shown}; {_EXPECTED.get((path, fault['type']), _EXPECTED.get(fault['type'], message))}."


_EXPECTED = {
    "float_type": "expected a number, without quotation marks and unit",
    "int_type": "expected a whole number, without quotation marks and unit",
    "int_from_float": "expected a whole number",
    "bool_type": "expected true or false, without quotation marks",
    "string_type": "expected a text between quotation marks",
    "list_type": "expected a list between [ and ]",
    ("spheres", "list_type"): "expected [[spheres]], with two brackets, above each ball",
}
"""What pydantic's kinds of faults ask for, in the words of TOML; at one place or at all."""
_KINDS = {"kind": " (chrome: a mirror; white: a matte ball)"}
"""What the words that a key takes mean."""
_PURPOSE = {
    "frames": 'Add a table [frames] with flash = "raw/flash_*.dng".',
    "frames.flash": 'Add flash = "raw/flash_*.dng" under [frames]: one light per frame.',
    "lights.file": 'Add file = "lights.lp", or drop [lights].',
    "spheres": 'Add kind = "chrome" or "white".',
}


def _path(location: list) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _suggestion(location: list) -> str:
    """Say which key may have been meant: a like one in the same table, else the same one elsewhere."""
    own = ".".join(part for part in location[:-1] if isinstance(part, str))
    key = str(location[-1])
    if own == "spheres" and re.match("radius(?!_px$)", key):
        return "Write diameter_mm: twice the radius, in millimetres."
    if key.lower() in ("ball", "balls"):
        return "Write [[spheres]] above each ball."
    known = list(TABLES[own].model_fields) if own in TABLES else []
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if close and close[0].endswith("_mm") and not key.endswith("_mm"):
        return f"Did you mean {close[0]}? It is in millimetres."
    if close:
        return f"Did you mean {close[0]}?"
    for name, table in TABLES.items():
        if name not in ("", own, "camera.board") and key in table.model_fields:
            return f"It belongs under {'[[spheres]]' if name == 'spheres' else f'[{name}]'}."
    return f"Known here: {', '.join(known)}."
