"""What a dataset says of itself: README.md and a picture for people, session.toml for rgbn."""

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import PAPER, Box, Exposure, normal_picture, shrink, thumbnail
from experiments.photographs import Photographs
from experiments.recipe import Dataset
from twin.ground_truth import lights_of

TILE, COLUMNS, SHOWN, GAP = 160, 6, 12, 4
CAPTION = 18

_README = """# {name}

{text}.

![preview](preview.png)

Rendered by rgbn; nothing of it was photographed. Family `{family}`; the same recipe and code give the same bytes.

| | |
|---|---|
{facts}

## Files

The layout is that of the DiLiGenT benchmark: a program that reads one reads the other.

| file | |
|---|---|
| `001.png` ... | one light each: 16 bits, linear, R G B. Matte: value = albedo x intensity x cosine; 65535 = 1 |
| `filenames.txt` | the photographs in the order of the lights |
| `light_directions.txt` | unit vectors toward the lights: x right, y up, z toward the viewer |
| `light_intensities.txt` | R G B, relative; the mean over the photographs is 1 |
| `mask.png` | white: the object |
| `Normal_gt.mat`, `Normal_gt.png` | true normals in the same axes (H x W x 3, zero outside; 16 bits, (n + 1) / 2) |
| `lights.json`, `session.toml` | the same for rgbn, with the camera{near} |
| `truth/` | true maps, `.npy` with NaN outside: `normals`, `z_mm`, `height_mm`, `albedo`, `roughness`, `specularity` |
| | `mask`, `object` (which of the objects) |
| | `attached`, `cast`: shadows, one bit a light, light i in byte i // 8, bit i % 8; as `.png`: white, no light |
| | `normals`, `z_mm`, `albedo` as `.exr` too (0 outside) |
| `recipe.json` | what it is made from |
| `SHA256SUMS` | checksums: `sha256sum --check SHA256SUMS` |
{camera}
## Recipe

| | |
|---|---|
{recipe}
"""


def readme(dataset: Dataset, stack: Photographs, facts: dict[str, Any]) -> str:
    """Return the text of README.md; facts: further figures, by what they are."""
    camera, lights = stack.camera, stack.lights
    kind = "near: each has a position" if lights.positions_mm is not None else "distant"
    facts = {
        "photographs": len(lights), "pixels": f"{camera.width} x {camera.height}", "lights": kind, **facts
    }  # fmt: skip
    recipe = asdict(dataset.recipe)
    recipe |= {
        key: value for key, value in asdict(dataset).items() if key in ("near_mm", "hand_held", "group") and value
    }
    if dataset.sensor is not None:
        recipe |= {f"sensor {key}": value for key, value in asdict(dataset.sensor).items()}
    near = " and the lights' positions in mm; the two tables hold what is seen from the object's middle"
    return _README.format(
        name=dataset.name,
        text=dataset.text[0].upper() + dataset.text[1:],
        family=dataset.family,
        facts=_rows(facts),
        near=near if lights.positions_mm is not None else "",
        camera=_camera_text(stack),
        recipe=_rows(recipe),
    )


def _rows(facts: dict[str, Any]) -> str:
    return "\n".join(f"| {key} | {value} |" for key, value in facts.items())


def _camera_text(stack: Photographs) -> str:
    camera, middle = stack.camera, stack.lights.reference_point_mm
    return (
        f"\nThe camera: perspective, focal length {camera.fx:.2f} px, principal point "
        f"({camera.cx:g}, {camera.cy:g}) px, counted from the centre of the first pixel; {-middle[2]:.0f} mm to the "
        "object's middle.\n"
    )


def session_toml(dataset: Dataset, stack: Photographs) -> str:
    """Return the text of session.toml, by which rgbn knows the camera and near lights."""
    camera = stack.camera
    files = "".join(f'  "{name}.png",\n' for name in stack.frames.names)
    numbers = "".join(f"{key} = {float(getattr(camera, key))!r}\n" for key in ("fx", "fy", "cx", "cy"))
    return (
        f'version = 1\nname = "{dataset.name}"\n\n[frames]\nflash = [\n{files}]\nlinear = true\n\n'
        f"[camera]\nwidth = {camera.width}\nheight = {camera.height}\n{numbers}\n"
        '[lights]\nfile = "lights.json"\n\n[object]\nmask = "mask.png"\nnormals = "Normal_gt.mat"\n'
    )


def preview(stack: Photographs) -> NDArray[np.uint8]:
    """Return (h, w, 3) uint8: twelve frames, evenly chosen, then normals, albedo, height and shadows, each named."""
    frames, truth, count = stack.frames, stack.truth, len(stack.lights)
    box, exposure = Box.of_mask(truth.mask, margin=0.06), Exposure.for_frames(frames)
    tiles = []
    for index in np.unique(np.linspace(0, count - 1, min(SHOWN, count)).round().astype(int)):
        x, y, z = stack.lights.directions[index]
        name = f"{frames.names[index]}: {x:.2f} {y:.2f} {z:.2f}"
        tiles.append(_tile(exposure.develop(thumbnail(frames, int(index), TILE, box)), name))
    tiles += [_blank()] * (-len(tiles) % COLUMNS)
    window = (box.rows, box.columns)
    tiles.append(_tile(normal_picture(truth.normals[window], TILE), "normals"))
    albedo = truth.albedo[window]
    # Not white, or it could not be told from the paper.
    white = 1.3 * max(float(np.nanquantile(albedo, 0.99)), 1e-6)
    tiles.append(_tile(gray(albedo / white), "albedo"))
    tall = truth.height_mm[window]
    top = max(float(np.nanmax(tall)), 1e-6)
    tiles.append(_tile(gray(np.repeat((tall / top)[..., None], 3, -1), gamma=1.0), f"height, 0 to {top:.0f} mm"))
    for name in ("attached", "cast"):
        lost = lights_of(getattr(truth, name), count).mean(0, dtype=np.float32)
        lost = np.where(truth.mask, lost, np.nan)[window]
        tiles.append(_tile(gray(np.repeat(lost[..., None], 3, -1), gamma=1.0), f"{name} shadow"))
    tiles += [_blank()] * (-len(tiles) % COLUMNS)
    rows = [np.concatenate(tiles[i : i + COLUMNS], 1) for i in range(0, len(tiles), COLUMNS)]
    return np.concatenate(rows, 0)


def gray(values: NDArray, width: int = TILE, gamma: float = 1 / 2.2) -> NDArray[np.uint8]:
    """Return values 0 to 1 (h, w, 3) as a picture; paper where there is none."""
    small = shrink(values, width)
    shown = np.clip(np.nan_to_num(small), 0, 1) ** gamma
    return np.where(np.isfinite(small), np.round(255 * shown), PAPER).astype(np.uint8)


def _blank() -> NDArray[np.uint8]:
    return np.full((TILE + CAPTION + GAP, TILE + GAP, 3), 255, np.uint8)


def _tile(image: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    """Return a picture, fitted into a square, with its name below."""
    import cv2

    height, width = image.shape[:2]
    factor = TILE / max(height, width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    how = cv2.INTER_NEAREST if factor > 1 else cv2.INTER_AREA
    image = np.asarray(cv2.resize(image, size, interpolation=how), np.uint8)
    tile = _blank()
    top, left = (TILE - image.shape[0]) // 2, (TILE - image.shape[1]) // 2
    tile[top : top + image.shape[0], left : left + image.shape[1]] = image
    font = {"fontFace": cv2.FONT_HERSHEY_SIMPLEX, "fontScale": 0.38, "color": (40, 40, 40), "lineType": cv2.LINE_AA}
    return np.asarray(cv2.putText(tile, caption, (3, TILE + 13), **font), np.uint8)
