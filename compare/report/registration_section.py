"""The report's section on the registration: outline, slider, zooms, checkerboard, sigma."""

from contextlib import suppress
from html import escape

import numpy as np
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.facts import Material, Summary
from compare.report.maps import colour_scale
from compare.report.pictures import Box, Image
from compare.report.registration_pictures import (
    Views,
    growth,
    raking_frame,
    read_picture,
    sigma_picture,
    sigma_scale_end,
    views,
)
from scene.errors import SceneError
from scene.map_pictures import data_uri, known_pixels

TITLE = "The object in the photographs"
PHOTOGRAPH_WIDTH = 1000


def registration_section(material: Material, summary: Summary) -> str:
    """Return pictures that show whether the scan lies where the object is, and the numbers that say so."""
    frames, mask, truth = material.frames, material.mask, material.map_of("normals", "truth")
    if frames is None or (mask is None and truth is None):
        return page.section(
            "registration", TITLE, page.absent("No scan and no mask: nothing to lay over the photographs.")
        )
    size = (frames.height, frames.width)
    truth = truth if truth is not None and truth.shape[:2] == size else None
    known = None if truth is None else known_pixels(truth)
    mask = mask if mask is not None and mask.shape == size else None
    shape = mask if mask is not None else known
    if shape is None:
        return page.section("registration", TITLE, page.absent(page.words("registration")["sizes"]))
    box = Box.of_mask(shape, margin=0.12)
    registered = material.store.path("pose.json").exists()
    index = 0 if material.directions is None else raking_frame(material.directions[: len(frames)])
    drawn, zoom = (read_picture(material.store, name) if registered else None for name in ("outline", "outline_zoom"))
    regions = [(mask, "mask", "the object's mask")]
    if drawn is None:
        # Where the outline itself is not there to a fraction of a pixel, the truth ends a pixel inside it. The dashed
        # line last: where the two agree, the other shows between the dashes.
        what = "the registered scan's ground truth" if registered else "the given ground truth"
        regions.insert(0, (known, "scan", what))
        drawn = material.photograph(index, box, box.shown_width(PHOTOGRAPH_WIDTH))
        legend = []
    else:
        legend = ['<span class="key scan"></span> the registered scan']
    figures = _outlines(drawn, box, frames.names[index], regions, legend)
    both, squares = _views(material, box, index, truth), ""
    if both is not None:
        left, right = (data_uri(image, photograph=True) for image in both)
        shaded = "shaded scan" if registered else "shaded ground truth"
        caption = page.say("registration", "wiper" if registered else "wiper without scan", name=frames.names[index])
        figures += page.wiper((left, "photograph"), (right, shaded), caption)
        board = pictures.checkerboard(both.photograph, both.shaded)
        alt = "checkerboard of photograph and shaded scan"
        squares = page.picture(board, alt, page.say("registration", "squares"), photograph=True)
    body = "" if registered else page.absent("No scan was registered in this folder (there is no pose).")
    body += f'<div class="pair">{figures}</div>'
    if zoom is not None:
        caption = page.say("registration", "zoom")
        body += f"<h3>The outline, enlarged</h3>{page.picture(zoom, 'four stretches of the outline', caption)}"
    sigma = _sigma(material, box, mask)
    if squares or sigma:
        title = "In squares, and how sure each normal is" if sigma else "In squares"
        body += f'<h3>{title}</h3><div class="pair">{squares}{sigma}</div>'
    return page.section("registration", TITLE, body + _facts(summary))


def _outlines(
    image: Image, box: Box, name: str, regions: list[tuple[NDArray[np.bool_] | None, str, str]], legend: list[str]
) -> str:
    """Return a photograph with the outlines of regions (mask, its class, its words) and its legend."""
    shapes = ""
    for region, kind, shown in regions:
        if region is not None and region.any():
            shapes += "".join(page.polyline(line, kind) for line in pictures.contours(region, box))
            legend.append(f'<span class="key {kind}"></span> {shown}')
    overlay = page.drawing(box.width, box.height, shapes, label="outline of the object")
    caption = f"{escape(name)} with the outline of {'; '.join(legend)}."
    return page.picture(image, "photograph with the object's outline", caption, photograph=True, overlay=overlay)


def _views(material: Material, box: Box, index: int, truth: NDArray | None) -> Views | None:
    """Return what `align` drew; without it, shading by the truth's normals, which knows no cast shadows."""
    photograph, shaded = (read_picture(material.store, name) for name in ("photograph", "shaded"))
    if photograph is not None and shaded is not None and photograph.shape == shaded.shape:
        return Views(photograph, shaded)
    lights = None
    with suppress(SceneError):
        lights = material.store.load_lights()
    if truth is None or lights is None or material.frames is None or material.exposure is None or index >= len(lights):
        return None
    cosine = np.clip(box.of(truth) @ lights.directions[index].astype(np.float32), 0, None)

    def shading(pixels: NDArray) -> NDArray:
        u, v = np.round(pixels).astype(int).transpose(2, 0, 1)
        return cosine[np.clip(v - box.top, 0, box.height - 1), np.clip(u - box.left, 0, box.width - 1)]

    return views(material.frames, material.exposure, lights, index, box, shading)


def _sigma(material: Material, box: Box, mask: NDArray[np.bool_] | None) -> str:
    """Return the map of the ground truth's sigma, where it has one."""
    sigma = material.map_of("normals", "truth_sigma")
    if sigma is None or mask is None or sigma.shape != mask.shape or not np.isfinite(sigma).any():
        return ""
    end = sigma_scale_end(sigma)
    small = pictures.shrink(box.of(sigma), box.shown_width(PHOTOGRAPH_WIDTH // 2))
    image = sigma_picture(small, box.of(mask), end)
    image = pictures.enlarged(image, max(1, growth(image.shape[1]) // 2))
    figure = page.picture(image, "map of the ground truth’s sigma", page.say("registration", "sigma"), kind="map")
    return f"<div>{figure}{colour_scale(end)}</div>"


def _facts(summary: Summary) -> str:
    """Return the registration's numbers as a table."""
    align = summary.get("align") or (summary.get("compare") or {}).get("pose") or {}
    values = {**(align.get("fit") or {}), **align}
    facts = page.words("tables")["registration"]
    rows = [
        (what, page.Sentence().format(text, values[key]))
        for what, key, text in facts
        if page.is_number(values.get(key))
    ]
    return page.table(("registration", "found"), rows, kind="plain") if rows else ""
