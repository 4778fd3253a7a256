"""A verb on a session: its output folder opened and locked, the steps run, the summary written."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from capture.photographs.kept import kept_folder
from capture.session.session import load_session
from lab.cluster import executor_of
from lab.job import Job
from lab.options import AS_BEFORE, Settings, Solving
from lab.plan import REPORTED, STEPS
from lab.progress import say
from lab.run_log import logged
from lab.session_place import MANIFEST, is_output, note_session, origin_of, session_and_out, session_of
from lab.summary import write_summary
from scene.current import fingerprint
from scene.output_folder import open_record

__all__ = ["is_description", "open_job", "run_session", "session_and_out"]


def is_description(source: Path) -> bool:
    """Whether a path is a scene description's, not a session's."""
    return source.suffix == ".toml" and source.name != "session.toml"


@contextmanager
def open_job(
    session_path: Path,
    *,
    out: Path | None = None,
    said: Solving = AS_BEFORE,
    scheduler: str | None = None,
) -> Iterator["Job"]:
    """Hold a session's output folder for a block. What is not said stays as the folder was made before.

    Parameters
    ----------
    session_path : Path
        A session's folder, its session.toml, or an output folder, whose session it is then.
    out : Path, optional
        Output folder; out/NAME without.
    said : Solving or Settings
        How the steps run.
    scheduler : str, optional
        Address of a Dask scheduler.

    Raises
    ------
    SceneError
        Unknown solver or profile, an unreadable session, an output folder that is another's, or in use.
    """
    # Before anything is written.
    _ = said.methods(), said.programs()
    place, folder = session_and_out(session_path, out)
    session = load_session(place)
    files: list[Path] = []
    # Its paths, as its fingerprint meets them.
    fingerprint(session, digest=files.append)
    with (
        open_record(folder, origin=origin_of(session, place), inputs=files, input_folders=[session.folder]) as record,
        logged(record),
        executor_of(scheduler, record.scratch("cluster")) as executor,
    ):
        note_session(record, place)
        if is_output(session_path):
            say(f"session: {place}")
        settings = Settings.of(record).but(said)
        settings.methods()
        settings.keep(record)
        yield Job(session, record, settings, executor)


def run_session(
    session_path: Path,
    wanted: str,
    *,
    shown: Callable[["Job", dict[str, Any]], None] | None = None,
    **how: Any,
) -> dict[str, Any]:
    """Run one verb with all that it needs, and return the summary (summary.json).

    Parameters
    ----------
    wanted : str
        The last step to run, a key of `lab.plan.STEPS`.
    shown : callable, optional
        Takes the job and the summary, and tells people, while the run's log is open.
    session_path, **how
        As in `open_job`.
    """
    with open_job(session_path, **how) as job:
        for step in job.wanted(wanted):
            job.run(STEPS, step)
        # The frames are in the store.
        shutil.rmtree(kept_folder(job.record.folder), ignore_errors=True)
        summary = summed_up(job, wanted)
        if shown:
            shown(job, summary)
    return summary


def summed_up(job: "Job", last: str) -> dict[str, Any]:
    """Write summary.json of what is done, after the verb `last`, and the report with it; return the summary."""
    summary = write_summary(job, last)
    # A report that is still right is filed with the checksum of summary.json.
    if last == "compare" or job.record.is_intact(job.store.path("report.pdf")):
        from compare.report.report import write_report

        with job.record.part_of(REPORTED):
            write_report(job.store, summary, _digests(job))
    return summary


def _digests(job: "Job") -> dict[str, str | None]:
    """Return the SHA-256 of what a report is filed with, by name."""
    record, place = job.record, session_of(job.record.folder)
    toml = place if place.is_file() else place / MANIFEST
    given = {path.name: record.digest(path) for path in (job.session.scan, toml) if path and path.is_file()}
    made = [job.store.path(name) for name in ("lights.json", "summary.json")]
    made += sorted(job.store.path("normals").glob("*.npy"))
    return given | {record.name_of(path): record.digest(path) for path in made}
