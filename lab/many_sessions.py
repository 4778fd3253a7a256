"""`rgbn process PARENT`: all sessions below a folder, each in a process of its own, and one page that lists them."""

import json
import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from compare.report.facts import all_warnings, best_method, read_optional
from compare.report.page import badge, section, table, whole_page
from compare.report.pictures import PixelBox
from compare.report.verdict import ranking, verdict
from lab.options import Place, Settings
from lab.progress import end_with_parent, keep_logs, keep_quiet, progress_bar, say
from lab.run import run_session
from lab.session_place import default_out, is_session
from lab.terminal_tables import number_table, show
from scene.errors import SceneError
from scene.files import write_text
from scene.map_pictures import data_uri, normal_picture
from scene.notebook import csv_text
from scene.origin import Origin
from scene.output_folder import open_record
from scene.record import PLACE
from scene.store import Store

PAGE, TABLE = "index.html", "sessions.csv"
PICTURE_PX = 160
"""Width of a session's, or a dataset's, picture in a list."""


def sessions_below(parent: Path) -> list[Path]:
    """Return the folders of the sessions below a folder that is none itself, in their names' order.

    Nothing where there is but one: then the folder above it was given by mistake, and a message says so.
    """
    if not parent.is_dir() or is_session(parent) or (parent / PLACE).is_dir():
        return []
    found: list[Path] = []
    for place, names, _ in os.walk(parent):
        # Folders that nobody may look into, as a disk's lost+found, hold none; a twin lies in an output folder.
        folders = [
            folder
            for folder in (Path(place, name) for name in names if not name.startswith("."))
            if os.access(folder, os.R_OK | os.X_OK) and not (folder / PLACE).is_dir()
        ]
        found += filter(is_session, folders)
        names[:] = (folder.name for folder in folders if not is_session(folder))
    return sorted(found) if len(found) > 1 else []


def process_all(
    parent: Path,
    sessions: Sequence[Path],
    place: Place,
    said: Settings,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    more: Callable[[Path], None] | None = None,
    own: Sequence[str] = (),
) -> None:
    """Take sessions the whole way, and list them in OUT/index.html and OUT/sessions.csv.

    Parameters
    ----------
    parent : Path
        The folder above the sessions.
    sessions : sequence of Path
    place : Place
        Gets a folder for each session, at its own place below the parent. Default: out/NAME, by the parent's name.
    said : Settings
        As in `lab.run.open_job`, of every session.
    jobs : int
        Sessions at a time.
    scheduler : str or None
        Address of a Dask scheduler.
    more : callable or None
        Takes the output folder after that, and writes the files `own` there.

    Raises
    ------
    SceneError
        After all others are done: some could not be processed.
    """
    name, origin = parent.resolve().name, Origin("sessions", parent.resolve())
    names = [session.relative_to(parent).as_posix() for session in sessions]
    if taken := {PAGE, TABLE, *own} & {name.partition("/")[0] for name in names}:
        raise SceneError(f"{parent / taken.pop()}: a file of the results has that name. Rename the folder.")
    with open_record(place.out or default_out(origin, name), origin=origin, input_folders=sessions) as record:
        faults: dict[str, str] = {}

        def one(name: str, session: Path) -> None:
            faults[name] = _in_its_own_process(session, record.folder / name, said, scheduler)
            say(f"{name}: {faults[name] or 'done'}")
            tell(len(faults), len(sessions))

        pool = ThreadPoolExecutor(jobs)
        try:
            with progress_bar("sessions") as tell:
                for _ in pool.map(one, names, sessions):
                    pass
        finally:
            # Where Ctrl-C ends this process, its children end with it.
            pool.shutdown(wait=False, cancel_futures=True)
        rows = [session_row(record.folder, name, faults[name]) for name in names]
        write_text(record.folder / TABLE, csv_text(rows))
        write_text(record.folder / PAGE, _page(record.folder, name, rows))
        if more:
            more(record.folder)
    lost = [f"{name} ({fault})" for name, fault in faults.items() if fault]
    show(number_table("sessions", "sessions", rows), hidden=place.json)
    if place.json:
        print(json.dumps(rows, indent=1))
    say(f"written: {record.folder / PAGE}, {record.folder / TABLE}")
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
        return here.recv()
    except EOFError:
        process.join()
        return f"its process ended with code {process.exitcode}; {out / PLACE / 'running.log'} tells how far it came."
    finally:
        process.join()


def _work(told: Any, session: Path, out: Path, said: Settings, scheduler: str | None) -> None:
    end_with_parent()
    keep_quiet(True)
    keep_logs()
    try:
        run_session(session, "compare", out=out, said=said, scheduler=scheduler)
        told.send("")
    except SceneError as error:
        told.send(str(error))
    except Exception as error:
        log = out / "rgbn.log"
        told.send(f"a fault of rgbn's own, {type(error).__name__}: {error}; please report it with the end of {log}.")


def session_row(folder: Path, name: str, fault: str) -> dict[str, Any]:
    """Return a session's row: the verdict on its normals, and what it is by; `fault`: why there is none."""
    # What lies there from before is not what was asked for now.
    summary = {} if fault else read_optional(Store(folder / name), "summary.json") or {}
    best = next(iter(ranking(summary)), {})
    statement = verdict(summary)[0]
    return {
        "name": name,
        "level": "not processed" if fault else statement.level,
        "badge": "not processed" if fault else statement.word,
        "verdict": "" if fault else statement.text,
        "method": best_method(summary) or "",
        "median_deg": best.get("median_deg"),
        "warnings": len(all_warnings(summary)),
        "seconds": sum((summary.get("seconds") or {}).values()),
        "fault": fault,
    }


def _page(folder: Path, title: str, rows: Sequence[dict[str, Any]]) -> str:
    lines = []
    for row in rows:
        name, link = escape(row["name"]), quote(f"{row['name']}/report.html")
        said = badge("bad" if row["fault"] else row["level"], row["badge"])
        words = escape(row["fault"] or row["verdict"])
        head = name if row["fault"] else f'<a href="{link}">{name}</a>'
        lines.append((head, row_picture(folder, row), f"{said} {words}", str(row["warnings"])))
    count = Counter(row["badge"] for row in rows)
    said = f"{len(rows)} sessions: {', '.join(f'{number} {words}' for words, number in count.most_common())}"
    body = table(("session", "normals", "verdict", "warnings"), lines)
    return whole_page(title, "sessions", said, section("sessions", "Sessions", body))


def row_picture(folder: Path, row: dict[str, Any]) -> str:
    """Return the normals of a session's row as HTML; nothing where there are none."""
    store = Store(folder / row["name"])
    if row["fault"] or not row["method"] or not store.path("normals", f"{row['method']}.npy").exists():
        return ""
    box = PixelBox.of_mask(store.load_mask(), margin=0)
    picture = normal_picture(box.of(store.load_normals(row["method"])), PICTURE_PX)
    alt = escape(f"normals of {row['name']} by {row['method']}")
    return f'<img src="{data_uri(picture, photograph=False)}" alt="{alt}" width="{picture.shape[1]}">'
