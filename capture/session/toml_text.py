"""The text of a `session.toml` to tables; where it is no TOML: which line, what stands there, and what to write."""

import re
import tomllib
from pathlib import Path
from typing import Any

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


def toml_tables(path: Path) -> dict[str, Any]:
    """Return what a session.toml holds.

    Raises
    ------
    SessionError
        It is no TOML, or no text.
    """
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
