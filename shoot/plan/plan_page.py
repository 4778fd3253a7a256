"""A plan for people: its answer in words, its tables, and one page to print."""

from pathlib import Path
from typing import Any

from shoot.plan.plan_drawing import error_chart, top_view
from shoot.plan.plan_facts import brief

TEMPLATE = Path(__file__).parent / "plan_page.html"
MOST_ROWS = 36
"""Flashes in the page's table: a page has no room for more; plan.json has all."""
FLASH_HEADS = ("no.", "from axis", "o'clock", "height, cm", "aside, cm", "error after", "minutes")
BALL_HEADS = ("ball", "diameter", "from the middle, cm", "radius")


def plan_page(facts: dict[str, Any]) -> str:
    """Return the page of a plan's facts; see `shoot.plan.plan_facts`."""
    from jinja2 import Environment, StrictUndefined

    template = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    rows = [row for row in facts["flashes"] if not row["is_there"] or len(facts["flashes"]) <= MOST_ROWS]
    return template.from_string(TEMPLATE.read_text("utf-8")).render(
        facts,
        answer=answer_of(facts),
        view=top_view(facts),
        chart=error_chart(facts),
        flash_heads=FLASH_HEADS,
        flash_rows=flash_rows(rows),
        most_rows=MOST_ROWS,
        ball_heads=BALL_HEADS,
        ball_rows=ball_rows(facts),
        lights_told=lights_of(facts),
        checklist=_checklist(facts),
    )


def answer_of(facts: dict[str, Any]) -> str:
    """Return what the plan gives, in two or three sentences."""
    count, there, predicted = len(facts["flashes"]), facts["there"], facts["predicted"]
    many = f"{there} flashes are there, {count - there} more" if there else f"{count} flashes"
    if predicted is None:
        return f"{many}: too few to tell the normals."
    text = (
        f"{many}, {facts['minutes']:.0f} minutes: normals to {brief(predicted['error_median_deg'])}° (median error to "
        f"be expected, gloss and shadows left out), by the photographs' noise {brief(predicted['by_noise_deg'])}° and "
        f"by what the balls leave unknown of the lights {brief(predicted['by_lights_deg'])}° a tangent axis."
    )
    accuracy, stop = facts["accuracy_deg"], facts["stop_after"]
    if accuracy and stop is not None:
        text += f" Stop after flash {max(stop, there)}: {accuracy:g}° are reached."
    elif accuracy:
        text += f" {accuracy:g}° are not reached."
    if facts["helps_until"] < count:
        text += f" From flash {facts['helps_until']} on each one lowers the error by less than 1 %."
    elif there and facts["next_flashes"]:
        row = [*facts["flashes"][there:], *facts["next_flashes"]][0]
        now, then = facts["flashes"][there - 1]["error_median_deg"], row["error_median_deg"]
        gain = "" if now is None or then is None else f", which brings {brief(now)}° to {brief(then)}°"
        text += f" Next: {row['from_axis_deg']:.0f}° from the axis at {row['clock']} o'clock{gain}."
    return text


def flash_rows(flashes: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the cells of a table of flashes, below `FLASH_HEADS`."""
    return [
        (
            str(row["number"]),
            f"{row['from_axis_deg']:.0f}°",
            row["clock"],
            f"{row['height_mm'] / 10:.0f}",
            f"{row['aside_mm'] / 10:.0f}",
            "" if not (row["error_median_deg"] or 90) < 90 else f"{brief(row['error_median_deg'])}°",
            "there" if row["is_there"] else f"{row['minutes']:.0f}",
        )
        for row in flashes
    ]


def ball_rows(facts: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return the cells of the table of the balls, below `BALL_HEADS`."""
    rows = []
    for number, ball in enumerate(facts["balls"], 1):
        side, height = ("right", "left")[ball["right_mm"] < 0], ("up", "down")[ball["up_mm"] < 0]
        rows.append(
            (
                f"{ball['kind'][0].upper()}{number} {ball['kind']}",
                f"{ball['diameter_mm']:g} mm",
                f"{abs(ball['right_mm']) / 10:.0f} {side}, {abs(ball['up_mm']) / 10:.0f} {height}",
                f"{ball['radius_px']:.0f} px",
            )
        )
    return rows


def lights_of(facts: dict[str, Any]) -> str:
    """Return how well the balls tell the lights."""
    lights = facts["lights"]
    known = {name: None if value is None else brief(value) for name, value in lights.items()}
    return (
        f"Directions at the object to {known['direction_sigma_deg']}°, positions to {known['position_sigma_mm']} mm, "
        f"intensities to {lights['intensity_sigma']:.1%} (one standard deviation)."
    )


def _checklist(facts: dict[str, Any]) -> list[str]:
    sizes = ", ".join(dict.fromkeys(f"{ball['diameter_mm']:g}" for ball in facts["balls"]))
    shaded = [str(n) for n, ball in enumerate(facts["balls"], 1) if ball["shaded_share"]]
    low = max(facts["flashes"], key=lambda row: row["from_axis_deg"])["number"]
    hidden = f" (ball {', '.join(shaded)} lies in the object's shadow from some)" if shaded else ""
    return [
        "Tripod fixed, stabiliser off; nothing is touched until the last frame",
        f"Balls clean, whole in the picture; diameters measured with calipers ({sizes} mm planned)",
        "Room dark; focus on the object, then off",
        f"Test frame from flash {low}, the lowest: no ball in shadow{hidden}",
        "Test frame from the nearest flash: white ball not clipped",
        "Flash off: 1 photograph, again after the last flash",
        "Each flash: within 10 cm and 5° of its place is enough, the balls tell where it was",
        "Flash charged before each frame; hand and cable not in the picture",
        "If time runs out, stop anywhere: the flashes are in the order of their use",
        "rgbn check on the photographs before anything is taken down",
    ]
