"""`rgbn align --check`: the registration's residuals before and after it is refined again, and the cost around it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from lab.job import Job
from rgbn.text_tables import number_table
from scene.errors import AlignError
from scene.files import write_json


@contextmanager
def checked(job: Job, *, tell: bool) -> Iterator[None]:
    """Check the registration that was made in the block, and print what was found where `tell` says so."""
    yield
    with job.record.part_of("align"):
        found = check_alignment(job)
    if tell:
        tell_check(found)


def check_alignment(job: Job) -> dict[str, Any]:
    """Write OUT/align/check.json of a session that was aligned, and return it.

    Raises
    ------
    AlignError
        There is no registered scan.
    """
    from align.pose.photographed import Photographs
    from align.pose.pose_check import STEPS_PX, check_pose

    store = job.store
    if not store.path("pose.json").exists():
        raise AlignError(
            f"{job.session.folder}: no scan was registered, so there is nothing to check. Add scan under [object] to "
            "session.toml."
        )
    mesh = job.load_scan()
    pose, camera, frames, lights = store.load_pose(), store.load_camera(), store.load_frames(), store.load_lights()
    found = check_pose(mesh, pose, Photographs(camera, frames, lights, store.load_mask()))
    write_json(store.path("align", "check.json"), {"steps_px": STEPS_PX, **asdict(found)})
    return store.read_json("align/check.json")


def tell_check(result: dict[str, Any]) -> None:
    """Print what `check_alignment` found, for people at a terminal."""
    from rich.console import Console

    console, rows = Console(), []
    starts = zip(result["before"], result["after"], result["started_px"], result["returned_px"], strict=True)
    for number, (before, after, started, returned) in enumerate(starts):
        rows.append((f"start {number + 1}", f"{started:.2f}", *_residuals(before)))
        rows.append(("refined", f"{returned:.3f}", *_residuals(after)))
    rows.append(("the pose", "0", *_residuals(result["here"])))
    heads = ("", "from the pose, px", "outline, px", "shading, %", "normals, degrees")
    console.print(number_table("Started beside the pose, and refined again", heads, rows))
    along, steps = result["along"], result["steps_px"]
    middle = steps.index(0.0)
    costs = [[f"{cost / max(row['cost'][middle], 1e-12):.2f}" for cost in row["cost"]] for row in along]
    heads = ("px", *(row["axis"].replace("about ", "").replace("along ", "") for row in along))
    around = number_table(
        "The cost around the pose, relative to the cost at it",
        heads,
        ((f"{step:+g}", *row) for step, *row in zip(steps, *costs, strict=True)),
    )
    around.add_section()
    least = (row["minimum_px"] for row in along)
    around.add_row("least at", *("–" if value is None else f"{value:+.2f}" for value in least))
    around.add_row("sigma", *(f"{row['sigma_px']:.2f}" for row in along))
    around.add_row("1 px is", *(f"{row['per_px']:.3g} {row['unit']}" for row in along))
    console.print(around)
    off = [row["axis"] for row in along if min(row["cost"]) < row["cost"][middle]]
    console.print(f"The cost is lower elsewhere: {', '.join(off)}." if off else "The cost is lowest at the pose.")


def _residuals(row: dict[str, float | None]) -> list[str]:
    formats = (("outline_px", 1, ".3f"), ("shading", 100, ".1f"), ("normals_deg", 1, ".2f"))
    values = ((row[name], factor, form) for name, factor, form in formats)
    return ["–" if value is None else format(factor * value, form) for value, factor, form in values]
