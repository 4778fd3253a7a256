"""What a dataset says of itself: README.md for people, session.toml for rgbn."""

from dataclasses import asdict
from typing import Any

from experiments.photographs import Photographs
from experiments.recipe import Dataset

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
