"""One cell: photographs, every method with every profile, and a row for each."""

import time
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from threading import Lock
from typing import Any

import numpy as np

from compare.statistics.statistics import albedo_statistics
from experiments.recipe import ROOM, Cell
from experiments.tables import GAP_DEG, Row, Rows, errors_of, why
from scene.current import code_fingerprint
from scene.errors import SceneError
from scene.map_pictures import data_uri, shrink
from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg
from solve.solve import solve

PICTURE_SIDE = 96
SOME_SIDE = 32
_LOADED: set[tuple[str, str]] = set()
_ONE_AT_A_TIME = Lock()
"""In a process: a cell uses one core, and Mitsuba's settings are the process'."""


def run_cell(cell: Cell) -> dict[str, Any]:
    """Return what a cell gives; never raises for what its methods or its scene do.

    rows: one for each method and profile, see `measured`. seconds: their processor time. picture: a frame, a PNG's data
    URI. code: hash of the code that made them, as this process has it.
    """
    # Cells are named without the renderer.
    from experiments.photographs import one_thread, photograph

    with _ONE_AT_A_TIME, one_thread(), ThreadPoolExecutor(1) as one_core:
        start = time.process_time()
        try:
            photographs = photograph(cell.recipe)
        except Exception as error:
            return {"rows": failed_rows(cell, f"no photographs: {why(error)}"), "seconds": [], "picture": None}
        rows, seconds = [], [{**_key(cell, "", ""), "seconds": time.process_time() - start}]
        for key in _keys(cell):
            row, taken = _solved(photographs, key["solver"], key["profile"], one_core)
            rows.append(key | row)
            seconds.append(key | {"seconds": taken})
        return {"rows": rows, "seconds": seconds, "picture": _picture(photographs), "code": code_fingerprint(ROOM)}


def failed_rows(cell: Cell, reason: str) -> Rows:
    """Return the rows of a cell that has no results."""
    return [{**key, "status": f"failed: {reason}"} for key in _keys(cell)]


def _keys(cell: Cell) -> Rows:
    return [_key(cell, method, profile) for method in cell.methods for profile in cell.profiles]


def _key(cell: Cell, method: str, profile: str) -> Row:
    """Return what names a row."""
    word = cell.value if isinstance(cell.value, str) else f"{cell.value:g}"
    value = float(cell.level) if isinstance(cell.value, str) else float(cell.value)
    place = {"level": cell.level, "value": value, "label": word, "shape": cell.recipe.shape, "seed": cell.recipe.seed}
    return {"experiment": cell.experiment, **place, "solver": method, "profile": profile}


def _solved(photographs: Any, method: str, profile: str, executor: Executor) -> tuple[Row, float | None]:
    """Return the result of one method with one profile, and its processor seconds."""
    p = photographs
    _load(p, method, profile, executor)
    start = time.process_time()
    try:
        estimate = solve(method, p.frames, p.lights, p.camera, p.mask, profile=profile, executor=executor)
    except SceneError as error:
        return {"status": f"no answer: {why(error)}", "filled_deg": GAP_DEG}, None
    except Exception as error:
        return {"status": f"failed: {why(error)}"}, None
    taken = time.process_time() - start
    return measured(p, method, estimate), taken


def _load(photographs: Any, method: str, profile: str, executor: Executor) -> None:
    """Run a method on some pixels, the first time in a process: loading its kernels is no part of its time."""
    if (method, profile) in _LOADED:
        return
    _LOADED.add((method, profile))
    p, some = photographs, np.zeros_like(photographs.mask)
    middle = tuple(slice(size // 2 - SOME_SIDE // 2, size // 2 + SOME_SIDE // 2) for size in some.shape)
    some[middle] = p.mask[middle]
    # What it makes of them does not matter.
    with suppress(Exception):
        solve(method, p.frames, p.lights, p.camera, some, profile=profile, executor=executor)


def measured(photographs: Any, method: str, estimate: Any) -> Row:
    """Return an estimate's columns of the table, by the truth.

    status: "ok"; "no answer: why", where a method refused or gave no normal; "failed: why", a fault of ours, which says
    nothing of the method. flip_deg: the median error with convex and concave exchanged where that is better.
    albedo_error_percent: the mean of `albedo_statistics`. A method that is not told the lights finds albedo up to a
    factor a channel.
    """
    p = photographs
    normals, truth = estimate.normals[p.mask], p.normals[p.mask]
    row = errors_of(normals, truth, "no answer")
    if row["status"] == "ok":
        flipped = float(np.nanmedian(angular_error_deg(normals * [-1, -1, 1], truth)))
        row["flip_deg"] = min(row["median_deg"], flipped)
    albedo = albedo_statistics(estimate.albedo[p.mask], p.albedo[p.mask], is_scaled=method in UNCALIBRATED)
    row |= {"albedo_error_percent": albedo["albedo_mean_percent"], "frames": len(p.frames)}
    return row | {"doubts": " ".join(estimate.warnings)}


def _picture(photographs: Any) -> str:
    """Return a frame lit from the side rather than from the front, small and with gamma, as the data URI of a PNG."""
    frames, mask = photographs.frames, photographs.mask
    sums = [int(frames.codes[i][mask].sum(dtype=np.int64)) for i in range(len(frames))]
    small = shrink(np.clip(frames.frame(int(np.argsort(sums)[len(sums) // 3])), 0, 1), PICTURE_SIDE)
    return data_uri(np.round(255 * small ** (1 / 2.2)).astype(np.uint8), photograph=False)
