"""`rgbn dataset run`: methods and other programs on datasets of the shelf; results are kept, and not made again."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.datasets.results import write_results
from experiments.datasets.shelf import Entry, contents_of, entries
from experiments.tables import Row, Rows
from lab.progress import say
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json
from scene.output_folder import open_record
from scene.reading import json_of


def run(
    shelf: Path,
    patterns: Sequence[str],
    *,
    method: str,
    profile: str = "default",
    external: tuple[list[str], float] = ([], 3600.0),
    out: Path,
) -> Rows:
    """Run methods on datasets, as far as their results are not there yet, write the tables, and return the rows.

    Parameters
    ----------
    shelf : Path
    patterns : sequence of str
        Names of datasets that are on the shelf; none: all of them.
    method, profile, external
        As `lab.run.open_job` has them.
    out : Path
        Gets results.parquet, results.txt, index.html; results/ keeps each result, work/ what programs said.

    Raises
    ------
    SceneError
        No such dataset, method or program; a dataset that has changed.
    """
    from lab.run import methods_of
    from solve.external import External

    programs = {one.name: one for one in (External.parse(text, external[1]) for text in external[0])}
    names = [*methods_of(method, profile), *programs]
    wanted, rows, code = _wanted(shelf, patterns), [], code_fingerprint(__name__)
    ours = {"method": method, "profile": profile, "external": external}
    with open_record(out) as record:
        for number, entry in enumerate(wanted, 1):
            digest, kept = contents_of(shelf, entry), {}
            for name in names:
                how = (programs[name].command, programs[name].files) if name in programs else profile
                kept[name] = out / "results" / f"{fingerprint(digest, name, how, code=code)[:24]}.json"
            made, missing = {}, [name for name in names if not record.is_intact(kept[name])]
            if missing:
                say(f"{number} of {len(wanted)}: {entry.name}: {', '.join(missing)}")
                for name, row in _solve(out, entry, missing, ours):
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


def _solve(out: Path, entry: Entry, names: list[str], how: dict[str, Any]) -> Iterator[tuple[str, Row]]:
    """Yield the rows of some methods on one dataset, each as soon as it is made; how: as `open_job` has it."""
    from lab.plan import STEPS
    from lab.run import open_job

    profile, left = how["profile"], list(names)
    try:
        with open_job(entry.folder, out=out / "work" / entry.name, **how) as job:
            try:
                job.run(STEPS, "align")
                while left:
                    one = replace(job, methods=(left[0],))
                    row = _row(left[0], "" if left[0] in job.externals else profile, one, entry.name)
                    yield left.pop(0), row
            finally:
                # The frames: half a gigabyte for a hundred datasets; made again in a second.
                job.record.forget(["check"])
    except SceneError as error:
        for name in left:
            yield name, _failed(name, profile, error)


def _row(name: str, profile: str, job: Any, dataset: str) -> Row:
    from compare.statistics.statistics import angular_statistics
    from lab.steps import solve_all
    from scene.normals import angular_error_deg

    store = job.store
    try:
        table, _ = solve_all(job, store, dataset)
    except SceneError as error:
        return _failed(name, profile, error)
    mask, truth = store.load_mask(), store.load_normals("truth")
    judged = mask & np.isfinite(truth[..., 0])
    error = angular_error_deg(store.load_normals(name), truth)[judged]
    numbers, facts = angular_statistics(error), table["methods"][name]
    return {
        "method": name,
        "profile": profile,
        "status": "ok" if numbers["pixels"] else "failed: no pixel has a normal",
        **numbers,
        "unanswered": 1 - int(numbers["pixels"]) / max(int(judged.sum()), 1),
        "seconds": facts["seconds"],
        "doubts": " ".join(facts["warnings"]),
    }


def _failed(name: str, profile: str, error: Exception) -> Row:
    return {"method": name, "profile": profile, "status": f"failed: {' '.join(str(error).split())}"}
