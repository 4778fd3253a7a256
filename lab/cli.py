"""The command line: `rgbn VERB`."""

import json as json_module
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from scene.errors import SceneError

app = App(
    name="rgbn",
    help="From a folder of raw flash photographs (and a laser scan) to calibrated lights, ground-truth normals, "
    "normals by photometric stereo, a synthetic twin, and one report that says how far to trust each.",
    help_flags=["--help", "-h"],
    version_flags=["--version"],
    version=lambda: __import__("importlib.metadata", fromlist=["version"]).version("rgbn"),
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)

Session = Annotated[Path, Parameter(help="Folder with session.toml, or in the DiLiGenT layout.")]
Out = Annotated[Path | None, Parameter(help="Output folder. Default: out/NAME here, by the session's name.")]
Method = Annotated[str, Parameter(help="Photometric-stereo methods, with commas: ls, iterative.")]
Json = Annotated[bool, Parameter(help="Print the summary as JSON on standard output.", negative="")]
Scheduler = Annotated[str | None, Parameter(help="Address of a Dask scheduler; default: this machine's cores.")]
DEFAULT_METHODS = "ls,iterative"


@app.command(sort_key=1)
def process(
    session: Session,
    /,
    *,
    out: Out = None,
    method: Method = DEFAULT_METHODS,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Go the whole way: decode, lights, scan, normals, twin, report."""
    run_session(session, "compare", out=out, method=method, json=json, scheduler=scheduler)


@app.command(sort_key=2)
def demo(*, out: Out = None, json: Json = False) -> None:
    """Go the whole way on the small session that comes with rgbn, and judge it by its known truth."""
    from lab.rooms import ROOT

    folder = ROOT / "fixtures" / "bumpy"
    run_session(folder, "compare", out=out or Path("out") / "demo", json=json, truth=folder)


@app.command(sort_key=3)
def check(session: Session, /, *, out: Out = None, scheduler: Scheduler = None, json: Json = False) -> None:
    """Decode a capture and audit it: exposure, misfires, doubles, movement, clipping."""
    run_session(session, "check", out=out, json=json, scheduler=scheduler)


@app.command(sort_key=4)
def calibrate(session: Session, /, *, out: Out = None, json: Json = False) -> None:
    """Find the balls, and from them each flash's direction, position and intensity."""
    run_session(session, "calibrate", out=out, json=json)


@app.command(sort_key=5)
def align(session: Session, /, *, out: Out = None, json: Json = False) -> None:
    """Find the object, register its scan, write the ground-truth normals."""
    run_session(session, "align", out=out, json=json)


@app.command(sort_key=6)
def solve(
    session: Session,
    /,
    *,
    out: Out = None,
    method: Method = DEFAULT_METHODS,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Recover normals and albedo by photometric stereo."""
    run_session(session, "solve", out=out, method=method, json=json, scheduler=scheduler)


@app.command(sort_key=7)
def twin(session: Session, /, *, out: Out = None, method: Method = DEFAULT_METHODS, json: Json = False) -> None:
    """Render the registered scan under the calibrated lights, and solve the rendering."""
    run_session(session, "twin", out=out, method=method, json=json)


@app.command(sort_key=8)
def compare(session: Session, /, *, out: Out = None, method: Method = DEFAULT_METHODS, json: Json = False) -> None:
    """Compare real and synthetic with the truth, and write report.html."""
    run_session(session, "compare", out=out, method=method, json=json)


@app.command(sort_key=9)
def doctor() -> None:
    """Say what this machine has, and what would make it faster."""
    from lab.doctor import examine

    for what, finding in examine():
        print(f"{what:32} {finding}")


def run_session(
    session_path: Path,
    wanted: str,
    *,
    out: Path | None = None,
    method: str = DEFAULT_METHODS,
    json: bool = False,
    scheduler: str | None = None,
    truth: Path | None = None,
) -> None:
    """Run one verb with all that it needs, and tell what came out.

    Parameters
    ----------
    session_path : Path
    wanted : str
        The last step to run, a key of `lab.plan.STEPS`.
    out : Path, optional
        Output folder; out/NAME without.
    method : str
        Solvers, with commas.
    json : bool
        Print the summary as JSON, not as a table.
    scheduler : str, optional
        Address of a Dask scheduler.
    truth : Path, optional
        Folder of a known truth (truth.json, truth.npz) to judge the results by.
    """
    from capture.session import load_session
    from lab.job import Job, locked
    from lab.plan import STEPS
    from lab.progress import say
    from lab.summary import write_summary
    from lab.tell import tell
    from scene.store import Store

    methods = _methods(method)
    session = load_session(session_path)
    folder = out or Path("out") / session.name
    inputs = [session.folder, *(path.parent for path in (*session.flash, session.scan, session.mask) if path)]
    if any(folder.resolve() == place.resolve() for place in inputs):
        raise SceneError(
            f"--out {folder}: the session's own files lie there, and the output has files of the same names. Choose "
            "another folder; one inside the session's is fine."
        )
    with locked(folder), _executor(scheduler) as executor:
        job = Job(session, Store(folder), methods, executor, truth)
        arguments = {"up_to": wanted, "session": str(session_path), "methods": list(methods)}
        job.run(STEPS, wanted)
        summary = write_summary(job, arguments)
        if wanted == "compare":
            from compare.report import write_report

            page = write_report(job.store, summary)
            say(f"report: {page}")
    if json:
        print(json_module.dumps(summary, indent=1))
    else:
        tell(summary)


def _methods(text: str) -> tuple[str, ...]:
    from solve.solve import METHODS

    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    unknown = [name for name in names if name not in METHODS]
    if unknown or not names:
        raise SceneError(
            f"--method {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(METHODS)}."
        )
    return names


@contextmanager
def _executor(address: str | None) -> Iterator[Any]:
    """Hold the executor of a Dask scheduler for a block; None for threads here."""
    if address is None:
        yield None
        return
    from dask.distributed import Client

    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise SceneError(f"--scheduler {address}: no Dask scheduler answers there ({error}).") from error
    with client:
        yield client.get_executor()


def main() -> None:
    """Run the command line; exit 0 done, 2 the input is at fault, 130 stopped by Ctrl-C, 1 our fault."""
    try:
        from lab.rooms import check_rooms

        check_rooms()
        app(sys.argv[1:])
        sys.stdout.flush()
    except SceneError as error:
        print(f"rgbn: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("\nrgbn: stopped. What is done is kept; the same command goes on from there.", file=sys.stderr)
        _leave(130)
    except BrokenPipeError:
        # The reader of a pipe went away (`rgbn ... | head`): not our fault, and nothing to say.
        _leave(0)
    except Exception:
        traceback.print_exc()
        print(
            "rgbn: this is a fault of rgbn, not of your input. Please report it with the lines above.", file=sys.stderr
        )
        raise SystemExit(1) from None


def _leave(code: int) -> None:
    """End at once: worker threads may be inside a library call that would hold up an orderly exit."""
    sys.stderr.flush()
    os._exit(code)
