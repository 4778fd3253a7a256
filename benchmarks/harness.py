"""What every benchmark is: cases are measured, rows are kept as CSV, and a table of docs/evidence is written from them.

A benchmark's file lists its `TABLES`. `python -m benchmarks` runs them, see `benchmarks/__main__.py`.
"""

import contextlib
import csv
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from types import UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from benchmarks.measured_code import code_of, files_of
from scene.clock import now, since
from scene.current import fingerprint

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT / ".." / "shared"
"""Photographs, scans and sessions that others made; they are handed out beside the project."""
EVIDENCE = ROOT / "docs" / "evidence"
MEASURED = EVIDENCE / "measured.json"
"""Of each table: the commit and the fingerprint of the code that it was measured on, the scale, and its figures."""
KEPT = ROOT / "out" / "benchmarks"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Scale = Literal["small", "gates", "full"]
"""The smallest case, to see that a benchmark runs; what half an hour for all of them allows; what the page shows."""
Figures = dict[str, float]


def _no_figures(rows: Sequence[Any]) -> Figures:
    return {}


@dataclass(frozen=True)
class Table:
    """One table of a page.

    Parameters
    ----------
    page, name : str
        docs/evidence/PAGE.md, and the marks there between which it stands.
    measures : tuple of str
        Modules whose code it measures, with all that they import.
    row : type
        A frozen dataclass of plain values, units in the fields' names.
    cases : callable
        Takes a `Scale`; returns what `measure` is given, a tuple of plain values a case.
    measure : callable
        Takes a case; returns its rows. On a module's top level, for it runs in a process of its own.
    show : callable
        Takes all rows; returns Markdown.
    figures : callable
        Takes all rows; returns what the gates and the README take from them, by name.
    draw : callable or None
        Takes all rows; returns the pictures beside the page, SVG by the file's name.
    needs : tuple of Path
        Folders outside of the project; where one is absent, nothing is measured.
    is_timed : bool
        It measures time: one case at a time, with all cores.
    is_steady : bool
        None of its figures is of time, though it measures time; the gates need no second round of it.
    """

    page: str
    name: str
    measures: tuple[str, ...]
    row: type
    cases: Callable[[Scale], Sequence[tuple]]
    measure: Callable[..., list[Any]]
    show: Callable[[list[Any]], str]
    figures: Callable[[list[Any]], Figures] = _no_figures
    draw: Callable[[list[Any]], dict[str, str]] | None = None
    needs: tuple[Path, ...] = ()
    is_timed: bool = False
    is_steady: bool = False

    @property
    def key(self) -> str:
        """Its name among all tables."""
        return f"{self.page}/{self.name}"

    @property
    def absent(self) -> list[Path]:
        """What it needs and is not there."""
        return [path for path in self.needs if not path.exists()]

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of the house whose code it measures."""
        return files_of(*self.measures)

    @property
    def code(self) -> str:
        """The fingerprint of these files."""
        return code_of(*self.measures)

    def data(self) -> Path:
        """Return where the rows of the page lie."""
        return EVIDENCE / "data" / f"{self.page}-{self.name.replace(' ', '-')}.csv"


MODULES = (
    "calibration", "probe", "real_captures", "sessions", "registration", "methods", "unknown_lights",
    "trust", "twin", "materials", "truth", "counterparts", "sweeps", "faults", "robustness", "memory",
)  # fmt: skip
"""Files of this folder that list `TABLES`, in the order in which they are measured."""


def tables() -> list[Table]:
    """Return all tables, page by page."""
    return [table for name in MODULES for table in import_module(f"benchmarks.{name}").TABLES]


def run(table: Table, scale: Scale, *, processes: int | None = None, is_new: bool = False) -> list[Any]:
    """Return a table's rows; cases that were measured before, with the same code, are read from out/benchmarks.

    processes: how many at a time, 0 for this one; default: one a core. is_new: all are measured again.
    """
    kept = KEPT / f"{table.page}-{table.name.replace(' ', '-')}.jsonl"
    mark = fingerprint(code_of(table.measure.__module__), table.code)
    known = {}
    if kept.is_file() and not is_new:
        lines = map(json.loads, kept.read_text().splitlines())
        known = {line["case"]: line["rows"] for line in lines if line["mark"] == mark}
    cases = list(table.cases(scale))
    missing = [case for case in cases if repr(case) not in known]
    kept.parent.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    for done, (case, rows) in enumerate(_measured(table, missing, processes), 1):
        known[repr(case)] = [asdict(row) for row in rows]
        with kept.open("a") as file:
            line = {"mark": mark, "case": repr(case), "rows": known[repr(case)]}
            file.write(json.dumps(line, default=lambda value: np.asarray(value).tolist()) + "\n")
        spent = time.perf_counter() - start
        print(f"{table.key}: {done} of {len(missing)}, {spent:.0f} s", file=sys.stderr, flush=True)
    return [_row(table, values) for case in cases for values in known[repr(case)]]


def _measured(table: Table, cases: Sequence[tuple], processes: int | None) -> Iterable[tuple[tuple, list[Any]]]:
    if table.is_timed or processes == 0:
        for case in cases:
            yield case, table.measure(*case)
        return
    os.environ |= dict.fromkeys(ONE_THREAD, "1")
    with ProcessPoolExecutor(processes or os.cpu_count(), get_context("spawn"), initializer=_in_one_thread) as pool:
        waiting = {pool.submit(table.measure, *case): case for case in cases}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def _in_one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)


def _row(table: Table, values: dict[str, Any]) -> Any:
    """Return a row of what JSON or CSV kept: lists are tuples."""
    return table.row(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


SAID: dict[Scale, str] = {
    "small": "with the smallest case alone", "gates": "in `make gates`", "full": "",
}  # fmt: skip
"""What a page says of the scale of its tables."""


def write(table: Table, rows: list[Any], scale: Scale) -> None:
    """Write a table's rows, its part of the page, its pictures, on which code it was measured, and at which scale."""
    table.data().parent.mkdir(exist_ok=True)
    with table.data().open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        names = [field.name for field in fields(table.row)]
        writer.writerow(names)
        writer.writerows([[_plain(getattr(row, name)) for name in names] for row in rows])
    measured = ", ".join(filter(None, (f"Measured at {commit()} on {os.cpu_count()} cores", SAID[scale])))
    put(EVIDENCE / f"{table.page}.md", table.name, f"{shown(table)}\n\n{measured}.\n")
    for name, picture in (table.draw(rows) if table.draw else {}).items():
        (EVIDENCE / name).write_text(picture)
    known = json.loads(MEASURED.read_text()) if MEASURED.is_file() else {}
    found = rounded(table.figures(rows))
    known[table.key] = {"commit": commit(), "code": table.code, "scale": scale, "figures": found}
    MEASURED.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")


def shown(table: Table) -> str | None:
    """Return a table as the rows beside its page say; None: they were measured when the row had other fields."""
    kinds = get_type_hints(table.row)
    with table.data().open(newline="") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames != list(kinds):
            return None
        rows = [table.row(**{name: _read(kinds[name], text) for name, text in line.items()}) for line in reader]
    return table.show(rows).rstrip()


def _read(kind: Any, text: str) -> Any:
    """Return a cell of a CSV file as a row has it; `_plain` wrote it."""
    if isinstance(kind, UnionType):
        first, *others = get_args(kind)
        try:
            return _read(first, text) if text else None
        except ValueError:
            if str not in others:
                raise
            return text
    if get_origin(kind) is tuple:
        return tuple(_read(get_args(kind)[0], one) for one in text.split("; ")) if text else ()
    return text == "True" if kind is bool else kind(text)


def rgbn(*words: Any) -> dict[str, Any]:
    """Return what a verb prints with --json, into an empty folder; stop with its message where it fails."""
    with tempfile.TemporaryDirectory() as out:
        command = [Path(sys.executable).with_name("rgbn"), *words, "--json", "--out", out]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{command}: {done.stderr}")
    return json.loads(done.stdout)


def ran(command: Sequence[Any], *, limit_gb: float = 0.0) -> tuple[float, float, float]:
    """Return wall seconds, processor seconds and GB of memory that a program needed; mapped files are not its own.

    limit_gb: beyond it the system refuses the program memory, reserved memory too; 0: no limit. Looked at every 20 ms.
    """
    words = [str(word) for word in command]
    if limit_gb:
        words = ["sh", "-c", f'ulimit -d {limit_gb * 1e9 / 1024:.0f}; exec "$@"', "sh", *words]
    most, start = 0.0, now()
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=ROOT) as program:
        while program.poll() is None:
            most = max(most, _own_gb(program.pid))
            time.sleep(0.02)
        said = program.stderr.read() if program.stderr else ""
    if program.returncode:
        raise SystemExit(f"{' '.join(words)}: {program.returncode}\n{said}")
    spent = since(start)
    return spent["seconds"], spent["processor_seconds"], most


def _own_gb(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/status").read_text().split("RssAnon:")[1].split()[0]) * 1024 / 1e9
    except (OSError, IndexError):
        # It is ending.
        return 0.0


@contextlib.contextmanager
def opened(session: Path, out: Path, solving: Any = None) -> Iterator[Any]:
    """Hold a session's output folder for a block, in silence; see `lab.run.open_job`."""
    from lab.options import BY_DEFAULT
    from lab.run import open_job

    with contextlib.redirect_stderr(io.StringIO()), open_job(session, out=out, said=solving or BY_DEFAULT) as job:
        yield job


def rounded(figures: Figures) -> Figures:
    """Return figures with six digits."""
    return {name: float(f"{value:.6g}") for name, value in figures.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return "; ".join(str(_plain(one)) for one in value)
    return f"{value:.6g}" if isinstance(value, float | np.floating) else value


def commit() -> str:
    """Return the commit that the code is of; -dirty where some code is changed."""

    def said(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()

    return said("rev-parse", "--short", "HEAD") + "-dirty" * bool(said("status", "--porcelain", "--", "*.py"))


def commits_since(first: str, files: Iterable[Path]) -> list[str] | None:
    """Return the commits after one that touched some files; None where git does not know it."""
    command = ["git", "log", "--format=%h", f"{first}..HEAD", "--", *map(str, files)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return None if done.returncode else done.stdout.split()


def put(page: Path, name: str, text: str) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->`; `text` ends with a line's end.

    Raises
    ------
    ValueError
        The page has no such marks, or more than one pair.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, rest = page.read_text().split(begin)
    _, after = rest.split(end)
    page.write_text(f"{before}{begin}{text}{end}{after}")


def markdown(columns: dict[str, str], rows: Iterable[Any]) -> str:
    """Return a Markdown table.

    Parameters
    ----------
    columns : dict of str
        By its head each column's form: "{apart_px:.2f}" with the fields of a row. A cell of which a field is None is
        empty.
    rows : iterable of dataclass or dict
    """
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for row in rows:
        values = row if isinstance(row, dict) else vars(row)
        lines.append(f"| {' | '.join(_cell(form, values) for form in columns.values())} |")
    return "\n".join(lines) + "\n"


def _cell(form: str, values: dict[str, Any]) -> str:
    try:
        return form.format(**values)
    except TypeError:
        # None has no digits.
        return ""


def folded(summary: str, inside: Iterable[str] | str) -> str:
    """Return a list, or a table, that the reader unfolds by a click on `summary`; empty for no items."""
    text = inside if isinstance(inside, str) else "\n".join(f"- {item}" for item in inside)
    return f"<details><summary>{summary}</summary>\n\n{text}\n\n</details>\n" if text else ""


def spread(values: Iterable[float | None], form: str = "{:.2f}") -> str:
    """Return median and 95th percentile of the known values; a dash without any."""
    known = np.array([value for value in values if value is not None and np.isfinite(value)])
    if not len(known):
        return "–"
    return " / ".join(form.format(np.quantile(known, q)) for q in (0.5, 0.95))
