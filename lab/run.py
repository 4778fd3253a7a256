"""A verb on a session: its output folder opened and locked, the steps run, the summary written.

STEPS has the steps in the order in which data flow: what each needs, reads and leaves.

summary.json has every number of the report, with units in the key names; its tables are for spreadsheets.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from capture.photographs.kept import kept_folder
from capture.session.session import load_session
from compare.statistics.statistics import statistics_rows
from lab import steps
from lab.cluster import executor_of
from lab.job import Job, Step
from lab.options import AS_BEFORE, NOTE, Settings, Solving
from lab.progress import logged, say
from lab.results import FOLDER, recommended, results
from lab.session_place import MANIFEST, is_output, note_session, origin_of, session_and_out, session_of
from lab.twin_step import twin
from scene.current import fingerprint, libraries
from scene.files import plain, remove, write_json, write_text
from scene.light_text import FILENAMES, INTENSITIES
from scene.notebook import csv_text
from scene.output_folder import open_record
from scene.store import Store


def _frame_inputs(job: Job) -> list[Any]:
    session = job.session
    files = (session.flash, session.ambient, session.dark, session.flat, session.chart)
    coding = (session.encoding, session.encoding_stated, session.half, session.skip, session.layout)
    # A scan wants a camera: whether there is one decides what `check` accepts.
    return [*files, *coding, session.camera, session.board_shots, session.scan is None]


def _light_inputs(job: Job) -> list[Any]:
    session, file = job.session, job.session.lights_file
    # DiLiGenT's directions have their intensities and names beside them.
    beside = [] if file is None else [file.with_name(INTENSITIES), file.with_name(FILENAMES)]
    # AliceVision's lights have its view ids beside them.
    beside += [] if file is None else sorted(file.parent.glob("*.sfm"))
    # Without balls and file a scan is the probe, unless normals are given.
    return [session.spheres, session.no_spheres, file, *beside, session.normals is None, session.scan is None]


def _object_inputs(job: Job) -> list[Any]:
    session = job.session
    scan = (session.scan, session.scan_unit, session.scan_ball_diameter_mm)
    return [session.mask, session.box, *scan, session.normals, session.picks]


def _methods(job: Job) -> list[Any]:
    programs = job.externals.values()
    return [job.methods, job.profile, *((program.command, program.files) for program in programs)]


def _judged_by(job: Job) -> list[Any]:
    truth = job.settings.truth
    return [*_methods(job), job.tolerances_deg, *(truth / f"truth.{kind}" for kind in ("json", "npz") if truth)]


EXPORTED = "export"
"""Files for other programs: `calibrate` finds the lights, `align` moves them to the object."""
ARCHIVED = "heritage"
"""The bag for an archive: of one method's maps in `results`."""
REPORTED = "report"

STEPS = {
    step.name: step
    for step in (
        Step("check", steps.check, (), _frame_inputs),
        Step("calibrate", steps.calibrate, ("check",), _light_inputs, (EXPORTED,)),
        Step("align", steps.align, ("calibrate",), _object_inputs, (EXPORTED,)),
        Step("solve", steps.solve, ("align",), _methods),
        Step("trust", steps.trust, ("solve",), lambda job: []),
        Step("twin", twin, ("solve",), lambda job: [*_methods(job), job.twin]),
        Step("compare", steps.compare, ("twin",), _judged_by, (REPORTED,)),
        # Of what `compare` and `trust` found nothing but which method is recommended, so that neither is waited for.
        Step(FOLDER, results, ("solve",), lambda job: [job.settings.normals, recommended(job)], (ARCHIVED,)),
    )
}
"""In the order in which data flow."""


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
) -> Iterator[Job]:
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
        executor_of(scheduler, record.folder) as executor,
    ):
        note_session(record, place)
        if is_output(session_path):
            say(f"session: {place}")
        settings = Settings.of(record).but(said)
        settings.methods()
        record.note(NOTE, plain(settings))
        yield Job(session, record, settings, executor)


def run_session(session_path: Path, wanted: str, **how: Any) -> dict[str, Any]:
    """Run one verb with all that it needs, and return the summary; see `run_verb`, and for `how` `open_job`."""
    with open_job(session_path, **how) as job:
        return run_verb(job, wanted)


def run_verb(job: Job, wanted: str) -> dict[str, Any]:
    """Run a step, a key of `STEPS`, with all that it needs, and return the summary (summary.json)."""
    for step in job.wanted(wanted):
        job.run(STEPS, step)
    # The frames are in the store.
    shutil.rmtree(kept_folder(job.record.folder), ignore_errors=True)
    return summed_up(job, wanted)


def summed_up(job: Job, last: str) -> dict[str, Any]:
    """Write summary.json of what is done, after the verb `last`, its tables and its report; return the summary."""
    arguments = {
        "up_to": last,
        "session": str(job.session.folder),
        "methods": list(job.methods),
        "profile": job.profile,
        "external": {name: program.command for name, program in job.externals.items()},
        "twin": asdict(job.twin),
        "trust": job.settings.trust,
        "truth": job.settings.truth,
        "tolerance_deg": job.tolerance_deg,
        "tolerances_deg": job.tolerances_deg,
    }
    done = job.done
    result = {step: done.get(step, {}).get("result", {}) for step in STEPS}
    twin, compared = dict(result["twin"]), dict(result["compare"])
    of_twin = twin.pop("twin_processor_seconds", {})
    solved = result["solve"].get("methods", {})
    methods = {name: {**row, "twin_processor_seconds": of_twin.get(name)} for name, row in solved.items()}
    truth_check = compared.pop("truth_check", None)
    summary = {
        "name": job.session.name,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": libraries(),
        "arguments": arguments,
        "seconds": {step: entry["seconds"] for step, entry in done.items()},
        "processor_seconds": {step: entry.get("processor_seconds") for step, entry in done.items()},
        "warnings": [{"step": step, "text": text} for step, entry in done.items() for text in entry["warnings"]],
        "capture": result["check"],
        "camera": job.store.read_json("camera.json") if job.store.path("camera.json").exists() else None,
        "calibrate": result["calibrate"],
        "align": result["align"].get("truth"),
        "solve": {"methods": methods},
        "trust": result["trust"] or None,
        "results": result["results"] or None,
        "twin": twin if twin.get("rendered") else None,
        "compare": compared,
    }
    if truth_check:
        summary["truth_check"] = truth_check
    write_json(job.store.path("summary.json"), summary)
    write_tables(job.store, compared)
    summary = job.store.read_json("summary.json")
    # A report that is still right is filed with the checksum of summary.json; it is made of a whole folder only.
    if last == "compare" or job.is_current(STEPS, "compare"):
        from compare.report.report import write_report

        with job.record.part_of(REPORTED):
            write_report(job.store, summary, _digests(job))
    return summary


def write_tables(store: Store, compared: dict[str, Any]) -> None:
    """Write lights.csv and statistics.csv; a table of what is not there, or no longer, is removed."""
    lights = store.load_lights().rows() if store.path("lights.json").exists() else []
    for name, rows in (("lights.csv", lights), ("statistics.csv", statistics_rows(compared))):
        if rows:
            write_text(store.path(name), csv_text(rows))
        else:
            remove(store.path(name))


def _digests(job: Job) -> dict[str, str | None]:
    """Return the SHA-256 of what a report is filed with, by name."""
    record, place = job.record, session_of(job.record.folder)
    toml = place if place.is_file() else place / MANIFEST
    given = {path.name: record.digest(path) for path in (job.session.scan, toml) if path and path.is_file()}
    made = [job.store.path(name) for name in ("lights.json", "summary.json")]
    made += sorted(job.store.path("normals").glob("*.npy"))
    return given | {record.name_of(path): record.digest(path) for path in made}
