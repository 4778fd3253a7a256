"""`rgbn dataset run`: methods and other programs on datasets of the shelf; results are kept, and not made again."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.datasets.results import write_results
from experiments.datasets.shelf import Entry, contents_of, entries
from lab.options import BY_DEFAULT, Solving
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
    solving: Solving = BY_DEFAULT,
    out: Path,
) -> list[dict[str, Any]]:
    """Run methods on datasets, as far as their results are not there yet, and write the tables.

    Parameters
    ----------
    shelf : Path
    patterns : sequence of str
        Names of datasets that are on the shelf; none: all of them.
    solving : Solving
        Which methods, and how.
    out : Path
        Gets results.parquet, results.txt, index.html; results/ keeps each result, work/ what programs said.

    Returns
    -------
    rows : list of dict
        Of results.parquet.

    Raises
    ------
    SceneError
        No such dataset, method or program; a dataset that has changed.
    """
    programs = solving.programs()
    names = [*solving.methods(), *programs]
    wanted = _wanted(shelf, patterns)
    rows = []
    with open_record(out) as record:
        for number, entry in enumerate(wanted, 1):
            digest = contents_of(shelf, entry)
            keys = {name: _key(digest, name, solving.profile, programs) for name in names}
            missing = [name for name in names if not record.is_intact(_place(out, keys[name]))]
            made = {}
            if missing:
                say(f"{number} of {len(wanted)}: {entry.name}: {', '.join(missing)}")
                for name, row in _solve(out, entry, missing, solving):
                    made[name] = row
                    if row["status"] == "ok":
                        write_json(_place(out, keys[name]), row)
            for name in names:
                row = made.get(name) or json_of(_place(out, keys[name]))
                rows.append({"dataset": entry.name, "family": entry.family, **row})
        write_results(out, rows)
    return rows


def _wanted(shelf: Path, patterns: Sequence[str]) -> list[Entry]:
    from experiments.datasets.catalogue import chosen

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


def _key(digest: str, name: str, profile: str, programs: dict[str, Any]) -> str:
    program = programs.get(name)
    how = profile if program is None else (program.command, program.files)
    return fingerprint(digest, name, how, code=code_fingerprint(__name__))[:24]


def _place(out: Path, key: str) -> Path:
    return out / "results" / f"{key}.json"


def _solve(out: Path, entry: Entry, names: list[str], solving: Solving) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of some methods on one dataset, each as soon as it is made."""
    from lab.plan import STEPS
    from lab.run import open_job
    from lab.steps import solve_all

    folder = out / "work" / entry.name
    left = list(names)
    try:
        with open_job(entry.folder, out=folder, solving=solving) as job:
            try:
                job.run(STEPS, "align")
                while left:
                    one: Callable = lambda name=left[0]: solve_all(replace(job, methods=(name,)), job.store, entry.name)  # noqa: E731
                    row = _row(left[0], solving.profile if left[0] not in job.externals else "", job.store, one)
                    yield left.pop(0), row
            finally:
                # The frames: half a gigabyte for a hundred datasets; made again in a second.
                job.record.forget(["check"])
    except SceneError as error:
        for name in left:
            yield name, _failed(name, solving.profile, error)


def _row(name: str, profile: str, store: Any, work: Callable) -> dict[str, Any]:
    from compare.statistics.statistics import angular_statistics
    from scene.normals import angular_error_deg

    try:
        table, _ = work()
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


def _failed(name: str, profile: str, error: Exception) -> dict[str, Any]:
    return {"method": name, "profile": profile, "status": f"failed: {' '.join(str(error).split())}"}
