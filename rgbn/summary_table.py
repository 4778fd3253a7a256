"""The end of a run, for people at a terminal: what the verb found, where it wrote it, and what comes next."""

import json
import os
import shlex
from io import StringIO
from pathlib import Path
from typing import Any

from lab.job import Job
from lab.run_log import log
from lab.streams import is_quiet, say
from lab.terminal_tables import fact_table
from rgbn.step_tables import TABLES

LOG_COLUMNS = 110
OWN = {"solve": ("solve", "trust")}
"""Of a verb, the steps whose findings it shows, where these are more than its own."""
SOUGHT = ("report.html", "lights.json", "lights.csv", "spheres.json", "pose.json", "normals", "twin", "statistics.csv")
"""What people look for first in an output folder."""
NEXT = {
    "check": "rgbn calibrate {0}", "calibrate": "rgbn align {0}",
    "align": "rgbn solve {0}", "solve": "rgbn twin {0}", "twin": "rgbn compare {0}",
    "compare": "look at {0}/report.html; rgbn studio {0}",
}  # fmt: skip


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
    steps = list(TABLES) if whole else OWN.get(verb, (verb,))
    tables = [table for step in steps for table in TABLES[step](job, summary)]
    tables.append(fact_table("", _places(job, verb)))
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


def _places(job: Job, verb: str) -> dict[str, str]:
    """Return where the results are, by the shorter way from here, and what comes next."""
    folder, here = job.store.folder, Path(os.path.relpath(job.store.folder))
    near = folder if here.parts[:2] == ("..", "..") else here
    there = [name for name in SOUGHT if (folder / name).exists()]
    has_twin = verb != "solve" or (folder / "pose.json").exists()
    command = NEXT[verb if has_twin else "twin"].format(shlex.quote(str(near)))
    return {"written": f"{near}: {', '.join([*there, 'summary.json'])}", "next": command}
