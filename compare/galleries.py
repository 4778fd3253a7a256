"""The report's sections that hold pictures: frames, balls, lights, registration, normals, errors."""

from contextlib import suppress
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare import charts, pictures
from compare.facts import light_rows, method_names, read_optional, sphere_rows
from compare.page import absent, drawing, is_number, number, percent, picture, polyline, section, table
from compare.pictures import Box, Exposure
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.store import Store

Summary = dict[str, Any]

PHOTOGRAPH_WIDTH = 1000
BALL_WIDTH = 420
MAP_WIDTH = 440


@dataclass(frozen=True)
class Material:
    """What the folder holds to be shown; None where it is not there."""

    store: Store
    frames: Frames | None
    exposure: Exposure | None
    camera: Camera | None
    lights: Summary | None
    directions: NDArray[np.float64] | None
    spheres: list[Summary]
    mask: NDArray[np.bool_] | None

    @classmethod
    def load(cls, store: Store, summary: Summary) -> "Material":
        compared = summary.get("compare") or {}
        frames, camera, mask, lights = None, None, None, None
        # A part that is missing or that a killed run left unreadable is reported absent, not as a failure.
        with suppress(OSError, ValueError, KeyError):
            frames = store.load_frames()
        with suppress(OSError, ValueError, KeyError, TypeError, SceneError):
            camera = store.load_camera()
        with suppress(SceneError):
            mask = store.load_mask() if store.path("mask.png").exists() else None
        with suppress(OSError, ValueError, KeyError, SceneError):
            lights = store.load_lights()
        exposure = None
        if frames is not None:
            exposure = Exposure.for_frames(frames, white_value=None if lights is None else lights.white_value)
        return cls(
            store,
            frames,
            exposure,
            camera,
            compared.get("lights") or light_rows(store),
            None if lights is None else lights.directions,
            compared.get("spheres") or sphere_rows(store),
            mask,
        )

    def photograph(self, index: int, box: Box, width: int) -> pictures.Image:
        assert self.frames is not None
        assert self.exposure is not None
        return self.exposure.develop(pictures.thumbnail(self.frames, index, width, box))

    def map_of(self, place: str, name: str) -> NDArray[np.float32] | None:
        path = self.store.path(place, f"{name}.npy")
        return np.load(path, mmap_mode="r") if path.exists() else None


def frames_section(material: Material, summary: Summary) -> str:
    """Return a contact sheet of all frames, one brightness scale for all."""
    frames, capture = material.frames, summary.get("capture") or {}
    if frames is None:
        return section("frames", "The photographs", absent("The decoded frames are not in this folder any more."))
    facts = {row.get("name"): row for row in capture.get("frames_table") or []}
    width = 200 if len(frames) <= 48 else 120
    box = Box(0, 0, frames.width, frames.height)
    sheet = []
    for index, name in enumerate(frames.names):
        row = facts.get(name) or {}
        caption = f"<b>{index + 1}</b> {escape(name)}"
        if is_number(row.get("brightness")):
            caption += f"<br>brightness {number(row['brightness'], 3)}"
        if is_number(row.get("saturated_share")):
            caption += f", clipped {percent(row['saturated_share'], 1)}"
        uri = pictures.data_uri(material.photograph(index, box, width), photograph=True)
        sheet.append(picture(uri, f"photograph {index + 1}, {name}", caption))
    size = f"{number(capture.get('width'))} × {number(capture.get('height'))} px, " if capture.get("width") else ""
    count = f"{number(capture['frames'])} frames, " if is_number(capture.get("frames")) else ""
    ambient = {True: "ambient frame subtracted", False: "no ambient frame"}.get(capture.get("ambient"), "")
    lead = f"{count}{size}{ambient}. One brightness scale for all, gamma-encoded for the eye; the data are linear."
    return section("frames", "The photographs", f'<div class="sheet width-{width}">{"".join(sheet)}</div>', lead)


def balls_section(material: Material) -> str:
    """Return each ball's crop with its fitted outline and highlights."""
    if not material.spheres:
        text = "No ball was found or asked for. The lights come from elsewhere (see Lights), or are not known."
        return section("balls", "The calibration balls", absent(text))
    calibration = read_optional(material.store, "calibration.json") or {}
    highlights = calibration.get("highlights_px") or []
    figures = [
        _ball(material, index, row, highlights[index] if index < len(highlights) else None)
        for index, row in enumerate(material.spheres)
    ]
    rejected = [item for item in calibration.get("rejected") or []]
    body = f'<div class="gallery">{"".join(figures)}</div>'
    if rejected:
        rows = "".join(f"<li>{escape(_sentence(item))}</li>" for item in rejected)
        body += f"<h3>Candidates that were refused</h3><ul>{rows}</ul>"
    lead = (
        "The line is the fitted ball's outline, drawn from its cone and the camera; it should run along the ball's "
        "edge all the way round. Crosses are highlights, one a light; rest the pointer on one for its frame. Chrome "
        "balls are shown by each pixel's brightest value over all frames, white balls by the mean."
    )
    return section("balls", "The calibration balls", body, lead)


def _ball(material: Material, index: int, row: Summary, seen: list | None) -> str:
    title = f"<b>{escape(str(row.get('kind', '')))} ball {index + 1}</b>"
    facts = [
        f"radius {number(row.get('radius_px'), 1, 'px')}",
        f"centre ± {number(row.get('sigma_px'), 2, 'px')}",
        f"outline seen {percent(row.get('score'))}",
    ]
    if row.get("diameter_mm"):
        facts.append(f"diameter {number(row['diameter_mm'], 1, 'mm')}")
    if row.get("distance_mm"):
        facts.append(f"distance {number(row['distance_mm'], 0, 'mm')}")
    if is_number(row.get("highlights_seen")):
        facts.append(f"highlight in {number(row['highlights_seen'])} of {number(row['highlights_frames'])} frames")
    caption = f"{title}<br>{', '.join(facts)}."
    camera, frames = material.camera, material.frames
    spheres = []
    with suppress(OSError, ValueError, KeyError):
        spheres = material.store.load_spheres()
    if camera is None or index >= len(spheres):
        return f"<figure>{absent('Its camera or its place is not in this folder.')}<figcaption>{caption}</figcaption></figure>"
    sphere = spheres[index]
    outline = sphere.outline(camera)
    box = pictures.ball_box(sphere, outline, width=camera.width, height=camera.height)
    corner = np.array([box.left - 0.5, box.top - 0.5])
    shapes = polyline(outline - corner, "outline-halo") + polyline(outline - corner, "outline")
    arm = max(box.width / 60, 1.0)
    for number_, pixel in enumerate(seen or []):
        if pixel is None:
            continue
        u, v = np.array(pixel, np.float64) - corner
        name = frames.names[number_] if frames is not None and number_ < len(frames) else str(number_ + 1)
        cross = f"M{u - arm:.2f},{v:.2f}H{u + arm:.2f}M{u:.2f},{v - arm:.2f}V{v + arm:.2f}"
        title_ = f"<title>{escape(f'{number_ + 1}: {name}')}</title>"
        shapes += f'<g>{title_}<path class="highlight-halo" d="{cross}"/><path class="highlight" d="{cross}"/></g>'
    overlay = drawing(box.width, box.height, shapes, label="fitted outline and highlights")
    fits = frames is not None and (frames.width, frames.height) == (camera.width, camera.height)
    if row.get("apart") or not fits or material.exposure is None:
        caption += " Photographed apart; its pictures are not kept here, so only the fit is drawn."
        return f'<figure class="ball"><div class="stack blank">{overlay}</div><figcaption>{caption}</figcaption></figure>'
    assert frames is not None
    linear = pictures.ball_picture(frames, box, brightest=row.get("kind") == "chrome")
    image = material.exposure.develop(pictures.shrink(linear, BALL_WIDTH))
    uri = pictures.data_uri(image, photograph=True)
    return picture(uri, f"{row.get('kind')} ball {index + 1} with its fitted outline", caption, overlay=overlay, kind="ball")


def lights_section(material: Material) -> str:
    """Return the lights: hemisphere, intensities, sigmas, and positions where they are near."""
    lights = material.lights
    if not lights or not lights.get("frames"):
        return section("lights", "The lights", absent("No lights were calibrated or given."))
    body = f'<div class="pair">{charts.light_directions(lights)}{charts.light_intensities(lights)}</div>'
    if any(is_number(row.get("direction_sigma_deg")) for row in lights["frames"]):
        body += charts.light_sigmas(lights)
    else:
        body += absent("How uncertain the directions are is not known: the lights were given, not measured here.")
    if lights.get("model") == "near":
        body += "<h3>Where the flashes stood</h3>" + charts.light_positions(lights, material.spheres)
    else:
        body += absent("The lights are taken as distant: directions, no positions.")
    rows = [
        (
            f"{index + 1} {escape(row['name'])}",
            number(row["zenith_deg"], 1, "°"),
            number(row["azimuth_deg"], 1, "°"),
            number(row["direction_sigma_deg"], 2, "°"),
            number(row["intensity_mean"], 3),
            percent(row["intensity_sigma"], 1),
            number(row["distance_mm"], 0, "mm") if row.get("distance_mm") else "–",
            escape("; ".join(row.get("flags") or [])) or "–",
        )
        for index, row in enumerate(lights["frames"])
    ]
    head = ("light", "from axis", "azimuth", "± direction", "intensity", "± intensity", "distance", "suspicious")
    listed = table(head, rows, kind="numbers")
    body += f"<details><summary>All lights as a table</summary>{listed}</details>"
    lead = f"{number(lights['count'])} lights, {escape(str(lights['model']))}, seen from the object's centre."
    return section("lights", "The lights", body, lead)


def registration_section(material: Material, summary: Summary) -> str:
    """Return the registered silhouette over a photograph, and photograph and shading as a checkerboard."""
    store, frames, mask = material.store, material.frames, material.mask
    align = summary.get("align") or (summary.get("compare") or {}).get("pose") or {}
    truth = material.map_of("normals", "truth")
    if frames is None or (mask is None and truth is None):
        text = "No scan and no mask: nothing to lay over the photographs."
        return section("registration", "The object in the photographs", absent(text))
    size = (frames.height, frames.width)
    known = np.isfinite(truth).all(-1) if truth is not None and truth.shape[:2] == size else None
    mask = mask if mask is not None and mask.shape == size else None
    shape = mask if mask is not None else known
    if shape is None:
        text = "Mask and truth have another size than the photographs; they cannot be laid over them."
        return section("registration", "The object in the photographs", absent(text))
    box = Box.of_mask(shape, margin=0.12)
    index = _raking_frame(material)
    image = material.photograph(index, box, PHOTOGRAPH_WIDTH)
    shapes, legend = "", []
    for region, kind, words in ((mask, "mask", "the object's mask"), (known, "scan", "the registered ground truth")):
        if region is None or not region.any():
            continue
        lines = "".join(polyline(line, kind) for line in pictures.contours(region, box))
        shapes += lines
        legend.append(f'<span class="key {kind}"></span> {words}')
    overlay = drawing(box.width, box.height, shapes, label="outline of the object")
    caption = f"{escape(frames.names[index])} with the outline of {'; '.join(legend)}."
    figures = picture(
        pictures.data_uri(image, photograph=True), "photograph with the object's outline", caption, overlay=overlay
    )
    if known is not None and truth is not None and material.directions is not None and index < len(material.directions):
        shaded = _shaded(truth[box.rows, box.columns], material.directions[index], image)
        board = pictures.data_uri(pictures.checkerboard(image, shaded), photograph=True)
        words = "Squares of the photograph and of the ground truth shaded by the same light, one grey for all of it:"
        figures += picture(
            board,
            "checkerboard of photograph and shaded ground truth",
            f"{words} edges, folds and shadow borders should run on across the squares. Colour need not.",
        )
    body = f'<div class="pair">{figures}</div>'
    if not store.path("pose.json").exists():
        body = absent("No scan was registered (no pose); the outline is the object's mask.") + body
    facts = [
        ("outline residual", number(align.get("residual_px"), 2, "px")),
        ("pose, position ± (1 sigma)", number(align.get("sigma_mm"), 3, "mm")),
        ("pose, rotation ± (1 sigma)", number(align.get("sigma_deg"), 3, "°")),
        ("ground-truth normals ± (median)", number(align.get("truth_sigma_deg_median"), 2, "°")),
    ]
    if align:
        body += table(("", ""), facts, kind="plain")
    return section("registration", "The object in the photographs", body)


def _raking_frame(material: Material) -> int:
    """Return the frame whose light stands nearest to 40 degrees from the axis: shape shows, shadows stay short."""
    if material.directions is None or material.frames is None:
        return 0
    directions = material.directions[: len(material.frames)]
    zenith = np.degrees(np.arccos(np.clip(directions[:, 2], -1, 1)))
    return int(np.argmin(np.abs(zenith - 40)))


def _shaded(normals: NDArray, direction: NDArray, photograph: pictures.Image) -> pictures.Image:
    """Return Lambertian shading as grey, as bright at its median as the photograph; paper where unknown."""
    import cv2

    size = (photograph.shape[1], photograph.shape[0])
    shading = pictures.shrink(np.clip(normals @ direction.astype(np.float32), 0, None), size[0])
    if shading.shape != photograph.shape[:2]:
        shading = cv2.resize(shading, size, interpolation=cv2.INTER_NEAREST)
    lit = np.isfinite(shading) & (shading > 0.05)
    if not lit.any():
        return photograph
    # The photograph is gamma-encoded; the shading is matched there, where the eye compares.
    encoded = np.nan_to_num(shading) ** (1 / 2.2)
    level = np.median(photograph.mean(-1)[lit]) / np.median(encoded[lit])
    grey = np.where(np.isfinite(shading), np.clip(encoded * level, 0, 255), pictures.PAPER)
    return np.repeat(grey[..., None], 3, -1).astype(np.uint8)


def normals_section(material: Material) -> str:
    """Return the truth's and every method's normals as colours, with the ball to read them by."""
    names = method_names(material.store)
    box, figures = _map_box(material, names), []
    for place, name, words in [
        ("normals", "truth", "ground truth"),
        *(("normals", name, f"{name}, photographs") for name in names),
        *(("twin/normals", name, f"{name}, twin") for name in names),
    ]:
        normals = material.map_of(place, name)
        if normals is None:
            continue
        image = pictures.normal_picture(normals[box.rows, box.columns], MAP_WIDTH)
        caption = escape(words)
        uri = pictures.data_uri(image, photograph=False)
        figures.append(picture(uri, f"normals, {words}", caption, kind="map"))
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
    return section("normals", "Normals", f'<div class="gallery">{ball}{"".join(figures)}</div>', lead)


def _map_box(material: Material, names: list[str]) -> Box:
    if material.mask is not None:
        shape = material.mask
    else:
        maps = [m for name in ["truth", *names] if (m := material.map_of("normals", name)) is not None]
        shape = np.isfinite(maps[0]).all(-1) if maps else np.ones((1, 1), bool)
    return Box.of_mask(shape, margin=0.03)


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
    names = list(compared.get("methods") or {})
    box, rows = _map_box(material, names), []
    for name in names:
        row = compared["methods"][name]
        cells = []
        for kind, words in (("real", "photographs"), ("twin", "twin")):
            error = material.map_of("compare", f"error_{kind}_{name}")
            if error is None or not row.get(kind):
                reason = "not rendered, or not solved on the twin" if kind == "twin" else "no normals here"
                cells.append(f'<figure class="map">{absent(f"{name}, {words}: {reason}.")}</figure>')
                continue
            image = pictures.error_picture(pictures.shrink(error[box.rows, box.columns], MAP_WIDTH), end)
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
        rows.append(f'<div class="errors">{"".join(cells)}{alike}</div>')
    stops = ", ".join(f"rgb{colour}" for colour in pictures.error_scale_colours(17))
    ticks = "".join(f"<span>{end * part / 4:g}°{' and more' if part == 4 else ''}</span>" for part in range(5))
    scale = (
        f'<div class="scale" role="img" aria-label="colour scale, 0 to {end:g} degrees">'
        f'<div class="ramp" style="background: linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks">{ticks}</div></div>'
    )
    body = scale + "".join(rows) + charts.error_histogram(compared)
    lead = f"One colour scale for all maps, 0° to {number(end, 0, '°')}; everything beyond has its last colour."
    return section("errors", "Where the errors are", body, lead)


def twin_section(material: Material, summary: Summary) -> str:
    """Return one photograph beside the twin's frame of the same light."""
    twin, frames = None, material.frames
    with suppress(OSError, ValueError, KeyError):
        twin = Store(material.store.path("twin")).load_frames()
    if twin is None or len(twin) == 0:
        reason = (
            "No twin was rendered: it needs the registered scan."
            if material.map_of("normals", "truth") is None or not material.store.path("pose.json").exists()
            else "No twin was rendered in this folder."
        )
        return section("twin", "The twin", absent(reason))
    index = min(_raking_frame(material), len(twin) - 1)
    box = Box(0, 0, twin.width, twin.height)
    if material.mask is not None and material.mask.shape == (twin.height, twin.width):
        box = Box.of_mask(material.mask, margin=0.12)
    balance = None if material.exposure is None else material.exposure.balance
    linear = pictures.thumbnail(twin, index, PHOTOGRAPH_WIDTH // 2, box)
    image = pictures.data_uri(Exposure.for_frames(twin, white_value=balance).develop(linear), photograph=True)
    name = escape(twin.names[index])
    figures = picture(image, f"twin of {twin.names[index]}", f"twin, {name}; its brightness scaled by itself")
    if frames is not None and (twin.width, twin.height) == (frames.width, frames.height) and index < len(frames):
        uri = pictures.data_uri(material.photograph(index, box, PHOTOGRAPH_WIDTH // 2), photograph=True)
        name = frames.names[index]
        figures = picture(uri, f"photograph {name}", f"photograph, {escape(name)}") + figures
    facts = summary.get("twin") or {}
    lead = "The scan, rendered under the same light. What differs is what the twin does not know."
    if is_number(facts.get("samples_per_pixel")):
        lead += (
            f" {number(facts['samples_per_pixel'])} samples per pixel, {number(facts.get('seconds'), 1, 's')}, "
            f"engine {escape(str(facts.get('variant', 'unknown')))}."
        )
    return section("twin", "The twin", f'<div class="pair">{figures}</div>', lead)


def _sentence(item: Any) -> str:
    """Return what calibration.json says of a refused candidate, as text."""
    if not isinstance(item, dict):
        return str(item)
    return ", ".join(
        f"{key} {[round(v, 1) for v in value] if isinstance(value, list) else value}" for key, value in item.items()
    )
