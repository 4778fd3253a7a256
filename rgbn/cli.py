"""The command line: `rgbn VERB`."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Group, Parameter

from lab.options import AS_BEFORE, BY_NAME, Jobs, Json, Place, Scheduler, Settings
from lab.progress import check_words, keep_logs, keep_quiet, open_streams, say
from rgbn.examples import fixture_folder, tell_example
from rgbn.exit_codes import end_by
from scene.errors import SceneError

app = App(
    name="rgbn",
    help="Make lights, normals by photometric stereo, ground-truth normals and a synthetic twin from a folder of raw "
    "flash photographs and a laser scan. One report says how far to trust each.",
    # Markdown would take a third of the time.
    help_format="plaintext",
    help_flags=["--help", "-h"],
    version_flags=["--version", "-V"],
    version=lambda: __import__("importlib.metadata", fromlist=["version"]).version("rgbn"),
    result_action="return_value",
    suppress_keyboard_interrupt=False,
    exit_on_error=False,
    print_error=False,
    # That a flag is off by default needs no words; no list has an option that empties it.
    default_parameter=Parameter(
        show_default=lambda value: str(value) if value else None,  # type: ignore[arg-type]
        negative_iterable=(),
    ),
)
app.register_install_completion_command(
    help="Let the shell complete verbs and options. Writes a script and a line of the shell's startup file."
)
app.meta.suppress_keyboard_interrupt = False
app.meta.group_parameters = Group("Every verb", sort_key=100)

SESSION = "Folder with session.toml or in the DiLiGenT layout, or an output folder that was made from one."
Session = Annotated[Path, Parameter(help=SESSION)]


def _run(session: Path, wanted: str, place: Place, *, whole: bool = False, **how: Any) -> None:
    """Run a verb on a session, and tell what came out."""
    from lab.run import open_job, run_verb
    from rgbn.step_tables import tell

    with open_job(session, out=place.out, **how) as job:
        tell(job, run_verb(job, wanted), verb=wanted, as_json=place.json, whole=whole)


@app.meta.default
def _start(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    quiet: Annotated[bool, Parameter(alias="-q", help="Say only warnings and errors.", negative="")] = False,
) -> Any:
    keep_quiet(quiet)
    keep_logs()
    return app(words)


@app.command(sort_key=1)
def process(
    session: Annotated[Path, Parameter(help=f"{SESSION} A folder with many sessions below it will do, too.")],
    /,
    *,
    place: Place = BY_NAME,
    said: Settings = AS_BEFORE,
    scheduler: Scheduler = None,
    jobs: Jobs = 1,
) -> None:
    """Take one session, or all below a folder, the whole way: decode, lights, scan, normals, twin, report."""
    from lab.many_sessions import process_all, sessions_below
    from lab.session_place import is_output

    if not is_output(session) and (sessions := sessions_below(session)):
        process_all(session, sessions, place, said, jobs=jobs, scheduler=scheduler)
        return
    _run(session, "compare", place, whole=True, said=said, scheduler=scheduler)


@app.command(sort_key=2)
def demo(
    *,
    out: Annotated[Path | None, Parameter(alias="-o", help="Output folder. Default: out/demo.")] = None,
    json: Json = False,
) -> None:
    """Take the small session that comes with rgbn the whole way, and judge it by its known truth."""
    folder, place = fixture_folder(), Place(out or Path("out") / "demo", json)
    _run(folder, "compare", place, whole=True, said=Settings(truth=folder))


@app.command(sort_key=3)
def check(session: Session, /, *, place: Place = BY_NAME, scheduler: Scheduler = None) -> None:
    """Decode a capture and check it for wrong exposure, misfires, doubles, movement and clipping."""
    _run(session, "check", place, scheduler=scheduler)


@app.command(sort_key=4)
def calibrate(session: Session, /, *, place: Place = BY_NAME) -> None:
    """Find the balls. They tell each flash's direction, position and intensity."""
    _run(session, "calibrate", place)


@app.command(sort_key=5)
def align(session: Session, /, *, place: Place = BY_NAME) -> None:
    """Find the object, register its scan, and write the ground-truth normals."""
    _run(session, "align", place)


@app.command(sort_key=6)
def solve(
    session: Session,
    /,
    *,
    place: Place = BY_NAME,
    said: Settings = AS_BEFORE,
    scheduler: Scheduler = None,
) -> None:
    """Recover normals and albedo by photometric stereo."""
    _run(session, "solve", place, said=said, scheduler=scheduler)


@app.command(sort_key=7)
def twin(
    session: Annotated[Path, Parameter(help=f"{SESSION} A scene description (.toml) will do, too.")],
    /,
    *,
    place: Place = BY_NAME,
    said: Settings = AS_BEFORE,
) -> None:
    """Render the registered scan under the calibrated lights, or a scene description. Solves the rendering."""
    from lab.run import is_description

    if is_description(session):
        from experiments.scene_twin import render_description

        render_description(session, place.out, said, json=place.json)
        return
    _run(session, "twin", place, said=said)


@app.command(sort_key=8)
def compare(
    session: Annotated[Path, Parameter(help=f"{SESSION} With COUNTERPART: a processed output folder.")],
    counterpart: Annotated[
        Path | None,
        Parameter(
            help="Another output folder, or twin/ in the first. Tells whether methods fail alike on both; of two "
            "sessions of one object with one scan, where its surface changed."
        ),
    ] = None,
    /,
    *,
    place: Place = BY_NAME,
    said: Settings = AS_BEFORE,
) -> None:
    """Compare real and synthetic with the truth, and write report.html. Or compare two processed folders."""
    if counterpart is not None:
        from experiments.compare_folders import compare_folders

        if replace(said, method=None) != AS_BEFORE:
            raise SceneError("rgbn compare: of two folders it takes --method, --out and --json. Leave the others out.")
        compare_folders(session, counterpart, place.out, methods=said.method, json=place.json)
        return
    _run(session, "compare", place, said=said)


@app.command(sort_key=9)
def rig(
    *folders: Annotated[
        Path, Parameter(help="Output folders of sessions with balls, in the order of their photographs.")
    ],
    out: Annotated[Path, Parameter(alias="-o", help="File for the lamps.")] = Path("rig.json"),
) -> None:
    """Pool the lights of a fixed set-up from several sessions. The file serves sessions without balls."""
    from calibrate.known_lights.rig import rig as pool
    from lab.terminal_tables import show
    from rgbn.step_tables import light_table

    found = pool(folders)
    found.write(out)
    title = f"rig: {len(found.lights)} {found.lights.model} lamps, of {len(found.sessions)} sessions"
    show(light_table(title, found.lights))
    for text in found.warnings:
        say(f"warning: {text}", always=True)
    file = json.dumps(str(out.resolve()), ensure_ascii=False)
    say(f"written: {out}. In session.toml of a session without balls: [lights] file = {file}")


dataset = App(
    name="dataset", help="Make, add and solve datasets with known truth.", help_flags=app.help_flags, version_flags=[],
    sort_key=10,
)  # fmt: skip
app.command(dataset)
app.command(tell_example, name="example", sort_key=2)
# Loaded when they are called: what their options are stands beside what they do.
for above, name, place, told, key in (
    (app, "init", "shoot.shoot_commands:init",
     "Look at a folder of photographs, ask what no file tells, and write its session.toml.", 0),
    (app, "plan", "shoot.shoot_commands:plan",
     "Plan a shoot: where flashes and balls go, and which error to expect after each flash.", 0),
    (app, "watch", "shoot.shoot_commands:watch",
     "Judge each photograph of a shoot within seconds, and write the session at the end.", 0),
    (app, "series", "experiments.commands:series",
     "Process sessions of one object in which one factor changes. Shows errors against it, real beside synthetic.", 1),
    (app, "export", "rgbn.export_command:export",
     "Write lights, a relightable picture or the twin's scene for another program.", 9),
    (app, "sweep", "experiments.commands:sweep",
     "Make one factor harder and harder, and show which method breaks where.", 10),
    (app, "doctor", "rgbn.doctor:doctor",
     "Say whether this machine can run rgbn, what to mend, and what makes it faster.", 11),
    (app, "studio", "studio.studio_command:studio",
     "Work in the browser, from a folder of photographs to the verdict, or from models to a dataset.", 12),
    (dataset, "list", "experiments.commands:list_datasets",
     "List the datasets, and which of them are on the shelf.", 1),
    (dataset, "make", "experiments.commands:make",
     "Make datasets in the DiLiGenT layout, with true maps. Keeps what is current.", 2),
    (dataset, "add", "experiments.commands:add",
     "Read a dataset's files and note it on the shelf. They stay where they are.", 3),
    (dataset, "run", "experiments.commands:run",
     "Solve datasets of the shelf. Writes a table of angular errors and a gallery.", 4),
):  # fmt: skip
    above.command(place, name=name, help=told, sort_key=key, group_parameters=Group.create_default_parameters())


def main() -> None:
    """Run the command line; `rgbn.exit_codes` says what each end is told by."""
    open_streams()
    try:
        from scene.current import check_rooms

        check_rooms()
        check_words(sys.argv[1:])
        app.meta(sys.argv[1:])
        sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:
        end_by(error)
