"""The lights and the balls as tables at a terminal."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from rgbn.text_tables import fact_table, number_table
from scene.spheres import Sphere, table_under
from scene.store import Store

MOST, WORST = 24, 12
"""More lights are not all listed, but so many: those that are flagged, then the least certain."""


def light_tables(store: Store, *, moved: bool) -> Iterator[Any]:
    """Yield the table of the lights, and that of the balls where there are any; of unknown lights that they are it.

    moved: The lights are as the object sees them, no longer as from amid the balls.
    """
    lights = store.load_lights()
    if lights.is_unknown:
        yield fact_table(
            "calibrate", [("lights", f"{len(lights)}, unknown: no ball was found, and no file gives them")]
        )
        return
    rows: list[dict[str, Any]] = list(lights.rows())
    spheres = _spheres(store)
    table = table_under(spheres, store.load_camera()) if spheres else None
    if table is not None and lights.positions_mm is not None:
        normal, offset = table
        for row, height in zip(rows, lights.positions_mm @ normal - offset, strict=True):
            row["height_mm"] = float(height)
    shown = rows if len(rows) <= MOST else sorted(rows, key=_doubt, reverse=True)[:WORST]
    heads = {
        "name": "frame\n",
        "elevation_deg": "elevation\ndeg",
        "azimuth_deg": "azimuth\ndeg",
        "distance_mm": "distance\nmm",
        "height_mm": "height\nmm",
        "intensity": "intensity\nmean 1",
        "direction_sigma_deg": "sigma\ndeg",
    }
    heads = {key: head for key, head in heads.items() if key not in ("distance_mm", "height_mm") or _known(key, rows)}
    flagged = any(row["flags"] for row in shown)
    cells = [(*(_cell(key, row) for key in heads), *([str(row["flags"])] if flagged else [])) for row in shown]
    title = f"calibrate: {len(lights)} {lights.model} lights, seen from {'the object' if moved else 'amid the balls'}"
    listing = number_table(title, (*heads.values(), *(["flags\n"] if flagged else [])), cells, words=1)
    if flagged:
        listing.columns[-1].justify = "left"
    listing.caption_justify = "left"
    listing.caption = _caption(rows, len(shown))
    yield listing
    yield from _balls(store)


def _doubt(row: dict[str, Any]) -> tuple[bool, float]:
    sigma = row["direction_sigma_deg"]
    return bool(row["flags"]), np.inf if sigma is None else sigma


def _cell(key: str, row: dict[str, Any]) -> str:
    if key == "name":
        return str(row[key])
    value = np.mean([row[f"intensity_{band}"] for band in "rgb"]) if key == "intensity" else row[key]
    digits = {"distance_mm": 0, "height_mm": 0, "intensity": 3, "direction_sigma_deg": 2}.get(key, 1)
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _caption(rows: list[dict[str, Any]], shown: int) -> str:
    """Return which light is worst, and where those are that are not listed."""
    sigmas = [row["direction_sigma_deg"] for row in rows if row["direction_sigma_deg"] is not None]
    texts = []
    if sigmas:
        worst = max((row for row in rows if row["direction_sigma_deg"] is not None), key=_sigma)
        texts.append(f"sigma {np.median(sigmas):.2f} deg (median), {_sigma(worst):.2f} deg at worst ({worst['name']})")
    if shown < len(rows):
        texts.append(f"the worst {shown}; {len(rows) - shown} more in lights.csv")
    texts.append("elevation 90: on the camera's axis; azimuth 0: right, 90: up")
    if _known("height_mm", rows):
        texts.append("height: above the table that the balls stand on")
    return "; ".join(texts)


def _known(key: str, rows: list[dict[str, Any]]) -> bool:
    return any(row.get(key) is not None for row in rows)


def _sigma(row: dict[str, Any]) -> float:
    return row["direction_sigma_deg"]


def _spheres(store: Store) -> list[Sphere]:
    return store.load_spheres() if store.path("spheres.json").exists() else []


def _balls(store: Store) -> Iterator[Any]:
    spheres, rows = _spheres(store), []
    if not spheres:
        return
    camera = store.load_camera()
    for sphere in spheres:
        diameter = sphere.diameter_mm
        away = None if diameter is None or camera.is_orthographic else np.linalg.norm(sphere.center_mm(camera))
        rows.append(
            (
                sphere.kind,
                f"({sphere.center_px[0]:.1f}, {sphere.center_px[1]:.1f})",
                f"{sphere.radius_px:.2f}",
                "–" if diameter is None else f"{diameter:.4g}",
                "–" if away is None else f"{away:.0f}",
                f"{sphere.sigma_px:.3f}",
            )
        )
    heads = ("ball\n", "centre\npx", "radius\npx", "diameter\nmm", "distance\nmm", "sigma\npx")
    yield number_table("calibrate: balls", heads, rows, words=1)
