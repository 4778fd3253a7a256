"""The end of a run, for people at a terminal: what the verb found, where it wrote it, and what comes next."""

import json
import os
import shlex
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from lab.job import Job
from lab.run_log import log
from lab.streams import is_quiet, say
from rgbn.step_tables import TABLES
from rgbn.text_tables import fact_table

LOG_COLUMNS = 110
OWN = {
    "check": ("check",),
    "calibrate": ("calibrate",),
    "align": ("align",),
    "solve": ("solve", "trust"),
    "twin": ("twin",),
    "compare": ("compare",),
}
"""Of each verb, the steps whose findings it shows."""
SOUGHT = (
    "report.html", "lights.json", "lights.csv", "spheres.json", "pose.json", "normals/", "albedo/", "twin/",
    "statistics.csv", "summary.json", "camera.json", "mask.png",
)  # fmt: skip
"""What people look for first."""
TABLED = {"calibrate": ["lights.csv"], "align": ["lights.json", "lights.csv"], "compare": ["statistics.csv"]}
"""What a step's verb writes beside the step's own files."""
NEXT = {"check": "calibrate", "calibrate": "align", "align": "solve", "twin": "compare"}


def tell(job: Job, summary: dict[str, Any], *, verb: str, as_json: bool = False, whole: bool = False) -> None:
    """Print what a verb found, as tables or the whole summary as JSON.

    Parameters
    ----------
    job : Job
        Its output folder is read.
    summary : dict
        summary.json.
    verb : str
        The step that was asked for.
    as_json : bool
    whole : bool
        Show what every step found, not the verb's own alone.
    """
    steps = list(TABLES) if whole else OWN[verb]
    tables = [table for step in steps for table in TABLES[step](job, summary)]
    tables.append(fact_table("", _places(job, verb, steps)))
    _print(tables, StringIO(), LOG_COLUMNS)
    if as_json:
        print(json.dumps(summary, indent=1))
        return
    if not is_quiet():
        _print(tables)
    before = {*_before(verb), *steps}
    for warning in summary["warnings"]:
        if warning["step"] in before:
            say(f"warning ({warning['step']}): {warning['text']}", always=True)


def _print(tables: list[Any], stream: StringIO | None = None, columns: int | None = None) -> None:
    """Print on standard output; with a stream, into the run's log."""
    from rich.console import Console

    # Numbers in texts are no more important than the words.
    console = Console(file=stream, width=columns, highlight=False)
    for table in tables:
        console.print(table)
        console.print()
    if stream:
        log(stream.getvalue())


def _before(verb: str) -> set[str]:
    """Return a step and all that it needs."""
    from lab.plan import STEPS

    return {verb}.union(*(_before(need) for need in STEPS[verb].needs))


def _places(job: Job, verb: str, steps: Sequence[str]) -> list[tuple[str, str]]:
    folder = _near(job.store.folder)
    last = [*steps, "report"] if verb == "compare" else steps
    names = [_top(path, job.store.folder) for step in last for path in job.record.files_of(step)]
    names += [
        "summary.json",
        *(name for step in last for name in TABLED.get(step, ()) if job.store.path(name).exists()),
    ]
    first = {name: place for place, name in enumerate(SOUGHT)}
    names = sorted(dict.fromkeys(names), key=lambda name: first.get(name, len(first)))
    shown = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    return [("written", f"{folder}: {shown}"), ("next", _next(job, verb, shlex.quote(str(folder))))]


def _next(job: Job, verb: str, folder: str) -> str:
    if verb == "compare":
        return f"look at {folder}/report.html; rgbn studio {folder}"
    if verb == "solve":
        return f"rgbn {'twin' if job.store.path('pose.json').exists() else 'compare'} {folder}"
    return f"rgbn {NEXT[verb]} {folder}"


def _top(path: Path, folder: Path) -> str:
    """Return a file's name, or that of the folder below the output folder that it lies in."""
    first, *rest = path.relative_to(folder).parts
    return f"{first}/" if rest else first


def _near(folder: Path) -> Path:
    """Return a folder as it is called from here, where that is shorter."""
    here = Path(os.path.relpath(folder))
    return folder if here.parts[:2] == ("..", "..") else here
