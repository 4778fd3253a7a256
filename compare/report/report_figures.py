"""The report's pictures that are composed: balls with their outlines, the scan on the photograph."""

from contextlib import suppress
from itertools import zip_longest
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.facts import Material, Summary, is_seen, read_optional
from compare.report.pictures import PixelBox
from compare.report.registration_pictures import raking_frame, read_picture, views
from scene.errors import SceneError
from scene.map_pictures import Image, data_uri, known_pixels
from scene.spheres import Sphere

BALL_WIDTH, PHOTOGRAPH_WIDTH = 420, 1000


def ball_figures(material: Material) -> Summary:
    """Return each ball's crop with its fitted outline and highlights, and the candidates that were refused."""
    calibration, spheres = read_optional(material.store, "calibration.json") or {}, []
    with suppress(SceneError):
        spheres = material.store.load_spheres()
    rows = zip_longest(range(len(material.spheres)), spheres, calibration.get("highlights_px") or [])
    found = [_ball(material, *row) for row in rows if row[0] is not None]
    return {"ball_figures": found, "refused": calibration.get("rejected")}


def _ball(material: Material, index: int, sphere: Sphere | None, seen: list | None) -> Summary:
    """Return what is told of a ball, its outline as a drawing, and its crop; the latter two where they are there."""
    row, camera = {"kind": "", **material.spheres[index], "number": str(index + 1)}, material.camera
    frames, exposure = material.photographs_of_ball(index)
    if camera is None or sphere is None:
        return {"row": row}
    outline = sphere.outline(camera)
    box = pictures.ball_box(sphere, outline, width=camera.width, height=camera.height)
    corner = np.array([box.left - 0.5, box.top - 0.5])
    shapes = page.polyline(outline - corner, "outline-halo") + page.polyline(outline - corner, "outline")
    arm = max(box.width / 60, 1.0)
    for frame, pixel in enumerate(seen or []):
        if not is_seen(pixel):
            continue
        u, v = np.array(pixel, np.float64) - corner
        name = frames.names[frame] if frames is not None and frame < len(frames) else str(frame + 1)
        cross = f"M{u - arm:.2f},{v:.2f}H{u + arm:.2f}M{u:.2f},{v - arm:.2f}V{v + arm:.2f}"
        title = f"<title>{escape(f'{frame + 1}: {name}')}</title>"
        shapes += f'<g>{title}<path class="highlight-halo" d="{cross}"/><path class="highlight" d="{cross}"/></g>'
    found = {
        "row": row,
        "overlay": Markup(page.drawing(box.width, box.height, shapes, label="fitted outline and highlights")),
    }
    if frames is None or exposure is None or (frames.width, frames.height) != (camera.width, camera.height):
        return found
    mean = pictures.shrink(pictures.ball_picture(frames, box, brightest=False), BALL_WIDTH)
    image = exposure.develop(mean)
    if row["kind"] == "chrome":
        brightest = pictures.ball_picture(frames, box, brightest=True)
        image = pictures.mirror_picture(mean / exposure.balance, pictures.shrink(brightest, BALL_WIDTH))
    return found | {"image": image}


def placed(material: Material) -> Summary:
    """Return the pictures that show whether the scan lies where the object is, or under `missing` why there are none.

    registered: there is a pose. As HTML, where they are there: outline, and zoom and sigma, as `align` drew them;
    wiper: the values of the macro of pieces.html.
    """
    frames, mask, truth = material.frames, material.mask, material.map_of("normals", "truth")
    registered = material.store.path("pose.json").exists()
    found: dict[str, Any] = {"registered": registered}
    if frames is None or (mask is None and truth is None):
        return found | {"missing": "No scan and no mask: nothing to lay over the photographs."}
    size = (frames.height, frames.width)
    truth = truth if truth is not None and truth.shape[:2] == size else None
    known = None if truth is None else known_pixels(truth)
    mask = mask if mask is not None and mask.shape == size else None
    shape = mask if mask is not None else known
    if shape is None:
        return found | {"missing": page.words("registration")["sizes"]}
    box = PixelBox.of_mask(shape, margin=0.12)
    index = 0 if material.directions is None else raking_frame(material.directions[: len(frames)])
    drawn, zoom, sigma = (
        read_picture(material.store, name) if registered else None for name in ("outline", "outline_zoom", "sigma")
    )
    regions, legend = [(mask, "mask", "the object's mask")], []
    if drawn is None:
        # Where the outline itself is not there to a fraction of a pixel, the truth ends a pixel inside it. The dashed
        # line last: where the two agree, the other shows between the dashes.
        what = "the registered scan's ground truth" if registered else "the given ground truth"
        regions.insert(0, (known, "scan", what))
        drawn = material.photograph(index, box, box.shown_width(PHOTOGRAPH_WIDTH))
    else:
        legend = ['<span class="key scan"></span> the registered scan']
    shapes = ""
    for region, kind, shown in regions:
        if region is not None and region.any():
            shapes += "".join(page.polyline(line, kind) for line in pictures.contours(region, box))
            legend.append(f'<span class="key {kind}"></span> {shown}')
    overlay = page.drawing(box.width, box.height, shapes, label="outline of the object")
    caption = f"{escape(frames.names[index])} with the outline of {'; '.join(legend)}."
    alt = "photograph with the object's outline"
    found["outline"] = Markup(page.picture(drawn, alt, caption, photograph=True, overlay=overlay))
    if both := _views(material, box, index, truth):
        uris = [data_uri(image, photograph=True) for image in both]
        said = page.say("registration", "wiper" if registered else "wiper without scan", name=frames.names[index])
        shaded = "shaded scan" if registered else "shaded ground truth"
        found["wiper"] = (uris[0], "photograph", uris[1], shaded, said)
    images = {"zoom": (zoom, "four stretches of the outline"), "sigma": (sigma, "map of the ground truth’s sigma")}
    for name, (image, alt) in images.items():
        if image is not None:
            found[name] = Markup(page.picture(image, alt, page.say("registration", name), photograph=name == "sigma"))
    return found


def _views(material: Material, box: PixelBox, index: int, truth: NDArray | None) -> tuple[Image, Image] | None:
    """Return what `align` drew; without it, shading by the truth's normals, which knows no cast shadows."""
    photograph, shaded = (read_picture(material.store, name) for name in ("photograph", "shaded"))
    if photograph is not None and shaded is not None and photograph.shape == shaded.shape:
        return photograph, shaded
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
