"""The list of datasets: at a terminal, as JSON, as a table for the documentation; and a check's verdict as JSON."""

import json
from dataclasses import asdict
from typing import Any

from experiments.datasets.check import Verdict
from experiments.datasets.shelf import Entry

FAMILIES = {
    "ambient": "light from everywhere that nobody subtracted, as a share of the flash",
    "interreflection": "a white hollow's depth over its radius",
    "material": "the benchmark's eight materials",
    "images": "how many of 32 frames are taken, with a camera's noise",
    "noise": "photon noise at pixel value 1",
    "ring": "a ring of 24 lights, degrees from the camera's axis, with a camera's noise",
    "roughness": "alpha of rough plastic",
    "shadow": "height of waves and ridges",
    "specularity": "factor on the coat's reflectance",
    "near": "32 lights so many mm from the middle of an object 200 mm wide",
    "hand": "so many flashes by hand: places at random, 700 to 1300 mm away, uneven in power",
    "camera": "noise and colour filter as measured on photographs; 4x, 16x: underexposed so much",
    "group": "three objects of different materials that light and shade each other; lights distant, or 700 mm away",
    "added": "datasets of others, on this shelf",
}
"""By name, what is varied."""


def tell(found: list[Entry]) -> None:
    """Print a line a dataset, and how many there are."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("name", "on the shelf", "what it is"):
        table.add_column(column, no_wrap=column == "name")
    for one in found:
        table.add_row(one.name, one.state or "-", one.text)
    console = Console()
    # A pipe has no width: names and texts must not be cut there.
    if not console.is_terminal:
        console = Console(width=200)
    console.print(table, markup=False)
    console.print(f"{len(found)} datasets, {sum(bool(one.state) for one in found)} on the shelf", highlight=False)


def tell_families(found: list[Entry]) -> None:
    """Print a line a family."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("family", "datasets", "what is varied", "for instance"):
        table.add_column(column)
    for name, members in _families(found).items():
        table.add_row(name, str(len(members)), FAMILIES[name], members[len(members) // 2].name)
    Console().print(table)


def families_markdown(found: list[Entry]) -> str:
    """Return a Markdown table of the families."""
    lines = ["| family | datasets | what is varied | for instance |", "|---|---|---|---|"]
    for name, members in _families(found).items():
        lines.append(f"| `{name}` | {len(members)} | {FAMILIES[name]} | `{members[len(members) // 2].name}` |")
    return "\n".join([*lines, f"| all | {len(found)} | | |"]) + "\n"


def as_json(found: list[Entry]) -> str:
    """Return the list as JSON."""
    return json.dumps([{**asdict(one), "folder": str(one.folder)} for one in found], indent=1)


def verdict_json(verdict: Verdict) -> str:
    """Return a verdict as JSON."""
    plain: dict[str, Any] = {**asdict(verdict), "folder": str(verdict.folder), "ok": not verdict.faults}
    return json.dumps(plain, indent=1)


def _families(found: list[Entry]) -> dict[str, list[Entry]]:
    families: dict[str, list[Entry]] = {}
    for one in found:
        families.setdefault(one.family, []).append(one)
    return families
