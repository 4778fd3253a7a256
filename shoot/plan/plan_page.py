"""A plan as one page to print: what it gives, where all stands, exposure, checklist."""

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from shoot.plan.plan_drawing import error_chart, top_view

TEMPLATE = Path(__file__).parent / "plan_page.html"
MOST_ROWS = 36
"""Flashes in the page's table: a page has no room for more; plan.json has all."""


def plan_page(facts: dict[str, Any]) -> str:
    """Return the page of a plan's facts; see `shoot.plan.plan_facts`."""
    return Template(TEMPLATE.read_text("utf-8")).substitute(
        title=escape(facts["name"]),
        answer=escape(answer_of(facts)),
        warnings="".join(f'<p class="warn">{escape(text)}</p>' for text in facts["warnings"]),
        view=top_view(facts),
        legend=escape(_legend(facts)),
        chart=error_chart(facts),
        flashes=_flash_table(facts),
        balls=_ball_table(facts),
        exposure=_items(_exposure(facts)),
        checklist=_items(_checklist(facts), tick=True),
        said=escape("Taken for granted: " + "; ".join(facts["said"]) + "."),
    )


def answer_of(facts: dict[str, Any]) -> str:
    """Return what the plan gives, in two or three sentences."""
    count, there, predicted = len(facts["flashes"]), facts["there"], facts["predicted"]
    new = count - there
    so_far = f"{there} flashes are there, " if there else ""
    many = f"{new} more" if there else f"{new} flashes"
    if predicted is None:
        return f"{so_far}{many}: too few to tell the normals."
    text = (
        f"{so_far}{many}, {facts['minutes']:.0f} minutes: normals to {predicted['error_median_deg']:.2g}° (median "
        f"error to be expected), by the photographs' noise {predicted['by_noise_deg']:.2g}° and by what the balls "
        f"leave unknown of the lights {predicted['by_lights_deg']:.2g}° a tangent axis."
    )
    accuracy, stop = facts["accuracy_deg"], facts["stop_after"]
    if accuracy and stop is not None:
        text += f" Stop after flash {max(stop, there)}: {accuracy:g}° are reached."
    elif accuracy:
        text += f" {accuracy:g}° are not reached."
    if facts["helps_until"] < count:
        text += f" From flash {facts['helps_until']} on each one lowers the error by less than 1 %."
    elif there and facts["next_flashes"]:
        text += _next_words(facts)
    return text


def _next_words(facts: dict[str, Any]) -> str:
    first, now = facts["flashes"][facts["there"] :], facts["flashes"][facts["there"] - 1]["error_median_deg"]
    row = (first or facts["next_flashes"])[0]
    where = f"{row['from_axis_deg']:.0f}° from the axis at {row['clock']} o'clock"
    if now is None or row["error_median_deg"] is None:
        return f" Next: {where}."
    return f" Next: {where}, which brings {now:.2g}° to {row['error_median_deg']:.2g}°."


def _legend(facts: dict[str, Any]) -> str:
    reach = facts["reach"]
    distance = f"{reach['distance_mm'] / 10:.0f} cm from the object's middle"
    grey = " Grey flashes are there already." if facts["there"] else ""
    return (
        f"To scale. Blue: flashes, {distance}; the number below each is its height over the table, cm (the table is "
        "taken to face the camera: else read it as cm toward the camera). Rings: degrees from the camera's axis. C: "
        f"chrome ball, W: white.{grey}"
    )


def _flash_table(facts: dict[str, Any]) -> str:
    heads = ("no.", "from axis", "o'clock", "height, cm", "aside, cm", "error after")
    rows = [
        (
            f"{row['number']}{' (there)' if row['is_there'] else ''}",
            f"{row['from_axis_deg']:.0f}°",
            row["clock"],
            f"{row['height_mm'] / 10:.0f}",
            f"{row['aside_mm'] / 10:.0f}",
            "" if row["error_median_deg"] is None else f"{row['error_median_deg']:.2g}°",
        )
        for row in facts["flashes"]
        if not row["is_there"] or len(facts["flashes"]) <= MOST_ROWS
    ]
    more = f'<p class="soft">and {len(rows) - MOST_ROWS} more, in plan.json</p>' if len(rows) > MOST_ROWS else ""
    return _table(heads, rows[:MOST_ROWS]) + more


def _ball_table(facts: dict[str, Any]) -> str:
    rows = []
    for number, ball in enumerate(facts["balls"], 1):
        side = "right" if ball["right_mm"] >= 0 else "left"
        height = "up" if ball["up_mm"] >= 0 else "down"
        rows.append(
            (
                f"{'C' if ball['kind'] == 'chrome' else 'W'}{number} {ball['kind']}",
                f"{ball['diameter_mm']:g} mm" if ball["diameter_mm"] else "unknown",
                f"{abs(ball['right_mm']) / 10:.0f} {side}, {abs(ball['up_mm']) / 10:.0f} {height}",
                f"{ball['radius_px']:.0f} px",
            )
        )
    lights = facts["lights"]
    text = (
        f"Directions at the object to {lights['direction_sigma_deg']:.2g}°, positions to "
        f"{lights['position_sigma_mm']:.2g} mm, intensities to {lights['intensity_sigma']:.1%} (one standard "
        "deviation)."
    )
    return _table(("ball", "diameter", "from the middle, cm", "radius"), rows) + f'<p class="soft">{text}</p>'


def _exposure(facts: dict[str, Any]) -> list[str]:
    exposure, camera = facts["exposure"], facts["camera"]
    first = f"White ball's brightest point at {exposure['white_ball_value']:.0%} of white under a usual flash."
    if facts["there"]:
        first = "As in the frames that there are: nothing is changed."
    return [
        first,
        f"Camera {camera['distance_mm'] / 10:.0f} cm from the object's middle; a pixel shows "
        f"{camera['mm_per_px']:.2g} mm.",
        f"Object: {facts['object']['size_mm']:.0f} mm across; its surface is taken for {facts['object']['gloss']}.",
        "RAW; exposure, ISO, aperture, focus, white balance and flash power by hand.",
    ]


def _checklist(facts: dict[str, Any]) -> list[str]:
    sizes = ", ".join(dict.fromkeys(f"{b['diameter_mm']:g}" for b in facts["balls"] if b["diameter_mm"]))
    shaded = [n for n, ball in enumerate(facts["balls"], 1) if (ball["shaded_share"] or 0) > 0]
    low = max(facts["flashes"], key=lambda row: row["from_axis_deg"])["number"]
    hidden = f" (ball {', '.join(map(str, shaded))} lies in the object's shadow from some)" if shaded else ""
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


def _items(texts: Iterable[str], *, tick: bool = False) -> str:
    box = '<span class="tick"></span>' if tick else ""
    return "".join(f"<li>{box}{escape(text)}</li>" for text in texts)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
