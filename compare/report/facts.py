"""What the output folder and its summary say of methods, speed, lights, balls and warnings; what there is to show."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain, groupby, repeat
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.pictures import Exposure
from draw.readable import is_number
from draw.speed_chart import SpeedPoint
from scene.errors import SceneError
from scene.frames import Frames
from scene.method_names import METHODS, UNCALIBRATED
from scene.store import Store

Summary = dict[str, Any]
Found = TypeVar("Found")


def method_names(store: Store) -> list[str]:
    """Return the methods whose normals are in the folder, ours first and in their order."""
    names = {path.stem for place in ("normals", "twin/normals") for path in store.path(place).glob("*.npy")}
    names -= {"truth", "truth_sigma"}
    return [name for name in METHODS if name in names] + sorted(names - set(METHODS))


def family(method: str) -> str:
    """Return `calibrated`, `uncalibrated` or `external`: another program's name begins with a capital."""
    if method[:1].isupper():
        return "external"
    return "uncalibrated" if method in UNCALIBRATED else "calibrated"


def tied_methods(compared: dict[str, Any]) -> list[str]:
    """Return the method of the least median error with those that are not told apart from it (`level`)."""
    level = compared.get("level") or {}
    return [name for name in (level.get("best"), *(level.get("level") or ())) if name]


def by_error(compared: dict[str, Any]) -> list[str]:
    """Return the methods of a comparison, the best on the photographs first.

    With a tolerance that which has most of the object within it. The `tied_methods` by their mean, which counts the
    tail, then the others by their median. Those without an error follow in the order in which they are.
    """
    methods, tied = compared.get("methods") or {}, tied_methods(compared)
    fittest = (compared.get("tolerance") or {}).get("method")

    def error(name: str) -> tuple[bool, bool, float]:
        found = methods[name].get("real") or {}
        value = found.get("mean_deg" if name in tied else "median_deg")
        return name != fittest, name not in tied, value if is_number(value) else np.inf

    return sorted(methods, key=error)


def best_method(summary: Summary) -> str | None:
    """Return the method that stands first: by the ground truth, or without one as the photographs recommend."""
    compared, trust = summary.get("compare") or {}, summary.get("trust") or {}
    recommended = None if compared.get("has_truth") else trust.get("recommended")
    return recommended or next(iter(by_error(compared)), None)


def stated_of_lights(summary: Summary) -> Summary:
    """Return what `calibrate`, or `align` where it found the lights, says of them; sigmas of given ones are theirs."""
    # What `align` found of lights that `calibrate` could not tell.
    told = {**(summary.get("calibrate") or {}), **((summary.get("align") or {}).get("light_probe") or {})}
    given = (summary.get("compare") or {}).get("lights") or {}
    keys = ("direction_sigma_deg_median", "intensity_sigma_median")
    return told | {key: told[key] if is_number(told.get(key)) else given.get(key) for key in keys}


def there(load: Callable[..., Found], *what: Any) -> Found | None:
    """Return what is loaded; None where it is missing or a killed run left it unreadable."""
    with suppress(SceneError):
        return load(*what)
    return None


def read_optional(store: Store, name: str) -> Any:
    """Return a JSON file of the folder, None where there is none or it holds no JSON."""
    return there(store.read_json, name)


def map_of(store: Store, place: str, name: str) -> NDArray[np.float32] | None:
    """Return a map of the folder as a memory map, None where it is not there."""
    return store.read_array(place, f"{name}.npy") if store.path(place, f"{name}.npy").exists() else None


def sphere_rows(store: Store) -> list[dict[str, Any]]:
    """Return spheres.json with what calibration.json adds: in how many frames each ball's highlight was found."""
    highlights = (read_optional(store, "calibration.json") or {}).get("highlights_px") or []
    out = []
    for row, seen in zip(read_optional(store, "spheres.json") or [], chain(highlights, repeat(None)), strict=False):
        counts = (None, None) if seen is None else (sum(map(is_seen, seen)), len(seen))
        distance = None if row.get("center_mm") is None else float(np.linalg.norm(row["center_mm"]))
        out.append({**row, "distance_mm": distance, "highlights_seen": counts[0], "highlights_frames": counts[1]})
    return out


def is_seen(pixel: Any) -> bool:
    """Tell whether a highlight has a place: one that was not found is null, or not a number."""
    return pixel is not None and bool(np.isfinite(np.array(pixel, np.float64)).all())


NUMBER = re.compile(r"\d+(?:\.\d+)?")


def by_runs(names: Sequence[str]) -> str:
    """Return names in a row, three or more whose numbers follow each other by the first and the last."""

    def run_of(place: int, name: str) -> tuple[str, int, int]:
        stem, number = re.fullmatch(r"(.*?)(\d*)", name, re.DOTALL).groups()  # type: ignore[union-attr]
        return stem, len(number), int(number or 0) - place

    pairs = groupby(enumerate(dict.fromkeys(names)), lambda pair: run_of(*pair))
    runs = ([name for _, name in run] for _, run in pairs)
    parts = ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else run for run in runs)
    return ", ".join(part for run in parts for part in run)


def all_warnings(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return every warning of the summary's `warnings`, of all steps, as (step, text).

    Those that say the same of several frames, methods or places, but for their numbers, are one: NAMES: text, its
    numbers from the least to the most.
    """
    causes: dict[tuple[str, str], list[tuple[str, str]]] = {}
    listed = ((row["step"], row["text"].removeprefix(f"{row['step']}: ")) for row in summary.get("warnings") or ())
    for step, text in dict.fromkeys(listed):
        name, colon, said = text.partition(": ")
        name, said = (name, said) if colon and len(name) < len(said) else ("", text)
        causes.setdefault((step, NUMBER.sub("#", said)), []).append((name, said))
    found = []
    for (step, _), alike in causes.items():
        names = by_runs([part for name, _ in alike for part in name.split(", ") if part])
        columns = zip(*(NUMBER.findall(said) for _, said in alike), strict=True)
        spans = (dict.fromkeys([min(column, key=float), max(column, key=float)]) for column in columns)
        ends = iter([" to ".join(span) for span in spans])
        said = NUMBER.sub(lambda _, ends=ends: next(ends), alike[0][1])
        found.append((step, f"{names}: {said}" if names else said))
    return found


def speed_points(summary: Summary) -> list[SpeedPoint]:
    """Return what logarithmic axes can show: methods whose time and error are known and not zero.

    `summary` is as in summary.json; of it solve.methods and compare.
    """
    errors, points = (summary.get("compare") or {}).get("methods") or {}, []
    for method, row in ((summary.get("solve") or {}).get("methods") or {}).items():
        spent, pixels = row.get("twin_processor_seconds"), (row.get("megapixels") or 0) * (row.get("frames") or 0)
        seconds = {"real": row.get("processor_seconds_per_megapixel_image")}
        seconds["twin"] = spent / pixels if spent and pixels else None
        for kind, each in seconds.items():
            median = ((errors.get(method) or {}).get(kind) or {}).get("median_deg")
            if is_number(median) and is_number(each) and min(median, each) > 0:
                points.append(SpeedPoint(method, family(method), kind, each, median))
    return points


class Material:
    """What the folder holds to be shown, None where it is not there: a report is made once all is.

    `summary` may lack any part. lights: `scene.lights.Lights.facts`; raking: the frame that shows shape best.
    """

    def __init__(self, store: Store, summary: Summary) -> None:
        compared, lights, self.store = summary.get("compare") or {}, there(store.load_lights), store
        self.frames: Any = there(store.load_frames)
        self.camera: Any = there(store.load_camera)
        self.twin_frames = there(Store(store.path("twin")).load_frames)
        self.mask: Any = there(store.load_mask) if store.path("mask.png").exists() else None
        white_value = None if lights is None else lights.white_value
        self.exposure: Any = None
        if self.frames is not None:
            self.exposure = Exposure.for_frames(self.frames, white_value=white_value)
        count = None if self.frames is None else len(self.frames)
        self.raking = 0 if lights is None else pictures.raking_frame(lights.directions[:count])
        self.lights: Summary | None = compared.get("lights") or there(lambda: store.load_lights().facts())
        self.spheres: list[Summary] = compared.get("spheres") or sphere_rows(store)
        self.methods = by_error(compared) if "methods" in compared else method_names(store)

    def photographs_of_ball(self, index: int) -> tuple[Frames | None, Exposure | None]:
        """Return the frames that show a ball: the session's, or its own where it was shot apart."""
        apart = [i for i, row in enumerate(self.spheres) if row.get("apart")]
        if index not in apart:
            return self.frames, self.exposure
        folders = sorted(self.store.path("spheres").glob("*/frames"), key=lambda path: int(path.parent.name))
        # Balls that share their photographs share a folder: which is whose is then not known here.
        if len(folders) != len(apart):
            return None, None
        frames = Store(folders[apart.index(index)].parent).load_frames()
        return frames, Exposure.for_frames(frames)

    def map_of(self, place: str, name: str) -> NDArray[np.float32] | None:
        return map_of(self.store, place, name)
