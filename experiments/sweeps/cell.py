"""One cell: photographs, every method with every profile, and a row for each."""

import time
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.ambiguity import error_kinds
from experiments.recipe import ROOM, Cell
from experiments.sweeps.perturbation import PERTURBATIONS, breaking_point, is_told
from experiments.tables import GAP_DEG, errors_of
from scene.current import code_fingerprint
from scene.errors import SceneError
from scene.map_pictures import data_uri, shrink
from solve.methods import UNCALIBRATED
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
            return {"rows": failed_rows(cell, f"no photographs: {_why(error)}"), "seconds": [], "picture": None}
        rows, seconds = [], [{**_key(cell, "", ""), "seconds": time.process_time() - start}]
        errors: dict[str, list[NDArray]] = {profile: [] for profile in cell.profiles}
        for method in cell.methods:
            for profile in cell.profiles:
                row, taken, normals = _row(cell, photographs, method, profile, one_core)
                rows.append(row)
                seconds.append({**_key(cell, method, profile), "seconds": taken})
                errors[profile].append(_errors(photographs, normals))
        for profile, found in errors.items():
            means = common_means(np.stack(found)) if found else []
            for row, mean in zip((row for row in rows if row["profile"] == profile), means, strict=True):
                row["common_deg"] = mean
        return {"rows": rows, "seconds": seconds, "picture": _picture(photographs), "code": code_fingerprint(ROOM)}


def failed_rows(cell: Cell, why: str) -> list[dict[str, Any]]:
    """Return the rows of a cell that has no results."""
    return [
        {**_key(cell, method, profile), "status": f"failed: {why}"}
        for method in cell.methods
        for profile in cell.profiles
    ]


def _key(cell: Cell, method: str, profile: str) -> dict[str, Any]:
    """Return what names a row."""
    word = cell.value if isinstance(cell.value, str) else f"{cell.value:g}"
    value = float(cell.level) if isinstance(cell.value, str) else float(cell.value)
    place = {"level": cell.level, "value": value, "label": word, "shape": cell.recipe.shape, "seed": cell.recipe.seed}
    return {"experiment": cell.experiment, **place, "solver": method, "profile": profile}


def _row(
    cell: Cell, photographs: Any, method: str, profile: str, executor: Executor
) -> tuple[dict[str, Any], float | None, NDArray | None]:
    """Return the row of one method with one profile, its processor seconds, and its normals (H, W, 3)."""
    p, key = photographs, _key(cell, method, profile)
    if cell.experiment in PERTURBATIONS and not is_told(method, cell.experiment):
        return {**key, "status": "not told"}, None, None
    _load(p, method, profile, executor)
    start = time.process_time()
    try:
        if cell.experiment in PERTURBATIONS:
            strength, estimate = breaking_point(p, cell, method, profile, executor)
            extra = {"breaks_at": strength}
        else:
            estimate = solve(method, p.frames, p.lights, p.camera, p.mask, profile=profile, executor=executor)
            extra = {}
    except SceneError as error:
        return {**key, "status": f"no answer: {_why(error)}", "filled_deg": GAP_DEG}, None, None
    except Exception as error:
        return {**key, "status": f"failed: {_why(error)}"}, None, None
    taken = time.process_time() - start
    if estimate is None:
        return {**key, "status": "ok", **extra}, taken, None
    return {**key, **measured(p, method, estimate), **extra}, taken, estimate.normals


def _errors(photographs: Any, normals: NDArray | None) -> NDArray:
    """Return the angular errors (P,) of normals (H, W, 3) on the object, NaN where there is none."""
    from scene.normals import angular_error_deg

    p = photographs
    return np.full(p.mask.sum(), np.nan) if normals is None else angular_error_deg(normals[p.mask], p.normals[p.mask])


def common_means(errors: NDArray[np.float64]) -> list[float | None]:
    """Return each method's mean of errors (M, P) over the pixels that all answer; None of one that answers none.

    A method that leaves out what is hard is compared there with the others on what it keeps.
    """
    known = np.isfinite(errors)
    common = known[known.any(1)].all(0)
    if not common.any():
        return [None] * len(errors)
    return [float(row[common].mean()) if np.isfinite(row).any() else None for row in errors]


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


def measured(photographs: Any, method: str, estimate: Any) -> dict[str, Any]:
    """Return an estimate's columns of the table, by the truth.

    status: "ok"; "no answer: why", where a method refused or gave no normal; "failed: why", a fault of ours, which says
    nothing of the method. albedo_error_percent: mean of |found - true| / true over pixels and channels. A method that
    is not told the lights finds albedo up to a factor: the one that makes the median right is put in.
    """
    p = photographs
    ratio = estimate.albedo[p.mask].astype(np.float64) / p.albedo[p.mask].astype(np.float64)
    known = ratio[np.isfinite(ratio)]
    if method in UNCALIBRATED and known.size and np.median(known) > 0:
        known = known / np.median(known)
    return {
        **errors_of(estimate.normals[p.mask], p.normals[p.mask], "no answer"),
        **error_kinds(estimate.normals[p.mask], p.normals[p.mask]),
        "albedo_error_percent": 100 * float(np.mean(np.abs(known - 1))) if known.size else None,
        "frames": len(p.frames),
        "doubts": " ".join(estimate.warnings),
    }


def _why(error: Exception) -> str:
    """Return an error in one line: an input's as it is told, others with their kind."""
    text = " ".join(str(error).split())
    return text if isinstance(error, SceneError) else f"{type(error).__name__}: {text}"


def _picture(photographs: Any) -> str:
    """Return a frame lit from the side rather than from the front, small and with gamma, as the data URI of a PNG."""
    frames, mask = photographs.frames, photographs.mask
    sums = [int(frames.codes[i][mask].sum(dtype=np.int64)) for i in range(len(frames))]
    small = shrink(np.clip(frames.frame(int(np.argsort(sums)[len(sums) // 3])), 0, 1), PICTURE_SIDE)
    return data_uri(np.round(255 * small ** (1 / 2.2)).astype(np.uint8), photograph=False)
