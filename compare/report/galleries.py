"""The report's pictures of the capture: frames, balls, lights."""

from contextlib import suppress
from html import escape
from itertools import zip_longest

import numpy as np

from compare.report import page, pictures
from compare.report.facts import Material, Summary, read_optional
from compare.report.layers import Layers
from draw import light_charts
from scene.errors import SceneError
from scene.spheres import Sphere

BALL_WIDTH = 420


def frames_section(material: Material, layers: Layers | None, summary: Summary) -> str:
    """Return the photographs of the object, one brightness scale for all, and each frame's facts as a table."""
    frames, capture, title = material.frames, summary.get("capture") or {}, "The photographs"
    if frames is None or layers is None:
        return page.section("frames", title, page.absent("The decoded frames are not in this folder any more."))
    facts = {row.get("name"): row for row in capture.get("frames_table") or []}
    rows = [
        {"number": str(index + 1), "name": name, **(facts.get(name) or {})} for index, name in enumerate(frames.names)
    ]
    lead = page.say("frames", "count", **capture) if page.is_number(capture.get("frames")) else ""
    lead += page.say("frames", "size", **capture) if capture.get("width") else ""
    lead += page.say("frames", {None: "not told", False: "none"}.get(capture.get("ambient"), "ambient"))
    lead += page.say("frames", "lead")
    body = f'<div class="sheet">{layers.html("photograph", "real")}</div>'
    body += page.table_of("frames", rows) if facts else ""
    return page.section("frames", title, body, lead)


def balls_section(material: Material) -> str:
    """Return each ball's crop with its fitted outline and highlights."""
    title = "The calibration balls"
    if not material.spheres:
        return page.section("balls", title, page.absent(page.words("balls")["none"]))
    calibration = read_optional(material.store, "calibration.json") or {}
    highlights = calibration.get("highlights_px") or []
    spheres = []
    with suppress(SceneError):
        spheres = material.store.load_spheres()
    rows = zip_longest(range(len(material.spheres)), spheres, highlights)
    figures = "".join(_ball(material, *row) for row in rows if row[0] is not None)
    body = f'<div class="gallery">{figures}</div>'
    if rejected := calibration.get("rejected"):
        rows = "".join(f"<li>{escape(_sentence(item))}</li>" for item in rejected)
        body += f"<h3>Candidates that were refused</h3><ul>{rows}</ul>"
    return page.section("balls", title, body, page.say("balls", "lead"))


def _ball(material: Material, index: int, sphere: Sphere | None, seen: list | None) -> str:
    row, camera = material.spheres[index], material.camera
    frames, exposure = material.photographs_of_ball(index)
    caption = _ball_caption(index, row)
    if camera is None or sphere is None:
        reason = page.absent("Its camera or its place is not in this folder.")
        return f"<figure>{reason}<figcaption>{caption}</figcaption></figure>"
    outline = sphere.outline(camera)
    box = pictures.ball_box(sphere, outline, width=camera.width, height=camera.height)
    corner = np.array([box.left - 0.5, box.top - 0.5])
    shapes = page.polyline(outline - corner, "outline-halo") + page.polyline(outline - corner, "outline")
    arm = max(box.width / 60, 1.0)
    for frame, pixel in enumerate(seen or []):
        if pixel is None or not np.isfinite(np.array(pixel, np.float64)).all():
            continue
        u, v = np.array(pixel, np.float64) - corner
        name = frames.names[frame] if frames is not None and frame < len(frames) else str(frame + 1)
        cross = f"M{u - arm:.2f},{v:.2f}H{u + arm:.2f}M{u:.2f},{v - arm:.2f}V{v + arm:.2f}"
        title = f"<title>{escape(f'{frame + 1}: {name}')}</title>"
        shapes += f'<g>{title}<path class="highlight-halo" d="{cross}"/><path class="highlight" d="{cross}"/></g>'
    overlay = page.drawing(box.width, box.height, shapes, label="fitted outline and highlights")
    if row.get("apart"):
        caption += " Photographed apart."
    if frames is None or exposure is None or (frames.width, frames.height) != (camera.width, camera.height):
        caption += " Its pictures are not kept here, so only the fit is drawn."
        below = f"<figcaption>{caption}</figcaption>"
        return f'<figure class="ball"><div class="stack blank">{overlay}</div>{below}</figure>'
    mean = pictures.shrink(pictures.ball_picture(frames, box, brightest=False), BALL_WIDTH)
    image = exposure.develop(mean)
    if row.get("kind") == "chrome":
        brightest = pictures.ball_picture(frames, box, brightest=True)
        image = pictures.mirror_picture(mean / exposure.balance, pictures.shrink(brightest, BALL_WIDTH))
    words = f"{row.get('kind')} ball {index + 1} with its fitted outline"
    return page.picture(image, words, caption, photograph=True, overlay=overlay, kind="ball")


def _ball_caption(index: int, row: Summary) -> str:
    text = page.say("balls", "fit", **{"kind": "", **row, "number": str(index + 1)})
    text += page.say("balls", "diameter", **row) if row.get("diameter_mm") else ""
    text += page.say("balls", "distance", **row) if row.get("distance_mm") else ""
    if row.get("kind") == "chrome" and page.is_number(row.get("highlights_seen")):
        text += page.say("balls", "highlights", **row)
    return text + "."


def lights_section(material: Material) -> str:
    """Return the lights: hemisphere, intensities, sigmas, and positions where they are near."""
    lights = material.lights
    if not lights or not lights.get("frames"):
        return page.section("lights", "The lights", page.absent("No lights were calibrated or given."))
    if lights.get("model") == "unknown":
        absent = page.absent("Nothing tells where they stood, nor how bright they were.")
        return page.section("lights", "The lights", absent)
    measured = any(page.is_number(row.get("direction_sigma_deg")) for row in lights["frames"])
    drawn = [page.chart(light_charts.intensities(lights))]
    drawn += [page.chart(light_charts.sigmas(lights))] if measured else []
    body = f'<div class="pair">{page.chart(light_charts.directions(lights), "dome")}<div>{"".join(drawn)}</div></div>'
    if not measured:
        body += page.absent("How uncertain the directions are is not known: the lights were given, not measured here.")
    if lights.get("model") != "near":
        body += page.absent("The lights are taken as distant: directions, no positions.")
    rows = [
        {
            **row,
            "number": str(index + 1),
            "distance": page.say("lights", "distance", **row) if row.get("distance_mm") else "–",
            "flags": "; ".join(row.get("flags") or []) or "–",
        }
        for index, row in enumerate(lights["frames"])
    ]
    body += page.folded("All lights as a table", page.table_of("lights", rows))
    lead = f"{page.number(lights['count'])} lights, {escape(str(lights['model']))}, seen from the object's centre."
    return page.section("lights", "The lights", body, lead)


def _sentence(item: object) -> str:
    """Return what calibration.json says of a refused candidate, as text."""
    if not isinstance(item, dict) or "reason" not in item:
        return str(item)
    u, v = (round(value) for value in item["center_px"])
    return f"At column {u}, row {v}, radius {item['radius_px']:.0f} px: {item['reason']}."
