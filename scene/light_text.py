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
    """Return what lights.json holds: see `scene.store.Store.save_lights`, which writes it."""
    rows = zip(
        lights.names,
        lights.directions,
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


def light_facts(lights: Lights) -> dict[str, Any]:
    """Return the lights as figures and the report draw them.

    model; count; reference_point_mm; sigma medians; zenith_max_deg; frames: name, zenith_deg (0 at the camera's axis),
    azimuth_deg (0 right, 90 up, as the camera sees it), intensity [3], intensity_mean, sigmas, position_mm and
    distance_mm (from the reference point) where near, flags. None where unknown.
    """
    x, y, z = lights.directions.T
    zenith, azimuth = np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x)) % 360
    rows = []
    for i, name in enumerate(lights.names):
        position = None if lights.positions_mm is None else lights.positions_mm[i]
        away = None if position is None else float(np.linalg.norm(position - lights.reference_point_mm))
        rows.append(
            {
                "name": name,
                "zenith_deg": float(zenith[i]),
                "azimuth_deg": float(azimuth[i]),
                "intensity": lights.intensities[i].tolist(),
                "intensity_mean": float(lights.intensities[i].mean()),
                "direction_sigma_deg": _finite(lights.direction_sigma_deg[i]),
                "intensity_sigma": _finite(lights.intensity_sigma[i]),
                "position_mm": None if position is None else position.tolist(),
                "distance_mm": away,
                "flags": list(lights.flags[i]),
            }
        )
    return {
        "model": lights.model,
        "count": len(rows),
        "reference_point_mm": lights.reference_point_mm.tolist(),
        "direction_sigma_deg_median": _median(lights.direction_sigma_deg),
        "intensity_sigma_median": _median(lights.intensity_sigma),
        "zenith_max_deg": max((row["zenith_deg"] for row in rows), default=None),
        "frames": rows,
    }


def light_rows(lights: Lights) -> list[dict[str, str | float | None]]:
    """Return a table of the lights, a row each: what every table of lights shows, here and in files.

    Returns
    -------
    list of dict
        name: the frame's; direction_x, direction_y, direction_z: unit, from the reference point toward the light,
        camera frame (x right, y up, z toward the viewer); elevation_deg: 90 on the camera's axis, 0 beside the object;
        azimuth_deg: 0 right, 90 up, as the camera sees it; x_mm, y_mm, z_mm: position, camera frame; distance_mm: from
        the reference point; intensity_r, intensity_g, intensity_b: relative, the mean over lights is 1;
        direction_sigma_deg: standard deviation along one tangent axis; intensity_sigma: the relative one; flags: what
        is suspicious, with "; " between. None where unknown; a distant light has no position.
    """
    rows = []
    for fact, direction in zip(light_facts(lights)["frames"], lights.directions.tolist(), strict=True):
        place = fact["position_mm"] or (None, None, None)
        row = {"name": fact["name"], **dict(zip(("direction_x", "direction_y", "direction_z"), direction, strict=True))}
        row |= {"elevation_deg": 90 - fact["zenith_deg"], "azimuth_deg": fact["azimuth_deg"]}
        row |= {**dict(zip(("x_mm", "y_mm", "z_mm"), place, strict=True)), "distance_mm": fact["distance_mm"]}
        row |= zip(("intensity_r", "intensity_g", "intensity_b"), fact["intensity"], strict=True)
        row |= {name: fact[name] for name in ("direction_sigma_deg", "intensity_sigma")}
        rows.append(row | {"flags": "; ".join(fact["flags"])})
    return rows


def _finite(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _median(values: NDArray[np.float64]) -> float | None:
    """Return the median of the known values; None without any."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None


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
        np.array([row["direction"] for row in rows], np.float64).reshape(-1, 3),
        np.array([row["intensity"] for row in rows], np.float64).reshape(-1, 3),
        positions,
        np.zeros(3) if reference is None else reference,
        column("direction_sigma_deg"),
        column("intensity_sigma"),
        vector("ambient"),
        vector("white_value"),
        tuple(tuple(map(str, row.get("flags", ()))) for row in rows),
    )
