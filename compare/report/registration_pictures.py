"""Pictures that show whether balls and scan lie where they are in the photographs: outlines over them."""

from itertools import chain, repeat
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.facts import Material, Summary, is_seen, read_optional, there
from compare.report.pictures import Exposure, Image, PixelBox
from formats.picture_files import read_values
from scene.files import write_png
from scene.frames import Frames
from scene.lights import Lights
from scene.map_pictures import known_pixels
from scene.spheres import Sphere
from scene.store import Store

FOLDER = "align"
"""Of the pictures, below the output folder."""
WIDTH = 1200
SCAN_COLOUR, MASK_COLOUR = (255, 0, 190), (255, 210, 63)
"""Of the scan's outline: no object under white flashes has it; of the mask's."""
ZOOM = 6
SIDES = {"left": (-1.0, 0.0), "top": (0.0, -1.0), "right": (1.0, 0.0), "bottom": (0.0, 1.0)}
"""Image axes (u, v)."""


def write_pictures(store: Store, frames: Frames, lights: Lights, *, strokes: NDArray, mask: NDArray[np.bool_]) -> None:
    """Write the pictures of a registration to align/: outline, outline_zoom.

    `strokes` (K, 2, 2): both ends, pixels, of short strokes along the scan's outline. `mask` (H, W): the object.
    """
    exposure = Exposure.for_frames(frames, white_value=lights.white_value)
    photograph, box = _photographed(frames, exposure, pictures.raking_frame(lights.directions), mask)
    drawn = draw_strokes(photograph, strokes, [box.left, box.top], photograph.shape[1] / box.width)
    write_png(store.path(FOLDER, "outline.png"), _outlined(drawn, box, mask, MASK_COLOUR, WIDTH // 100))
    write_png(store.path(FOLDER, "outline_zoom.png"), zoom_picture(frames, exposure, lights.directions, strokes))


def _photographed(frames: Frames, exposure: Exposure, index: int, mask: NDArray[np.bool_]) -> tuple[Image, PixelBox]:
    """Return a photograph of the object, and the box of pixels that it shows."""
    import cv2

    box = PixelBox.of_mask(mask, margin=0.12)
    linear = pictures.thumbnail(frames, index, box.shown_width(WIDTH), box)
    grow = max(1, WIDTH // linear.shape[1])
    size = (grow * linear.shape[1], grow * linear.shape[0])
    return exposure.develop(np.asarray(cv2.resize(linear, size, interpolation=cv2.INTER_CUBIC))), box


def _outlined(image: Image, box: PixelBox, region: NDArray[np.bool_], colour: Any, dash_px: int = 0) -> Image:
    """Draw the outline of a region (H, W) on a picture of the box; dashed, what lies below shows in the gaps."""
    import cv2

    large = cv2.resize(box.of(region).astype(np.uint8), image.shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT)
    for line in cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[0]:
        step = 2 * dash_px or len(line)
        parts = [line[k : k + step - dash_px] for k in range(0, len(line), step)]
        # Specks of a few pixels are noise of the mask; drawn, they would hide what is below.
        drawn = cv2.polylines(image, parts if len(line) > 8 else [], not dash_px, colour, 2, cv2.LINE_AA)
        image = np.asarray(drawn, np.uint8)
    return image


def read_picture(store: Store, name: str) -> Image | None:
    """Return a picture of align/, None where it is not there."""
    path = store.path(FOLDER, f"{name}.png")
    return read_values(path)[0] if path.exists() else None


def zoom_picture(frames: Frames, exposure: Exposure, directions: NDArray, strokes: NDArray) -> Image:
    """Return the outline's leftmost, top, rightmost and lowest stretch, each pixel `ZOOM` wide, in a row.

    Above as photographed, below with the outline: a line hides the edge that it is to be judged by. Each is from the
    frame whose light comes from that side, so that the limb is lit; its brightness is stretched by itself.
    """
    import cv2

    middles, columns = strokes.mean(1), []
    for name, side in SIDES.items():
        place = middles[np.argmax(middles @ side)]
        # Directions have y up, image axes v down.
        index = int(np.argmax(directions[:, :2] @ [side[0], -side[1]] - 2 * (directions[:, 2] < 0.35)))
        side_px = min(46, frames.width, frames.height)
        left, top = np.clip(np.round(place - side_px / 2), 0, [frames.width - side_px, frames.height - side_px])
        box = PixelBox(int(left), int(top), int(left) + side_px, int(top) + side_px)
        crop = box.frame(frames, index)
        white = max(float(np.quantile(crop / exposure.balance, 0.995)), 1e-6)
        tile = pictures.enlarged(Exposure(white, exposure.balance).develop(crop), ZOOM)
        drawn = draw_strokes(tile.copy(), strokes, [box.left, box.top], ZOOM)
        label, gap = (np.full((height, tile.shape[1], 3), 255, np.uint8) for height in (26, 4))
        words = f"{name}: {frames.names[index]}, {ZOOM} x"
        cv2.putText(label, words, (4, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
        columns.append(np.pad(np.concatenate([label, tile, gap, drawn]), ((0, 0), (0, 6), (0, 0)), constant_values=255))
    return np.concatenate(columns, 1)[:, :-6]


def draw_strokes(image: Image, strokes: NDArray, corner: list[int], scale: float) -> Image:
    """Draw strokes (K, 2, 2), pixels of the photographs, on an image enlarged by `scale` from pixel `corner` on."""
    import cv2

    # cv2 counts from pixel centres too, and in fractions of 1/64 here.
    ends = (strokes - corner + 0.5) * scale - 0.5
    near = ((ends > -50).all(-1) & (ends < [image.shape[1] + 50, image.shape[0] + 50]).all(-1)).all(-1)
    lines = np.round(ends[near] * 64).astype(np.int32)
    return np.asarray(cv2.polylines(image, list(lines), False, SCAN_COLOUR, 1, cv2.LINE_AA, 6), np.uint8)


def ball_figures(material: Material) -> Summary:
    """Return each ball's crop with its fitted outline and highlights, and the candidates that were refused."""
    calibration = read_optional(material.store, "calibration.json") or {}
    seen = chain(calibration.get("highlights_px") or (), repeat(None))
    found = [_ball(material, n, ball, next(seen)) for n, ball in enumerate(there(material.store.load_spheres) or ())]
    return {"ball_figures": found, "refused": calibration.get("rejected")}


def _ball(material: Material, index: int, sphere: Sphere, seen: list | None) -> Summary:
    """Return what is told of a ball, its outline as a drawing, and its crop where it is there."""
    row, camera = {"kind": "", **material.spheres[index], "number": str(index + 1)}, material.camera
    frames, exposure = material.photographs_of_ball(index)
    outline = sphere.outline(camera)
    known = outline[np.isfinite(outline).all(-1)]
    known = known if known.size else sphere.center_px + sphere.radius_px * np.array([[-1.0], [1.0]])
    size = {"width": camera.width, "height": camera.height}
    box = PixelBox.around(known.min(0), known.max(0), margin=0.1, **size)
    corner = np.array([box.left - 0.5, box.top - 0.5])
    path, arm = " ".join(f"{u:.1f},{v:.1f}" for u, v in outline - corner), max(box.width / 60, 1.0)
    shapes = [f'<polygon class="{kind}" points="{path}"/>' for kind in ("outline-halo", "outline")]
    for frame, pixel in enumerate(seen or []):
        if not is_seen(pixel):
            continue
        u, v = np.array(pixel, np.float64) - corner
        name = frames.names[frame] if frames is not None and frame < len(frames) else str(frame + 1)
        cross = f"M{u - arm:.2f},{v:.2f}H{u + arm:.2f}M{u:.2f},{v - arm:.2f}V{v + arm:.2f}"
        title = f"<title>{escape(f'{frame + 1}: {name}')}</title>"
        shapes.append(f'<g>{title}<path class="highlight-halo" d="{cross}"/><path class="highlight" d="{cross}"/></g>')
    size = f'viewBox="0 0 {box.width} {box.height}" preserveAspectRatio="none" role="img"'
    svg = Markup(f'<svg {size} aria-label="fitted outline and highlights">{"".join(shapes)}</svg>')
    found = {"row": row, "overlay": svg}
    if frames is not None and exposure is not None:
        is_mirror = row["kind"] == "chrome"
        found["image"] = pictures.ball_picture(frames, exposure, box, 420, is_mirror=is_mirror)
    return found


def placed(material: Material) -> Summary:
    """Return whether a scan is `registered`, and the pictures `outline` and `zoom` (None where `align` drew none)."""
    mask, truth = material.mask, material.map_of("normals", "truth")
    registered = material.store.path("pose.json").exists()
    drawn, zoom = (read_picture(material.store, name) if registered else None for name in ("outline", "outline_zoom"))
    if drawn is None:
        drawn, box = _photographed(material.frames, material.exposure, material.raking, mask)
        drawn = drawn if truth is None else _outlined(drawn, box, known_pixels(truth), SCAN_COLOUR)
        drawn = _outlined(drawn, box, mask, MASK_COLOUR, WIDTH // 100)
    shown = "the registered scan" if registered else "the given ground truth"
    keys = {"mask": "the object's mask"} | ({} if truth is None else {"scan": shown})
    legend = Markup("; ").join(Markup('<span class="key {}"></span> {}').format(*key) for key in keys.items())
    name = material.frames.names[material.raking]
    caption = Markup("{} with the outline of {}.").format(name, legend)
    return {"registered": registered, "outline": drawn, "outline_caption": caption, "zoom": zoom}
