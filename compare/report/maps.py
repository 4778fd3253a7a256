"""The report's maps of the object: normals, twin, errors."""

from contextlib import suppress
from html import escape

import numpy as np

from compare.report import charts, pictures
from compare.report.engine_chart import engine_chart
from compare.report.facts import by_error
from compare.report.material_words import material_words
from compare.report.page import absent, is_number, number, picture, section
from compare.report.pictures import Box, Exposure
from compare.report.registration_pictures import raking_frame
from compare.report.shown_material import Material, Summary
from compare.report.warned import doubts_of
from scene.errors import SceneError
from scene.store import Store

PHOTOGRAPH_WIDTH = 1000
MAP_WIDTH = 440
FEW_METHODS = 4
"""With more, maps stand closer, and the twin's normals are folded away."""
MAPS_PIXELS = 2_400_000
"""Of all maps together: noise does not compress, and the page is to stay below 15 megabytes."""


def normals_section(material: Material) -> str:
    """Return the truth's and every method's normals as colours, with the ball to read them by."""
    names = material.methods
    box = _map_box(material)

    def maps(place: str, rows: list[tuple[str, str]]) -> list[str]:
        figures = []
        for name, words in rows:
            normals = material.map_of(place, name)
            if normals is not None:
                image = pictures.normal_picture(normals[box.rows, box.columns], _map_width(material, box))
                uri = pictures.data_uri(image, photograph=False)
                figures.append(picture(uri, f"normals, {words}", escape(words), kind="map"))
        return figures

    figures = maps("normals", [("truth", "ground truth"), *((name, f"{name}, photographs") for name in names)])
    on_twin = maps("twin/normals", [(name, f"{name}, twin") for name in names])
    figures += on_twin if len(names) <= FEW_METHODS else []
    if not figures:
        return section("normals", "Normals", absent("No normals are in this folder."))
    ball = picture(
        pictures.data_uri(pictures.legend_ball(180), photograph=False),
        "a ball coloured like the normals",
        "the key: a ball facing you. Right side: normals to the right (+x); top: up (+y); middle: toward you (+z)",
        kind="map key-ball",
    )
    lead = "A pixel's colour is its normal's direction: find the same colour on the ball. Pale grey: unknown."
    if material.map_of("normals", "truth") is None:
        lead += " <b>There is no ground truth among them.</b>"
    many = " many" if len(names) > FEW_METHODS else ""
    body = f'<div class="gallery{many}">{ball}{"".join(figures)}</div>'
    if many and on_twin:
        folded = f'<div class="gallery many">{"".join(on_twin)}</div>'
        body += f"<details><summary>The same methods on the twin</summary>{folded}</details>"
    return section("normals", "Normals", body, lead)


def _map_box(material: Material) -> Box:
    if material.mask is not None:
        shape = material.mask
    else:
        maps = [m for name in ["truth", *material.methods] if (m := material.map_of("normals", name)) is not None]
        shape = pictures.known_pixels(maps[0]) if maps else np.ones((1, 1), bool)
    return Box.of_mask(shape, margin=0.03)


def _map_width(material: Material, box: Box) -> int:
    return box.shown_width(MAP_WIDTH, count=1 + 4 * len(material.methods), total=MAPS_PIXELS)


def errors_section(material: Material, summary: Summary) -> str:
    """Return error maps, real beside twin, on one colour scale, and their histogram."""
    compared = summary.get("compare") or {}
    end = compared.get("error_scale_deg")
    if not is_number(end):
        reason = (
            "No method's normals meet the ground truth."
            if compared.get("has_truth")
            else "No ground truth (no scan, no given normals): errors cannot be told."
        )
        return section("errors", "Where the errors are", absent(reason))
    box, rows = _map_box(material), []
    width = _map_width(material, box)
    any_twin = any(row.get("twin") for row in compared["methods"].values())
    names = by_error(compared)
    for name in names:
        row = compared["methods"][name]
        cells = []
        for kind, words in (("real", "photographs"), ("twin", "twin")):
            error = material.map_of("compare", f"error_{kind}_{name}")
            if (error is None or not row.get(kind)) and kind == "twin" and not any_twin:
                continue
            if error is None or not row.get(kind):
                reason = "not rendered, or not solved on the twin" if kind == "twin" else "no normals here"
                cells.append(f'<figure class="map">{absent(f"{name}, {words}: {reason}.")}</figure>')
                continue
            image = pictures.error_picture(pictures.shrink(error[box.rows, box.columns], width), end)
            caption = (
                f"<b>{escape(name)}</b>, {words}: median {number(row[kind]['median_deg'], 2, '°')}, "
                f"mean {number(row[kind]['mean_deg'], 2, '°')}"
            )
            uri = pictures.data_uri(image, photograph=False)
            cells.append(picture(uri, f"error map, {name}, {words}", caption, kind="map"))
        alike = ""
        if is_number(row.get("pearson")):
            alike = (
                f'<p class="alike">Pearson {number(row["pearson"], 2)}, Spearman {number(row.get("spearman"), 2)} over '
                f"{number(row.get('correlation_pixels'))} pixels; median real − twin "
                f"{number(row.get('median_difference_deg'), 2, '°')}.</p>"
            )
        if doubts_of(summary, name):
            alike = '<p class="alike"><a href="#verdict">It doubts itself</a>.</p>' + alike
        rows.append("".join(cells) + alike)
    many = " many" if len(names) > FEW_METHODS else ""
    if any_twin:
        pairs = "".join(f'<div class="errors">{row}</div>' for row in rows)
        shown = f'<div class="error-pairs{many}">{pairs}</div>'
    else:
        maps = "".join(f"<div>{row}</div>" for row in rows)
        shown = f'<div class="errors{many}">{maps}</div>' + absent("No twin was solved: no map to lay beside these.")
    body = colour_scale(end) + shown + charts.error_histograms(compared, names)
    lead = f"One colour scale for all maps, 0° to {number(end, 0, '°')}; everything beyond has its last colour."
    return section("errors", "Where the errors are", body, lead)


def colour_scale(end: float) -> str:
    """Return the key of error colours, 0 to `end` degrees."""
    stops = ", ".join(f"rgb{colour}" for colour in pictures.error_scale_colours(17))
    ticks = "".join(f"<span>{end * part / 4:g}°{' and more' if part == 4 else ''}</span>" for part in range(5))
    return (
        f'<div class="scale" role="img" aria-label="colour scale, 0 to {end:g} degrees">'
        f'<div class="ramp" style="background: linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks">{ticks}</div></div>'
    )


def twin_section(material: Material, summary: Summary) -> str:
    """Return one photograph beside the twin's frame of the same light."""
    twin, frames = None, material.frames
    with suppress(SceneError):
        twin = Store(material.store.path("twin")).load_frames()
    if twin is None or len(twin) == 0:
        reason = (
            "No twin was rendered: it needs the registered scan."
            if material.map_of("normals", "truth") is None or not material.store.path("pose.json").exists()
            else "No twin was rendered in this folder."
        )
        return section("twin", "The twin", absent(reason))
    index = 0 if material.directions is None else raking_frame(material.directions[: len(twin)])
    box = Box(0, 0, twin.width, twin.height)
    if material.mask is not None and material.mask.shape == (twin.height, twin.width):
        box = Box.of_mask(material.mask, margin=0.12)
    balance = None if material.exposure is None else material.exposure.balance
    width = box.shown_width(PHOTOGRAPH_WIDTH // 2)
    linear = pictures.thumbnail(twin, index, width, box)
    image = pictures.data_uri(Exposure.for_frames(twin, white_value=balance).develop(linear), photograph=True)
    name = escape(twin.names[index])
    figures = picture(image, f"twin of {twin.names[index]}", f"twin, {name}; its brightness scaled by itself")
    if frames is not None and (twin.width, twin.height) == (frames.width, frames.height) and index < len(frames):
        uri = pictures.data_uri(material.photograph(index, box, width), photograph=True)
        name = frames.names[index]
        figures = picture(uri, f"photograph {name}", f"photograph, {escape(name)}") + figures
    facts = summary.get("twin") or {}
    lead = (
        "The scan of the fitted material, rendered under the same light. What differs is what the twin does not know."
    )
    if facts.get("engine"):
        reason = f": {escape(str(facts['reason']))}" if facts.get("reason") else ""
        lead += f" {number(facts.get('seconds'), 1, 's')}, engine {escape(str(facts['engine']))}{reason}."
    return section(
        "twin", "The twin", f'<div class="pair">{figures}</div>{material_words(facts)}{engine_chart(facts)}', lead
    )
