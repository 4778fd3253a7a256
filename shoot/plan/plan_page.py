"""A plan's facts, with their units in their names: as plan.json, as tables, in words, and as one page to print."""

from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from compare.report.page import table
from draw.light_charts import directions
from lab.terminal_tables import cells_of
from scene.files import plain
from scene.lights import known_median
from shoot.plan.set_up import EXPOSURE, GOOD_PX, LEAST_PX
from shoot.plan.shoot_plan import ShootPlan

TEMPLATE = Path(__file__).parent / "plan_page.html"
MOST_ROWS = 36
"""Flashes in the page's table: a page has no room for more; plan.json has all."""
FLASHES = {
    "no.": "{number}", "from axis": "{zenith_deg:0}°", "o'clock": "{clock}", "height, cm": "{height_cm:0}",
    "aside, cm": "{aside_cm:0}", "error after": "{error_median_deg:2}°", "": "{there}",
}  # fmt: skip
BALLS = {
    "ball": "{kind}", "diameter": "{diameter_mm:g} mm", "right, cm": "{right_cm:0}", "up, cm": "{up_cm:0}",
    "radius": "{radius_px:0} px",
}  # fmt: skip
"""Right and up: from the object's middle, as the camera sees it."""


def plan_facts(plan: ShootPlan) -> dict[str, Any]:
    """Return the plan."""
    set_up, result = plan.so_far.pixels.set_up, plan.predicted[-1]
    camera, middle = set_up.camera, set_up.middle_mm
    if result is not None and result.error_deg >= 90:
        result = None
    rows = plan.lights.facts()["frames"]
    for number, (row, predicted) in enumerate(zip(rows, plan.predicted, strict=True), 1):
        away = row["position_mm"] - middle
        row |= {
            "number": number,
            "there": "there" if number <= len(plan.so_far.lights) else "",
            "clock": clock(row["azimuth_deg"]),
            "height_cm": (row["position_mm"][2] - set_up.table_mm) / 10,
            "aside_cm": np.hypot(*away[:2]) / 10,
            "error_median_deg": None if predicted is None or predicted.error_deg >= 90 else predicted.error_deg,
        }
    balls = []
    for sphere in plan.so_far.spheres:
        # Where a ball of unknown size stands nobody knows.
        if sphere.diameter_mm:
            right, up, _ = (sphere.center_mm(camera) - middle) / 10
            told = {"kind": sphere.kind, "diameter_mm": sphere.diameter_mm, "radius_px": sphere.radius_px}
            balls.append(told | {"center_px": sphere.center_px, "right_cm": right, "up_cm": up})
    facts = {
        "flashes": rows,
        "there": len(plan.so_far.lights),
        "error_median_deg": None if result is None else result.error_deg,
        "by_noise_deg": None if result is None else np.median(result.by_noise_deg),
        "by_lights_deg": None if result is None else np.median(result.by_lights_deg),
        "lights_sigma_deg": known_median(plan.lights.direction_sigma_deg),
        "balls": balls,
        "camera": {"width": camera.width, "height": camera.height, "distance_mm": np.linalg.norm(middle)},
        "object": {
            "size_mm": set_up.size_mm,
            "mm_per_px": None if camera.is_orthographic else -middle[2] / camera.fx,
            "albedo": set_up.albedo,
        },
        "flash_mm": np.median([row["distance_mm"] for row in rows]),
        "white_ball_value": EXPOSURE,
        "said": set_up.said,
        "warnings": _warnings(plan),
    }
    return plain(facts)


def clock(azimuth_deg: float) -> str:
    """Return an azimuth, 0 right and 90 up, as the hour on a clock's face, to a quarter: 12:00 is up."""
    quarters = round(((90 - azimuth_deg) % 360) / 7.5) % 48
    return f"{(quarters // 4) or 12}:{15 * (quarters % 4):02d}"


def _warnings(plan: ShootPlan) -> list[str]:
    """Return what is to be looked at before the shoot."""
    found, result = [], plan.predicted[-1]
    if result is not None and (told := float((result.sigma_deg < 90).mean())) < 0.995:
        found.append(
            f"{1 - told:.1%} of the object is lit by fewer than three of the flashes, and has no normal: lower "
            "flashes (--to-deg), or a second view."
        )
    smallest = min((sphere.radius_px for sphere in plan.so_far.spheres), default=LEAST_PX)
    if smallest < LEAST_PX:
        found.append(
            f"balls of {smallest:.0f} px in radius are not found surely: {LEAST_PX:g} px are needed, {GOOD_PX:g} are "
            "good. Larger balls, or a nearer camera."
        )
    depth = float(np.ptp(plan.so_far.pixels.points[:, 2]))
    nearest = min(row["distance_mm"] for row in plan.lights.facts()["frames"])
    if depth > 0.1 * nearest:
        found.append(
            f"the object is {depth:.0f} mm deep under flashes {nearest:.0f} mm away. Solve with --method near, which "
            "knows its depth; others add degrees of error that do not go away with more flashes."
        )
    return found


def answer_of(facts: dict[str, Any]) -> str:
    """Return what the plan gives, in a few sentences."""
    flashes, there, error = facts["flashes"], facts["there"], facts["error_median_deg"]
    many = f"{there} flashes are there, {len(flashes) - there} more" if there else f"{len(flashes)} flashes"
    if error is None:
        return f"{many}: too few to tell the normals."
    text = (
        f"{many}: normals to {error:.2g}° (median error to be expected, of a matte surface, shadows left out), by the "
        f"photographs' noise {facts['by_noise_deg']:.2g}° and by what the balls leave unknown of the lights "
        f"{facts['by_lights_deg']:.2g}° a tangent axis."
    )
    if 0 < there < len(flashes):
        now, row = flashes[there - 1]["error_median_deg"], flashes[there]
        gain = f", which brings {now:.2g}° to {row['error_median_deg']:.2g}°" if now else ""
        text += f" Next: {row['zenith_deg']:.0f}° from the axis at {row['clock']} o'clock{gain}."
    return text


def lights_of(facts: dict[str, Any]) -> str:
    """Return how well the directions of the lights are told."""
    sigma = facts["lights_sigma_deg"]
    if sigma is None:
        return "How far the lights' directions are off is not known, and the error counts nothing of it."
    return f"Directions of the lights at the object to {sigma:.2g}° (one standard deviation)."


def plan_page(facts: dict[str, Any]) -> str:
    """Return the page of a plan's facts."""
    template = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    rows = [row for row in facts["flashes"] if not row["there"] or len(facts["flashes"]) <= MOST_ROWS]
    tables = {"flashes": cells_of(FLASHES, rows[:MOST_ROWS]), "balls": cells_of(BALLS, facts["balls"])}
    return template.from_string(TEMPLATE.read_text("utf-8")).render(
        facts,
        answer=answer_of(facts),
        dome=directions({"frames": facts["flashes"]}),
        tables={name: table(list(cells), zip(*cells.values(), strict=True)) for name, cells in tables.items()},
        left_out=len(rows) - MOST_ROWS,
        lights_told=lights_of(facts),
    )
