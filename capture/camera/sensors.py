"""The sensors of cameras: how wide they are, by what cameras write into EXIF."""

import re
import tomllib
from functools import cache
from pathlib import Path


def sensor_width_mm(camera: str) -> float | None:
    """Return the longer side of a camera's sensor, mm; None for one that sensors.toml does not list.

    Parameters
    ----------
    camera : str
        Maker and model in any case, as EXIF has them: "NIKON CORPORATION NIKON D850".
    """
    text = _words(camera)
    found = {model: width for (maker, model), width in _widths().items() if f" {maker} " in text and model in text}
    # "EOS R5 Mark II" names "EOS R5" too.
    return found[max(found, key=len)] if found else None


def _words(text: str) -> str:
    """Return the words of a text, small, each between two blanks."""
    return f" {' '.join(re.findall(r'[a-z0-9]+', text.lower()))} "


@cache
def _widths() -> dict[tuple[str, str], float]:
    tables = tomllib.loads(Path(__file__).with_name("sensors.toml").read_text())
    return {
        (maker, _words(model)): float(width)
        for maker, widths in tables.items()
        for width, models in widths.items()
        for model in models
    }
