"""A verb on a session: its output folder opened and locked, the steps run, what came out told."""

import json as json_module
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from lab.twin_settings import AS_GIVEN, TwinSettings
from scene.errors import SceneError

if TYPE_CHECKING:
    from lab.job import Job
    from solve.external import External

DEFAULT_METHODS = "ls,iterative"


def is_description(source: Path) -> bool:
    """Whether a path is a scene description's, not a session's."""
    return source.suffix == ".toml" and source.name != "session.toml"


@contextmanager
def open_job(
    session_path: Path,
    *,
    out: Path | None = None,
    method: str = DEFAULT_METHODS,
    profile: str = "default",
    external: tuple[list[str], float] = ([], 3600.0),
    scheduler: str | None = None,
    truth: Path | None = None,
    twin: TwinSettings = AS_GIVEN,
) -> Iterator["Job"]:
    """Hold a session's output folder for a block.

    Parameters
    ----------
    session_path : Path
    out : Path, optional
        Output folder; out/NAME without.
    method : str
        Solvers, with commas.
    profile : str
        Of their settings: `default`, `seed`.
    external : tuple
        Other programs as methods, each NAME=COMMAND, and the seconds that each may take.
    scheduler : str, optional
        Address of a Dask scheduler.
    truth : Path, optional
        Folder of a known truth (truth.json, truth.npz) to judge the results by.
    twin : TwinSettings
        How the twin is rendered.

    Raises
    ------
    SceneError
        Unknown solver or profile, an unreadable session, an output folder that is another's, or in use.
    """
    from capture.session.session import load_session
    from lab.cluster.connect import executor_of
    from lab.job import Job
    from scene.current import paths_in
    from scene.output_folder import open_record

    methods, externals = methods_of(method, profile), _externals(*external)
    session = load_session(session_path)
    folder = out or Path("out") / session.name
    files = tuple(paths_in(session))
    with (
        open_record(folder, inputs=files, input_folders=[session.folder]) as record,
        executor_of(scheduler, record.scratch("cluster"), files) as executor,
    ):
        yield Job(session, record, (*methods, *externals), executor, truth, profile, externals, twin=twin)


def run_session(
    session_path: Path,
    wanted: str,
    *,
    out: Path | None = None,
    method: str = DEFAULT_METHODS,
    profile: str = "default",
    external: tuple[list[str], float] = ([], 3600.0),
    json: bool = False,
    scheduler: str | None = None,
    truth: Path | None = None,
    twin: TwinSettings = AS_GIVEN,
) -> None:
    """Run one verb with all that it needs, and tell what came out.

    Parameters
    ----------
    wanted : str
        The last step to run, a key of `lab.plan.STEPS`.
    json : bool
        Print the summary as JSON, not as a table.
    session_path, out, method, profile, external, scheduler, truth, twin
        As in `open_job`.
    """
    from lab.announce import tell
    from lab.plan import REPORTED, STEPS
    from lab.progress import say
    from lab.summary import write_summary

    how = {"method": method, "profile": profile, "external": external, "scheduler": scheduler, "truth": truth}
    with open_job(session_path, out=out, twin=twin, **how) as job:
        arguments = {
            "up_to": wanted,
            "session": str(session_path),
            "methods": list(job.methods),
            "profile": profile,
            "external": {name: program.command for name, program in job.externals.items()},
            "twin": asdict(twin),
        }
        job.run(STEPS, wanted)
        summary = write_summary(job, arguments)
        if wanted == "compare":
            from compare.report.report import write_report

            with job.record.part_of(REPORTED):
                page = write_report(job.store, summary)
            say(f"report: {page}")
    if json:
        print(json_module.dumps(summary, indent=1))
    else:
        tell(summary)


def methods_of(text: str, profile: str) -> tuple[str, ...]:
    """Return the methods that a command line names, with commas.

    Raises
    ------
    SceneError
        There is no such method, or it has no such profile.
    """
    from solve.methods import METHODS, method_of

    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    unknown = [name for name in names if name not in METHODS]
    if unknown or not names:
        raise SceneError(
            f"--method {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(METHODS)}."
        )
    for name in names:
        method_of(name).settings(profile)
    return names


def _externals(texts: list[str], timeout_s: float) -> "dict[str, External]":
    """Return the other programs by name."""
    from solve.external import External

    found: dict[str, External] = {}
    for text in texts:
        program = External.parse(text, timeout_s)
        if program.name in found:
            raise SceneError(f"--external {program.name}: given twice. Give each program its own name.")
        found[program.name] = program
    return found
