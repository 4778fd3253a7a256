"""Lights in the files of every output folder: lights.json, and for others DiLiGenT's tables, read too, and `.lp`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.lights import Lights
from scene.reading import numbers, shortened, text_of

Array = NDArray[np.float64]
FILENAMES, DIRECTIONS, INTENSITIES = "filenames.txt", "light_directions.txt", "light_intensities.txt"
LP = "lights.lp"
BY_COLUMN = "has a light a column, not a line: so it is taken"
EITHER = "has three lines of three numbers, a light a line or a column: taken as a line"


def names_in(path: Path, error: type[SceneError] = SceneError) -> list[str]:
    """Return the photographs that a filenames.txt lists."""
    return [name for line in text_of(path, error=error).splitlines() if (name := line.strip())]


def table_in(path: Path, error: type[SceneError] = SceneError, beside: str | None = None) -> tuple[Array, str]:
    """Return a table of lights (N, 3), NaN and infinity as they are written; and what to say of how it was read.

    Numbers between blanks or commas: a light a line, or a column (`BY_COLUMN`); a first line may count the lights.

    Parameters
    ----------
    beside : str or None
        Intensities, one or three a light: what was said of their directions. None: directions.

    Raises
    ------
    SceneError
        Of the type `error`: unreadable, empty, or a line of another length or with a word that is no number.
    """
    lines = text_of(path, error=error).splitlines()
    rows = [row for line in lines if (row := line.split("#")[0].replace(",", " ").split())]
    if len(rows) > 1 and len(rows[1]) > 1 and rows[0] in ([str(len(rows) - 1)], [str(len(rows[1]))]):
        rows = rows[1:]
    width = len(rows[0]) if rows else 0
    by_column = len(rows) == 3 and width > 3
    table, where = [], "it is empty"
    for number, row in enumerate(rows, 1):
        try:
            if len(row) != width or not (width == 3 or by_column or (width == 1 and beside is not None)):
                raise ValueError
            table.append([float(word) for word in row])
        except ValueError:
            table, where = [], f"line {number} is {shortened(' '.join(row), 60)!r}"
            break
    if not table:
        raise error(f"{path}: {where}; expected three numbers a line, one line a photograph.")
    values, is_told = np.array(table), True
    if values.shape == (3, 3):
        unit = [bool((abs(np.linalg.norm(way, axis=1) - 1) < 0.01).all()) for way in (values, values.T)]
        by_column = unit == [False, True] if beside is None else beside == BY_COLUMN
        is_told = beside is not None or unit[0] != unit[1] or np.array_equal(values, values.T)
    values = values.T if by_column else values
    return np.broadcast_to(values, (len(values), 3)), BY_COLUMN if by_column else "" if is_told else EITHER


def light_tables(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return DiLiGenT's three files, {name: text}; `files` are those of the photographs."""
    columns = {DIRECTIONS: lights.directions, INTENSITIES: lights.intensities}
    rows = {name: [" ".join(f"{value:.8f}" for value in row) for row in table] for name, table in columns.items()}
    return {name: "".join(f"{line}\n" for line in lines) for name, lines in (rows | {FILENAMES: files}).items()}


def lp_file(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return the `.lp` file, {name: text}: the count, then the photograph's file and the direction a line."""
    rows = zip(files, lights.directions, strict=True)
    lines = [f"{file} {x:.8f} {y:.8f} {z:.8f}\n" for file, (x, y, z) in rows]
    return {LP: f"{len(lines)}\n{''.join(lines)}"}


def lights_json(lights: Lights) -> dict[str, Any]:
    """Return what lights.json holds: see `scene.store.Store.save_lights`, which writes it; unknown directions null."""
    columns = {
        "name": lights.names,
        "direction": None if lights.is_unknown else lights.directions,
        "position_mm": lights.positions_mm,
        "intensity": lights.intensities,
        "direction_sigma_deg": lights.direction_sigma_deg,
        "intensity_sigma": lights.intensity_sigma,
        "flags": lights.flags,
    }
    known = [[None] * len(lights) if column is None else column for column in columns.values()]
    whole = ("reference_point_mm", "ambient", "white_value", "model")
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*known, strict=True)]
    return {"frames": rows, **{name: getattr(lights, name) for name in whole}}


def lights_of_json(data: dict[str, Any]) -> Lights:
    """Return the lights of what a lights.json holds; what is null or missing of a light is NaN."""
    rows = data["frames"]

    def column(name: str) -> NDArray[np.float64]:
        return np.array([np.nan if row.get(name) is None else row[name] for row in rows], np.float64)

    def vector(name: str) -> NDArray[np.float64] | None:
        return None if data.get(name) is None else numbers(data[name], 3, what=name)

    reference, positions = vector("reference_point_mm"), None
    if data.get("model") == "near":
        positions = numbers([row["position_mm"] for row in rows], -1, 3, what="position_mm")
    return Lights(
        tuple(str(row["name"]) for row in rows),
        np.array([row["direction"] or [np.nan] * 3 for row in rows], np.float64).reshape(-1, 3),
        np.array([row["intensity"] for row in rows], np.float64).reshape(-1, 3),
        positions,
        np.zeros(3) if reference is None else reference,
        column("direction_sigma_deg"),
        column("intensity_sigma"),
        vector("ambient"),
        vector("white_value"),
        tuple(tuple(map(str, row.get("flags", ()))) for row in rows),
    )
