"""Lights in the files of every output folder: lights.json, and for others DiLiGenT's tables and `.lp`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from scene.reading import numbers

FILENAMES, DIRECTIONS, INTENSITIES = "filenames.txt", "light_directions.txt", "light_intensities.txt"
LP = "lights.lp"


def number_rows(rows: NDArray[np.float64]) -> str:
    """Return DiLiGenT's text of (N, 3): a light's three numbers a line."""
    return "".join(" ".join(f"{value:.8f}" for value in row) + "\n" for row in rows)


def light_tables(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return DiLiGenT's three files, {name: text}; `files` are those of the photographs."""
    return {
        DIRECTIONS: number_rows(lights.directions),
        INTENSITIES: number_rows(lights.intensities),
        FILENAMES: "".join(f"{file}\n" for file in files),
    }


def lp_file(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return the `.lp` file, {name: text}: the count, then the photograph's file and the direction a line."""
    rows = zip(files, lights.directions, strict=True)
    lines = [f"{file} {x:.8f} {y:.8f} {z:.8f}\n" for file, (x, y, z) in rows]
    return {LP: f"{len(lines)}\n{''.join(lines)}"}


def lights_json(lights: Lights) -> dict[str, Any]:
    """Return what lights.json holds: see `scene.store.Store.save_lights`, which writes it; unknown directions null."""
    rows = zip(
        lights.names,
        [None] * len(lights) if lights.is_unknown else lights.directions,
        [None] * len(lights) if lights.positions_mm is None else lights.positions_mm,
        lights.intensities,
        lights.direction_sigma_deg,
        lights.intensity_sigma,
        lights.flags,
        strict=True,
    )
    keys = ("name", "direction", "position_mm", "intensity", "direction_sigma_deg", "intensity_sigma", "flags")
    return {
        "frames": [dict(zip(keys, row, strict=True)) for row in rows],
        "reference_point_mm": lights.reference_point_mm,
        "ambient": lights.ambient,
        "white_value": lights.white_value,
        "model": lights.model,
    }


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
