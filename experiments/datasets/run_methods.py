"""`rgbn dataset run`: methods and other programs on datasets of the shelf, in one table; results are kept."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from experiments.datasets.shelf import Entry, contents_of, entries
from experiments.tables import DATASETS, Row, Rows, errors_of, write_table
from lab.options import BY_DEFAULT, Solving
from lab.progress import say
from lab.run_log import logged
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json, write_text
from scene.output_folder import open_record
from scene.reading import json_of

FAILED = "failed"


def run(
    shelf: Path,
    patterns: Sequence[str],
    *,
    solving: Solving = BY_DEFAULT,
    out: Path,
) -> Rows:
    """Run methods on datasets, as far as their results are not there yet, write the tables, and return the rows.

    patterns: names of datasets that are on the shelf; none: all of them. out gets results.parquet, results.txt,
    index.html; results/ keeps each result, work/ what programs said. SceneError: no such dataset, method or program; a
    dataset that has changed.
    """
    programs = solving.programs()
    names = [*solving.methods(), *programs]
    wanted, rows, code = _wanted(shelf, patterns), [], code_fingerprint(__name__)
    with open_record(out) as record, logged(record):
        for number, entry in enumerate(wanted, 1):
            digest, kept = contents_of(shelf, entry), {}
            for name in names:
                how = (programs[name].command, programs[name].files) if name in programs else solving.profile
                kept[name] = out / "results" / f"{fingerprint(digest, name, how, code=code)[:24]}.json"
            made, missing = {}, [name for name in names if not record.is_intact(kept[name])]
            if missing:
                say(f"{number} of {len(wanted)}: {entry.name}: {', '.join(missing)}")
                for name, row in _solve(out, entry, missing, solving):
                    made[name] = row
                    if row["status"] == "ok":
                        write_json(kept[name], row)
            for name in names:
                rows.append({"dataset": entry.name, "family": entry.family, **(made.get(name) or json_of(kept[name]))})
        write_results(out, rows)
    return rows


def _wanted(shelf: Path, patterns: Sequence[str]) -> list[Entry]:
    from experiments.catalogue import chosen

    known = entries(shelf)
    there = [one for one in known if one.state]
    if not there:
        raise SceneError(
            f"{shelf}: there is no dataset yet. Make some (`rgbn dataset make 'pear-*'`), or add your own."
        )
    if patterns:
        fitting = set(chosen(patterns, [one.name for one in known]))
        idle = [one.name for one in known if one.name in fitting and not one.state]
        if idle and not any(one.name in fitting for one in there):
            raise SceneError(
                f"dataset {idle[0]}: is in the catalogue, but not made yet. Make it: rgbn dataset make {patterns[0]!r}."
            )
        there = [one for one in there if one.name in fitting]
    return there


def _solve(out: Path, entry: Entry, names: list[str], solving: Solving) -> Iterator[tuple[str, Row]]:
    """Yield the rows of some methods on one dataset, each as soon as it is made."""
    from lab.plan import STEPS
    from lab.run import open_job

    left = list(names)
    try:
        with open_job(entry.folder, out=out / "work" / entry.name, solving=solving) as job:
            try:
                job.run(STEPS, "align")
                while left:
                    one = replace(job, asked=(left[0],))
                    row = _row(left[0], "" if left[0] in job.externals else solving.profile, one, entry.name)
                    yield left.pop(0), row
            finally:
                # The frames: half a gigabyte for a hundred datasets; made again in a second.
                job.record.forget(["check"])
    except SceneError as error:
        for name in left:
            yield name, _failed(name, solving.profile, error)


def _row(name: str, profile: str, job: Any, dataset: str) -> Row:
    from lab.steps import solve_all

    store = job.store
    try:
        table, _ = solve_all(job, store, dataset)
    except SceneError as error:
        return _failed(name, profile, error)
    mask, truth, facts = store.load_mask(), store.load_normals("truth"), table["methods"][name]
    judged = mask & np.isfinite(truth[..., 0])
    errors = errors_of(store.load_normals(name)[judged], truth[judged], "failed")
    more = {"seconds": facts["seconds"], "doubts": " ".join(facts["warnings"])}
    return {"method": name, "profile": profile, **errors, **more}


def _failed(name: str, profile: str, error: Exception) -> Row:
    return {"method": name, "profile": profile, "status": f"failed: {' '.join(str(error).split())}"}


def write_results(folder: Path, rows: Rows) -> None:
    """Write results.parquet, results.txt and index.html."""
    write_table(folder / "results.parquet", rows, DATASETS)
    write_text(folder / "results.txt", results_text(rows))
    write_text(folder / "index.html", _page(rows))


def grid(rows: Rows, quantity: str = "mean_deg") -> tuple[list[str], list[tuple[str, list[float | None]]]]:
    """Return the methods, and for each dataset its values in their order, None where one failed; last, their means.

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
        cells = (FAILED if value is None else f"{value:.2f}" for value in values)
        text.append(f"{name:{wide}}" + "".join(f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True)))
    text += [f"{row['dataset']}, {row['method']}: {row['status']}" for row in rows if row["status"] != "ok"]
    return "\n".join(text) + "\n"


def _page(rows: Rows) -> str:
    from compare.report.page import number, table
    from experiments.sweeps.sweep_page import STYLE

    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>Datasets</title>",
        f"<style>{STYLE} .best{{font-weight:bold}}</style><h1>Methods on datasets</h1>",
    ]
    for quantity, title in (
        ("mean_deg", "Mean angular error, degrees"),
        ("median_deg", "Median angular error, degrees"),
    ):
        methods, lines = grid(rows, quantity)
        body = []
        for name, values in lines:
            least = min((value for value in values if value is not None), default=None)
            cells = [
                FAILED if value is None else f"<span class='{'best' if value == least else ''}'>{number(value)}</span>"
                for value in values
            ]
            body.append([escape(name), *cells])
        parts.append(f"<h2>{title}</h2>{table(['dataset', *map(escape, methods)], body)}")
    failures = [row for row in rows if row["status"] != "ok"]
    if failures:
        lines = "".join(
            f"<li>{escape(row['dataset'])}, {escape(row['method'])}: {escape(row['status'])}</li>" for row in failures
        )
        parts.append(f"<h2>What failed</h2><ul>{lines}</ul>")
    parts.append("<p>Bold: the least of a row. More figures, and each method's doubts: results.parquet.</p></html>")
    return "\n".join(parts)
