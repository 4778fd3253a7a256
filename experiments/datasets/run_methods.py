"""`rgbn dataset run`: methods and other programs on datasets of the shelf; results are kept."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.datasets.shelf import Entry, contents_of, entries, select
from experiments.tables import DATASETS, Row, Rows, errors_of, has_failed, write_table
from lab.options import BY_DEFAULT, DEFAULT_PROFILE, Solving
from lab.progress import say
from lab.run_log import logged
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json, write_png, write_text
from scene.output_folder import open_record
from scene.reading import json_of

FAILED = "failed"
NO_ERROR = 65535
"""In the kept error maps, which count in hundredths of a degree: no truth, or no answer."""


def run(shelf: Path, patterns: Sequence[str], *, solving: Solving = BY_DEFAULT, out: Path) -> Rows:
    """Run methods on datasets, as far as their results are not there yet, write the tables, and return the rows.

    patterns: names of datasets that are on the shelf, patterns, `benchmark`; none: all of them. out gets
    results.parquet and results.txt; results/ keeps each result and its error map (16-bit PNG, see `NO_ERROR`), work/
    what programs said. A row's `map` is the path of its error map. SceneError: no such dataset, method or program; a
    dataset that has changed.
    """
    solving = replace(solving, profile=solving.profile or DEFAULT_PROFILE)
    programs = solving.programs()
    names = [*solving.methods(), *programs]
    there, rows, code = _wanted(shelf, patterns), [], code_fingerprint("experiments")
    with open_record(out, origin="table of datasets") as record, logged(record):
        for number, entry in enumerate(there, 1):
            digest, kept = contents_of(shelf, entry), {}
            for name in names:
                how = (programs[name].command, programs[name].files) if name in programs else solving.profile
                kept[name] = out / "results" / f"{fingerprint(digest, name, how, code=code)[:24]}.json"
            made, missing = {}, [
                name for name, path in kept.items()
                if not (record.is_intact(path) and record.is_intact(path.with_suffix(".png")))
            ]  # fmt: skip
            if missing:
                say(f"{number} of {len(there)}: {entry.name}: {', '.join(missing)}")
                for name, row in _solve(out, entry, missing, solving):
                    error, made[name] = row.pop("error", None), row
                    if error is not None:
                        write_png(kept[name].with_suffix(".png"), error)
                        write_json(kept[name], row)
            for name in kept:
                row = made.get(name) or json_of(kept[name])
                if row["status"] == "ok":
                    row = {**row, "map": kept[name].with_suffix(".png")}
                rows.append({"dataset": entry.name, "family": entry.family, **row})
        write_table(out / "results.parquet", rows, DATASETS)
        write_text(out / "results.txt", results_text(rows))
    return rows


def _wanted(shelf: Path, patterns: Sequence[str]) -> list[Entry]:
    known = entries(shelf)
    if not any(one.state for one in known):
        raise SceneError(
            f"{shelf}: there is no dataset yet. Make some (`rgbn dataset make 'pear-*'`), or add your own."
        )
    fitting = select(known, patterns) if patterns else [one for one in known if not one.same_as]
    there = [one for one in fitting if one.state]
    if not there:
        raise SceneError(
            f"dataset {fitting[0].name}: is in the catalogue, but not made yet. Make it: "
            f"rgbn dataset make {patterns[0]!r}."
        )
    return there


def _solve(out: Path, entry: Entry, names: list[str], solving: Solving) -> Iterator[tuple[str, Row]]:
    """Yield the rows of some methods on one dataset, each as soon as it is made."""
    from lab.plan import STEPS
    from lab.run import open_job

    left = list(names)
    try:
        with open_job(entry.folder, out=out / "work" / entry.name, said=solving) as job:
            try:
                job.run(STEPS, "align")
                while left:
                    row = _row(left[0], "" if left[0] in job.externals else job.profile, job, entry.name)
                    yield left.pop(0), row
            finally:
                # The frames are half a gigabyte for a hundred datasets; they are made again in a second.
                job.record.forget(job.record.done)
    except SceneError as error:
        for name in left:
            yield name, _failed(name, solving.profile, error)


def _row(name: str, profile: str, job: Any, dataset: str) -> Row:
    from lab.steps import solve_all

    store = job.store
    try:
        table, _ = solve_all(job, store, dataset, (name,))
    except SceneError as error:
        return _failed(name, profile, error)
    facts = table["methods"][name]
    judged = _judged(store.load_normals(name), store.load_normals("truth"), store.load_mask())
    more = {"seconds": facts["seconds"], "doubts": " ".join(facts["warnings"])}
    return {"method": name, "profile": profile, **judged, **more}


def _judged(normals: NDArray, truth: NDArray, mask: NDArray[np.bool_]) -> Row:
    """Return the statistics of normals (H, W, 3) under a truth, and `error`, the map to keep."""
    from scene.normals import angular_error_deg

    judged = mask & np.isfinite(truth[..., 0])
    row = errors_of(normals[judged], truth[judged], FAILED)
    if row["status"] != "ok":
        return row
    error = angular_error_deg(np.where(judged[..., None], normals, np.nan), truth)
    codes = np.where(np.isfinite(error), np.round(100 * np.nan_to_num(error)), NO_ERROR).astype(np.uint16)
    return {**row, "error": codes}


def _failed(name: str, profile: str | None, error: Exception) -> Row:
    return {"method": name, "profile": profile, "status": f"failed: {' '.join(str(error).split())}"}


def grid(rows: Rows, quantity: str = "mean_deg") -> tuple[list[str], list[tuple[str, list[float | None]]]]:
    """Return the methods, and for each dataset its values in their order, None where one has none; last, their means.

    A mean is over the datasets that every method solved: else a method gained by failing on what is hard.
    """
    methods = list(dict.fromkeys(row["method"] for row in rows))
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row["dataset"], {})
        if row["status"] == "ok":
            found[row["dataset"]][row["method"]] = row[quantity]
    lines = [(name, [values.get(method) for method in methods]) for name, values in found.items()]
    whole = [[value for value in values if value is not None] for _, values in lines if None not in values]
    if len(lines) > 1 and whole:
        means: list[float | None] = [sum(column) / len(whole) for column in zip(*whole, strict=True)]
        lines.append((f"mean of {len(whole)}", means))
    return methods, lines


def results_text(rows: Rows) -> str:
    """Return the mean angular errors, degrees, as lines for a terminal."""
    methods, lines = grid(rows)
    title = "mean angular error, degrees"
    wide = max(len(title), *(len(name) for name, _ in lines))
    widths = [max(len(method), 7) for method in methods]
    head = "".join(f"  {method:>{width}}" for method, width in zip(methods, widths, strict=True))
    text = [f"{title:{wide}}{head}"]
    for name, values in lines:
        cells = [FAILED if value is None else f"{value:.2f}" for value in values]
        text.append(f"{name:{wide}}" + "".join(f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True)))
    text += [f"{row['dataset']}, {row['method']}: {row['status']}" for row in rows if has_failed(row)]
    return "\n".join(text) + "\n"
