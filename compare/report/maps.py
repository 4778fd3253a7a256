"""The report's maps of the object: normals and errors."""

from html import escape

import numpy as np

from compare.report import charts, pictures
from compare.report.facts import Material, Summary, by_error, doubts_of
from compare.report.page import absent, folded, is_number, picture, say, section
from compare.report.pictures import Box
from scene.map_pictures import known_pixels

MAP_WIDTH = 440
FEW_METHODS = 4
"""With more, maps stand closer, and the twin's normals are folded away."""
MAPS_PIXELS = 2_400_000
"""Of all maps together: noise does not compress, and the page is to stay below 15 megabytes."""


def normals_section(material: Material) -> str:
    """Return the truth's and every method's normals as colours, with the ball to read them by."""
    names = material.methods
    box, width = map_box(material)

    def maps(place: str, words: dict[str, str]) -> str:
        there = {name: normals for name in words if (normals := material.map_of(place, name)) is not None}
        return "".join(
            picture(
                pictures.normal_picture(box.of(normals), width),
                f"normals, {words[name]}",
                escape(words[name]),
                kind="map",
            )
            for name, normals in there.items()
        )

    figures = maps("normals", {"truth": "ground truth"} | {name: f"{name}, photographs" for name in names})
    on_twin = maps("twin/normals", {name: f"{name}, twin" for name in names})
    many = len(names) > FEW_METHODS
    figures += "" if many else on_twin
    if not figures:
        return section("normals", "Normals", absent("No normals are in this folder."))
    ball = picture(
        pictures.legend_ball(180),
        "a ball coloured like the normals",
        say("maps", "ball"),
        kind="map key-ball",
    )
    lead = say("maps", "normals" if material.map_of("normals", "truth") is not None else "normals without truth")
    body = f'<div class="gallery{" many" if many else ""}">{ball}{figures}</div>'
    if many and on_twin:
        body += folded("The same methods on the twin", f'<div class="gallery many">{on_twin}</div>')
    return section("normals", "Normals", body, lead)


def map_box(material: Material) -> tuple[Box, int]:
    """Return the part of the maps that shows the object, and how wide it is shown."""
    shape = material.mask
    if shape is None:
        maps = (material.map_of("normals", name) for name in ("truth", *material.methods))
        there = next((normals for normals in maps if normals is not None), None)
        shape = np.ones((1, 1), bool) if there is None else known_pixels(there)
    box = Box.of_mask(shape, margin=0.03)
    return box, box.shown_width(MAP_WIDTH, count=1 + 4 * len(material.methods), total=MAPS_PIXELS)


def errors_section(material: Material, summary: Summary) -> str:
    """Return error maps, real beside twin, on one colour scale, and their histogram."""
    compared = summary.get("compare") or {}
    end, title = compared.get("error_scale_deg"), "Where the errors are"
    if not is_number(end):
        return section("errors", title, absent(say("maps", "no error" if compared.get("has_truth") else "no truth")))
    methods, names, rows = compared["methods"], by_error(compared), []
    any_twin = any(row.get("twin") for row in methods.values())
    box, width = map_box(material)
    for name in names:
        row, cells = methods[name], ""
        for kind, words in {"real": "photographs", "twin": "twin"}.items() if any_twin else [("real", "photographs")]:
            error, found = material.map_of("compare", f"error_{kind}_{name}"), row.get(kind)
            if error is None or not found:
                reason = "not rendered, or not solved on the twin" if kind == "twin" else "no normals here"
                cells += f'<figure class="map">{absent(f"{name}, {words}: {reason}.")}</figure>'
                continue
            image = pictures.error_picture(pictures.shrink(box.of(error), width), end)
            caption = say("maps", "error", name=name, on=words, **found)
            cells += picture(image, f"error map, {name}, {words}", caption, kind="map")
        if doubts_of(summary, name):
            cells += '<p class="alike"><a href="#verdict">It doubts itself</a>.</p>'
        if is_number(row.get("pearson")):
            cells += say("maps", "alike", **row)
        rows.append(cells)
    if any_twin:
        shown = error_pairs(rows, many=len(names) > FEW_METHODS)
    else:
        many = " many" if len(names) > FEW_METHODS else ""
        shown = f'<div class="errors{many}">{"".join(f"<div>{row}</div>" for row in rows)}</div>'
        shown += absent("No twin was solved: no map to lay beside these.")
    body = colour_scale(end) + shown + charts.error_histograms(compared, names)
    return section("errors", title, body, say("maps", "errors", end=end))


def error_pairs(rows: list[str], *, many: bool) -> str:
    """Return pairs of maps, real beside twin, one pair below or, if many, beside the other."""
    pairs = "".join(f'<div class="errors">{row}</div>' for row in rows)
    return f'<div class="error-pairs{" many" if many else ""}">{pairs}</div>'


def colour_scale(end: float) -> str:
    """Return the key of error colours, 0 to `end` degrees."""
    stops = ", ".join(f"rgb{colour}" for colour in pictures.error_scale_colours(17))
    ticks = "".join(f"<span>{end * part / 4:g}°{' and more' if part == 4 else ''}</span>" for part in range(5))
    return (
        f'<div class="scale" role="img" aria-label="colour scale, 0 to {end:g} degrees">'
        f'<div class="ramp" style="background: linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks">{ticks}</div></div>'
    )
