"""`rgbn process PARENT`: all sessions below a folder, each in a process of its own, and one page that lists them."""

import json
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path
from typing import Any

from lab.options import Settings
from lab.session_place import is_session
from scene.errors import SceneError

PAGE, TABLE = "index.html", "sessions.csv"
PICTURE_PX = 160
COLUMNS = {
    "session": "{name}", "normals": "{level}", "method": "{method}", "median error, deg": "{median_deg:.2f}",
    "warnings": "{warnings:d}", "seconds": "{seconds:.0f}",
}  # fmt: skip
"""Of the table on the terminal."""


def sessions_below(parent: Path) -> list[Path]:
    """Return the folders of the sessions below a folder that is none itself, in their names' order.

    Nothing where there is but one: then the folder above it was given by mistake, and a message says so.
    """
    if not parent.is_dir() or is_session(parent):
        return []
    # A twin is a session, too: it lies in an output folder, which has a record.
    folders = sorted(
        path for path in parent.rglob("*") if path.is_dir() and not any(part.startswith(".") for part in path.parts)
    )
    found: list[Path] = []
    for folder in folders:
        inside = any((place / ".rgbn").is_dir() for place in (folder, *folder.parents) if place.is_relative_to(parent))
        if is_session(folder) and not inside and not any(folder.is_relative_to(one) for one in found):
            found.append(folder)
    return found if len(found) > 1 else []


def process_all(
    parent: Path,
    sessions: Sequence[Path],
    out: Path | None,
    said: Settings,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    as_json: bool = False,
) -> None:
    """Take sessions the whole way, and list them in OUT/index.html and OUT/sessions.csv.

    Parameters
    ----------
    parent : Path
        The folder above the sessions.
    sessions : sequence of Path
    out : Path or None
        Gets a folder for each session, of its own name below the parent. None: out/NAME, by the parent's name.
    said : Settings
        As in `lab.run.open_job`, of every session.
    jobs : int
        Sessions at a time.
    scheduler : str or None
        Address of a Dask scheduler.
    as_json : bool
        Print the rows of sessions.csv as JSON.

    Raises
    ------
    SceneError
        After all others are done: some could not be processed.
    """
    from lab.progress import progress_bar, say
    from scene.files import write_text
    from scene.notebook import csv_text
    from scene.origin import Origin
    from scene.output_folder import open_record

    place = parent.resolve()
    with open_record(
        out or Path("out") / place.name, origin=Origin("sessions", place), input_folders=sessions
    ) as record:
        names = ["-".join(session.relative_to(parent).parts) for session in sessions]
        faults: dict[str, str] = {}

        def one(name: str, session: Path) -> None:
            faults[name] = _in_its_own_process(session, record.folder / name, said, scheduler)
            say(f"{name}: {faults[name] or 'done'}")
            tell(len(faults), len(sessions))

        with progress_bar("sessions") as tell, ThreadPoolExecutor(jobs) as pool:
            for _ in pool.map(one, names, sessions):
                pass
        rows = [_row(record.folder, name, faults[name]) for name in names]
        write_text(record.folder / TABLE, csv_text(rows))
        write_text(record.folder / PAGE, _page(record.folder, place.name, rows))
    lost = [f"{name} ({fault})" for name, fault in faults.items() if fault]
    _tell(record.folder, rows, as_json=as_json)
    if lost:
        raise SceneError(
            f"{parent}: {len(lost)} of {len(sessions)} sessions could not be processed: {'; '.join(lost)} "
            "Mend them and give the same command again: what is done is not done again."
        )


def _in_its_own_process(session: Path, out: Path, said: Settings, scheduler: str | None) -> str:
    """Process a session; return why it ended badly. No crash of one reaches another."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(there, session, out, said, scheduler))
    process.start()
    there.close()
    try:
        with here:
            fault = str(here.recv())
    except EOFError:
        process.join()
        fault = f"its process ended with code {process.exitcode}; {out / 'rgbn.log'} tells how far it came."
    finally:
        if process.is_alive():
            process.join()
    return fault


def _work(told: Any, session: Path, out: Path, said: Settings, scheduler: str | None) -> None:
    from lab.progress import keep_quiet
    from lab.run import run_session

    keep_quiet(True)
    try:
        run_session(session, "compare", out=out, said=said, scheduler=scheduler)
        told.send("")
    except SceneError as error:
        told.send(str(error))
    except Exception as error:
        told.send(f"a fault of rgbn's own, {type(error).__name__}: {error}; please report it.")


def _row(folder: Path, name: str, fault: str) -> dict[str, Any]:
    """Return a session's row: the verdict on its normals, and what it is by."""
    from compare.report.facts import all_warnings, read_optional
    from compare.report.verdict import ranking, verdict
    from scene.store import Store

    summary = read_optional(Store(folder / name), "summary.json") or {}
    best = next(iter(ranking(summary)), {})
    method = (summary.get("trust") or {}).get("recommended") if best.get("median_deg") is None else best.get("name")
    statement = verdict(summary)[0]
    return {
        "name": name,
        "level": "not processed" if fault else statement.level,
        "verdict": "" if fault else statement.text,
        "method": method or "",
        "median_deg": best.get("median_deg"),
        "warnings": len(all_warnings(summary)),
        "seconds": sum((summary.get("seconds") or {}).values()),
        "fault": fault,
    }


def _page(folder: Path, title: str, rows: Sequence[dict[str, Any]]) -> str:
    from compare.report.page import LEVELS, badge, section, table, whole_page

    lines = []
    for row in rows:
        name, link = escape(row["name"]), escape(f"{row['name']}/report.html")
        said = badge("bad", row["level"]) if row["fault"] else badge(row["level"])
        words = escape(row["fault"] or row["verdict"])
        head = name if row["fault"] else f'<a href="{link}">{name}</a>'
        lines.append((head, _picture(folder, row), f"{said} {words}", str(row["warnings"])))
    count = {level: sum(row["level"] == level for row in rows) for level in LEVELS}
    told = ", ".join(f"{number} {LEVELS[level]}" for level, number in count.items() if number)
    lost = sum(bool(row["fault"]) for row in rows)
    said = f"{len(rows)} sessions: {told}{f', {lost} not processed' if lost else ''}"
    body = table(("session", "normals", "verdict", "warnings"), lines)
    return whole_page(title, "sessions", said, {"Sessions": section("sessions", "Sessions", body)})


def _picture(folder: Path, row: dict[str, Any]) -> str:
    from scene.map_pictures import data_uri, normal_picture
    from scene.store import Store

    store = Store(folder / row["name"])
    if row["fault"] or not row["method"] or not store.path("normals", f"{row['method']}.npy").exists():
        return ""
    rows, columns = (slice(int(at.min()), int(at.max()) + 1) for at in store.load_mask().nonzero())
    picture = normal_picture(store.load_normals(row["method"])[rows, columns], PICTURE_PX)
    alt = escape(f"normals of {row['name']} by {row['method']}")
    return f'<img src="{data_uri(picture, photograph=False)}" alt="{alt}" width="{picture.shape[1]}">'


def _tell(folder: Path, rows: Sequence[dict[str, Any]], *, as_json: bool) -> None:
    from rich.console import Console

    from lab.progress import is_quiet, say
    from lab.terminal_tables import number_table

    if as_json:
        print(json.dumps(rows, indent=1))
    elif not is_quiet():
        Console(highlight=False).print(number_table("sessions", COLUMNS, rows))
    say(f"written: {folder / PAGE}, {folder / TABLE}")
