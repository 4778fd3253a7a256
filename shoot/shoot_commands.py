"""`rgbn init`, `rgbn plan` and `rgbn watch` as the command line has them: what they do is loaded with the work."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from lab.options import Json
from shoot.init.answers import NOTHING, Answers
from shoot.plan.plan_options import AS_USUAL, PlanOptions


def init(
    folder: Path, /, *, yes: Annotated[bool, Parameter(alias="-y", negative="")] = False, told: Answers = NOTHING
) -> None:
    """Look at a folder of photographs, ask what no file tells, and write its session.toml.

    Parameters
    ----------
    folder : Path
        Folder with the photographs, or with a folder of them for each object.
    yes : bool
        Ask nothing. What is not known is assumed, and named.
    told : Answers
    """
    from shoot.init.init_session import init_sessions

    init_sessions(folder, yes=yes, told=told)


def plan(
    source: Path | None = None,
    /,
    *,
    options: PlanOptions = AS_USUAL,
    out: Annotated[Path | None, Parameter(alias="-o")] = None,
    json: Json = False,
) -> None:
    """Plan a shoot: where flashes and balls go, and which error to expect after each flash.

    Parameters
    ----------
    source : Path, optional
        The scan; or a session under way or its output folder: where the next flash helps. Default: a sphere.
    options : PlanOptions
    out : Path, optional
        Output folder. Default: a session's own, or out/plan-NAME.
    """
    from shoot.plan.run_plan import run_plan, show_plan

    show_plan(run_plan(source, options, out=out), as_json=json)


def watch(
    folder: Path,
    /,
    *,
    out: Annotated[Path | None, Parameter(alias="-o")] = None,
    until_idle: Annotated[float | None, Parameter(validator=Number(gt=0, lt=1e7))] = None,
    wanted_deg: Annotated[float, Parameter(validator=Number(gt=0, lt=90))] = 1.0,
    told: Answers = NOTHING,
) -> None:
    """Judge each photograph of a shoot within seconds, and write the session at the end.

    Parameters
    ----------
    folder : Path
        Folder that the camera's program writes into.
    out : Path, optional
        Output folder. Default: out/NAME, by the folder's name.
    until_idle : float, optional
        The shoot ends after so many seconds without a new photograph. Default: it ends by Ctrl-C.
    wanted_deg : float
        Sigma of the normals that is good enough, degrees.
    told : Answers
    """
    from shoot.watch.watch_folder import watch_folder

    watch_folder(folder, out=out, until_idle=until_idle, wanted_deg=wanted_deg, told=told)
