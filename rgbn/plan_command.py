"""`rgbn plan` as the command line has it."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from lab.streams import is_quiet
from shoot.plan.plan_options import CameraOptions, ObjectOptions, ShootOptions

OBJECT, CAMERA, SHOOT = ObjectOptions(), CameraOptions(), ShootOptions()


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
    flashes: Annotated[int, Parameter(help="How many flashes, those that there are already included.")],
    thing: ObjectOptions = OBJECT,
    camera: CameraOptions = CAMERA,
    shoot: ShootOptions = SHOOT,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="Output folder. Default: a session's own; else out/plan-NAME here."),
    ] = None,
    json: Annotated[bool, Parameter(help="Print the plan as JSON on standard output.", negative="")] = False,
) -> None:
    """Say before the first flash what a shoot will give: where flashes and balls go, expected error, when to stop."""
    from shoot.plan.run_plan import run_plan

    facts = run_plan(source, flashes, thing=thing, camera=camera, shoot=shoot, out=out)
    if json:
        import json as json_module

        print(json_module.dumps(facts, indent=1))
    elif not is_quiet():
        _show(facts)


def _show(facts: dict[str, Any]) -> None:
    """Print the plan as tables."""
    from rich.console import Console

    from rgbn.text_tables import fact_table, number_table
    from shoot.plan.plan_page import answer_of

    flashes = number_table(
        "flashes, the most useful first",
        ("no.", "from axis", "o'clock", "height mm", "aside mm", "error after", "minutes"),
        [
            (
                f"{row['number']}",
                f"{row['from_axis_deg']:.0f}°",
                row["clock"],
                f"{row['height_mm']:.0f}",
                f"{row['aside_mm']:.0f}",
                "" if row["error_median_deg"] is None else f"{row['error_median_deg']:.2g}°",
                "there" if row["is_there"] else f"{row['minutes']:.0f}",
            )
            for row in facts["flashes"]
        ],
    )
    balls = number_table(
        "balls",
        ("", "diameter mm", "radius px", "right mm", "up mm"),
        [
            (
                ball["kind"],
                f"{ball['diameter_mm'] or float('nan'):g}",
                *(f"{ball[name]:.0f}" for name in ("radius_px", "right_mm", "up_mm")),
            )
            for ball in facts["balls"]
        ],
        words=1,
    )
    lights, folder = facts["lights"], Path(facts["folder"])
    rows = [
        (
            "lights",
            f"directions to {lights['direction_sigma_deg']:.2g}°, positions to {lights['position_sigma_mm']:.2g} mm",
        ),
    ]
    console = Console()
    for part in (flashes, balls, fact_table("", rows)):
        console.print(part)
    for name in ("plan.html", "plan.json"):
        # As they are, to be copied: a long path is not wrapped.
        print(f"written  {folder / name}")
    console.print(answer_of(facts))
    for text in facts["warnings"]:
        console.print(f"warning: {text}", style="yellow")
