"""What the output folder says of lights, balls and pose, as rows that the summary and the report share."""

from contextlib import suppress
from typing import Any

import numpy as np

from scene.errors import SceneError
from scene.store import Store

METHOD_ORDER = ("ls", "rpca", "iterative", "hsh", "ldr", "entropy", "tv")
"""The seed's order; other methods follow by name."""
UNCALIBRATED = ("ldr", "entropy", "tv")
"""Methods that are not told the lights' directions."""


def method_names(store: Store) -> list[str]:
    """Return the methods whose normals are in the folder, the seed's first and in its order."""
    names = {path.stem for place in ("normals", "twin/normals") for path in store.path(place).glob("*.npy")}
    names -= {"truth", "truth_sigma"}
    return sorted(
        names, key=lambda name: (METHOD_ORDER.index(name) if name in METHOD_ORDER else len(METHOD_ORDER), name)
    )


def family(method: str) -> str:
    """Return `calibrated`, `uncalibrated` or `external`: another program's name begins with a capital."""
    if method[:1].isupper():
        return "external"
    return "uncalibrated" if method in UNCALIBRATED else "calibrated"


def by_error(compared: dict[str, Any]) -> list[str]:
    """Return the methods of a comparison, the smallest median error of the photographs first.

    Those without an error follow in the order in which they are.
    """

    def median(name: str) -> float:
        value = (methods[name].get("real") or {}).get("median_deg")
        return np.inf if value is None else value

    methods = compared.get("methods") or {}
    return sorted(methods, key=median)


def read_optional(store: Store, name: str) -> Any:
    """Return a JSON file of the folder, None where there is none or it holds no JSON."""
    with suppress(SceneError):
        return store.read_json(name)
    return None


def light_rows(store: Store) -> dict[str, Any] | None:
    """Return the lights as the report draws them, None where there are none.

    Returns
    -------
    dict
        model; sigma medians; frames: name, zenith_deg (0 at the camera's axis), azimuth_deg (0 right, 90 up, as
        the camera sees it), intensity [3], intensity_mean, sigmas, position_mm and distance_mm where near, flags.
    """
    with suppress(SceneError):
        lights = store.load_lights()
        x, y, z = lights.directions.T
        rows = []
        for i, name in enumerate(lights.names):
            row = {
                "name": name,
                "zenith_deg": float(np.degrees(np.arctan2(np.hypot(x[i], y[i]), z[i]))),
                "azimuth_deg": float(np.degrees(np.arctan2(y[i], x[i])) % 360),
                "intensity": lights.intensities[i].tolist(),
                "intensity_mean": float(lights.intensities[i].mean()),
                "direction_sigma_deg": finite(lights.direction_sigma_deg[i]),
                "intensity_sigma": finite(lights.intensity_sigma[i]),
                "position_mm": None,
                "distance_mm": None,
                "flags": list(lights.flags[i]),
            }
            if lights.positions_mm is not None:
                row["position_mm"] = lights.positions_mm[i].tolist()
                row["distance_mm"] = float(np.linalg.norm(lights.positions_mm[i] - lights.reference_point_mm))
            rows.append(row)
        return {
            "model": lights.model,
            "count": len(rows),
            "reference_point_mm": lights.reference_point_mm.tolist(),
            "direction_sigma_deg_median": _median(lights.direction_sigma_deg),
            "intensity_sigma_median": _median(lights.intensity_sigma),
            "zenith_max_deg": max((row["zenith_deg"] for row in rows), default=None),
            "frames": rows,
        }
    return None


def sphere_rows(store: Store) -> list[dict[str, Any]]:
    """Return spheres.json with what calibration.json adds: in how many frames each ball's highlight was found."""
    rows = read_optional(store, "spheres.json") or []
    highlights = (read_optional(store, "calibration.json") or {}).get("highlights_px") or []
    out = []
    for index, row in enumerate(rows):
        seen = highlights[index] if index < len(highlights) else None
        distance = None if row.get("center_mm") is None else float(np.linalg.norm(row["center_mm"]))
        out.append(
            {
                **row,
                "distance_mm": distance,
                "highlights_seen": None if seen is None else sum(pixel is not None for pixel in seen),
                "highlights_frames": None if seen is None else len(seen),
            }
        )
    return out


def finite(value: Any) -> float | None:
    """Return a plain float; None for NaN, infinity and None, as JSON has no word for them."""
    return None if value is None or not np.isfinite(value) else float(value)


def _median(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None
