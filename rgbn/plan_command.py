"""`rgbn plan` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lab.streams import is_quiet
from shoot.plan.plan_options import AS_USUAL, PlanOptions


def plan(
    source: Annotated[
        Path | None,
        Parameter(
            help="The object's scan; or a session under way, or its output folder: then where the next flash helps. "
            "Default: a sphere of --size-mm.",
        ),
    ] = None,
    /,
    *,
    options: PlanOptions = AS_USUAL,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="Output folder. Default: a session's own; else out/plan-NAME here."),
    ] = None,
    json: Annotated[bool, Parameter(help="Print the plan as JSON on standard output.", negative="")] = False,
) -> None:
    """Say before the first flash what a shoot will give: where flashes and balls go, expected error, when to stop."""
    from shoot.plan.run_plan import run_plan

    facts = run_plan(source, options, out=out)
    if json:
        import json as json_module

        print(json_module.dumps(facts, indent=1))
        return
    if is_quiet():
        return
    from rich.console import Console

    from lab.terminal_tables import number_table
    from shoot.plan.plan_page import BALLS, FLASHES, answer_of, lights_of

    console = Console()
    console.print(number_table("flashes, the most useful first", FLASHES, facts["flashes"]))
    if facts["balls"]:
        console.print(number_table("balls, from the object's middle", BALLS, facts["balls"]))
    console.print(lights_of(facts))
    for name in ("plan.html", "plan.json"):
        # As they are, to be copied: a long path is not wrapped.
        print(f"written  {Path(facts['folder']) / name}")
    console.print(answer_of(facts))
    for text in facts["warnings"]:
        console.print(f"warning: {text}", style="yellow")
