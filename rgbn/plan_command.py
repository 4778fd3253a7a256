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

    from rgbn.step_tables import number_table
    from shoot.plan.plan_page import BALL_HEADS, FLASH_HEADS, answer_of, ball_rows, flash_rows, lights_of

    console, tables = Console(), {
        "flashes, the most useful first": (FLASH_HEADS, flash_rows(facts["flashes"])),
        "balls": (BALL_HEADS, ball_rows(facts)),
    }  # fmt: skip
    for title, (heads, rows) in tables.items():
        if not rows:
            # A session's balls of unknown size: where they stand nobody knows.
            continue
        forms = {head: f"{{cell_{number}}}" for number, head in enumerate(heads)}
        cells = [{f"cell_{number}": cell for number, cell in enumerate(row)} for row in rows]
        console.print(number_table(title, forms, cells))
    console.print(lights_of(facts))
    for name in ("plan.html", "plan.json"):
        # As they are, to be copied: a long path is not wrapped.
        print(f"written  {Path(facts['folder']) / name}")
    console.print(answer_of(facts))
    for text in facts["warnings"]:
        console.print(f"warning: {text}", style="yellow")
