"""`rgbn init`, `plan` and `watch` as the command line has them."""

from json import dumps
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from lab.progress import is_quiet, say
from shoot.init.answers import NOTHING, Answers
from shoot.plan.plan_options import AS_USUAL, PlanOptions


def init(
    folder: Annotated[Path, Parameter(help="Folder with the photographs, or with a folder of them for each object.")],
    /,
    *,
    yes: Annotated[
        bool, Parameter(name=["--yes", "-y"], help="Ask nothing. What is not known is assumed, and named.", negative="")
    ] = False,
    told: Answers = NOTHING,
) -> None:
    """Look at a folder of photographs, ask what no file tells, and write its session.toml."""
    from shoot.init.init_session import init_sessions

    init_sessions(folder, yes=yes, told=told)


def plan(
    source: Annotated[
        Path | None,
        Parameter(
            help="The object's scan. Or a session under way or its output folder, to learn where the next flash helps. "
            "Default: a sphere of --size-mm.",
        ),
    ] = None,
    /,
    *,
    options: PlanOptions = AS_USUAL,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="Output folder. Default: a session's own, or out/plan-NAME."),
    ] = None,
    json: Annotated[bool, Parameter(help="Print the results as JSON.", negative="")] = False,
) -> None:
    """Plan a shoot: where flashes and balls go, and which error to expect after each flash."""
    from lab.terminal_tables import number_table, show
    from shoot.plan.run_plan import answer_of, lights_of, run_plan

    facts = run_plan(source, options, out=out)
    if json:
        print(dumps(facts, indent=1))
        return
    tables = [number_table("flashes, the most useful first", "flashes", facts["flashes"])]
    if facts["balls"]:
        tables.append(number_table("balls, from the object's middle", "planned balls", facts["balls"]))
    show(*tables, lights_of(facts), answer_of(facts))
    for name in () if is_quiet() else ("plan.html", "plan.json"):
        print(f"written  {Path(facts['folder']) / name}")
    for text in facts["warnings"]:
        say(f"warning: {text}", always=True)


def watch(
    folder: Annotated[Path, Parameter(help="Folder that the camera's program writes into.")],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(alias="-o", help="Output folder. Default: out/NAME, by the folder's name.")
    ] = None,
    until_idle: Annotated[
        float | None,
        Parameter(
            help="The shoot ends after so many seconds without a new photograph. Default: it ends by Ctrl-C.",
            validator=Number(gt=0, lt=1e7),
        ),
    ] = None,
    wanted_deg: Annotated[
        float, Parameter(help="Sigma of the normals that is good enough, degrees.", validator=Number(gt=0, lt=90))
    ] = 1.0,
    told: Answers = NOTHING,
) -> None:
    """Judge each photograph of a shoot within seconds, and write the session at the end."""
    from shoot.watch.watch_folder import watch_folder

    watch_folder(folder, out=out, until_idle=until_idle, wanted_deg=wanted_deg, told=told)
