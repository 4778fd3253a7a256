"""`rgbn dataset make`: what is missing is rendered, one dataset a core, written apart and moved to its place.

A dataset is a folder in the DiLiGenT layout, with the true maps: the same bytes every time.
"""

import shutil
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from experiments.photographs import VirtualPhotographs, one_thread, photograph_dataset
from experiments.recipe import Dataset
from experiments.scenes import dataset_scene
from experiments.workers import run_all
from lab.progress import progress_bar, say
from scene.current import code_fingerprint, file_digest, fingerprint
from scene.errors import SceneError
from scene.files import move, write_json, write_png, write_text
from scene.mesh import Mesh
from scene.output_folder import open_record
from scene.record import Record

SUMS = "SHA256SUMS"
"""A dataset's checksums, in the form that `sha256sum --check` reads."""

_README = """# {name}

{text}.

Rendered by rgbn; nothing of it was photographed. Family `{family}`; the same recipe and code give the same bytes.

The layout is that of the DiLiGenT benchmark: a program that reads one reads the other.

| file | |
|---|---|
| `001.png` ... | one light each: 16 bits, linear, R G B. Matte: value = albedo x intensity x cosine; 65535 = 1 |
| `filenames.txt` | the photographs in the order of the lights |
| `light_directions.txt` | unit vectors toward the lights: x right, y up, z toward the viewer |
| `light_intensities.txt` | R G B, relative; the mean over the photographs is 1 |
| `mask.png` | white: the object |
| `Normal_gt.mat`, `Normal_gt.png` | true normals in the same axes (H x W x 3, zero outside; 16 bits, (n + 1) / 2) |
| `lights.json`, `session.toml` | the same for rgbn, with the camera and the positions of near lights in mm |
| `truth/` | true maps, `.npy` with NaN outside: `normals`, `z_mm`, `height_mm`, `albedo`, `roughness`, `specularity` |
| | `mask`, `object` (which of the objects) |
| | `attached`, `cast`: shadows, one bit a light, light i in byte i // 8, bit i % 8 |
| | the object's surface, as a scan of it: `.ply`, mm, where the camera sees it |
| `recipe.json` | what it is made from |
| `SHA256SUMS` | checksums: `sha256sum --check SHA256SUMS` |

## Recipe

| | |
|---|---|
{recipe}
"""


def make(shelf: Path, datasets: Sequence[Dataset], *, processes: int | None = None) -> list[Path]:
    """Make the datasets that are not on the shelf yet, or not by this recipe and code; return all of their folders.

    Each becomes a folder of its name; what counts as made is whole. SceneError: what could not be made, and why, after
    all others have been; or a folder of that name that rgbn did not make.
    """
    with open_record(shelf, origin="shelf of datasets") as record:
        for one in datasets:
            folder = shelf / one.name
            if folder.exists() and not record.files_of(one.name):
                raise SceneError(
                    f"{folder}: is there already, and is not a dataset that rgbn made. Move it away, or choose another "
                    "--shelf."
                )
        missing = [one for one in datasets if not record.is_current(one.name, mark_of(one))]
        outdated = [one.name for one in missing if (shelf / one.name).exists()]
        if outdated:
            say(f"{len(outdated)} made anew, their recipe or the code has changed: {', '.join(outdated[:5])} ...")
        if missing:
            _make(record, missing, processes)
    return [shelf / one.name for one in datasets]


def mark_of(dataset: Dataset) -> str:
    """Return a hash of a dataset's recipe and of the code that makes it: where it is the same, so are the bytes."""
    return fingerprint(dataset, code=code_fingerprint("experiments"))


def _make(record: Record, missing: list[Dataset], processes: int | None) -> None:
    failed, unfinished = [], record.scratch("datasets")
    with progress_bar("datasets") as report:
        report(0, len(missing))
        for done, (one, why) in enumerate(run_all(missing, partial(make_one, unfinished), processes=processes), 1):
            if why is None:
                with record.making(one.name, mark_of(one)):
                    move(unfinished / one.name, record.folder / one.name)
            else:
                failed.append(f"{one.name}: {why}")
            report(done, len(missing))
    if failed:
        raise SceneError(f"{len(failed)} of {len(missing)} datasets could not be made:\n  " + "\n  ".join(failed))


def make_one(unfinished: Path, dataset: Dataset) -> str | None:
    """Make one dataset in a folder of its name, in a process of its own; return why not, if the input is at fault."""
    folder = unfinished / dataset.name
    shutil.rmtree(folder, ignore_errors=True)
    try:
        with one_thread():
            _write(folder, dataset, photograph_dataset(dataset))
    except SceneError as error:
        return " ".join(str(error).split())
    return None


def _write(folder: Path, dataset: Dataset, stack: VirtualPhotographs) -> None:
    """Write what `_README` lists into an empty folder; SHA256SUMS last."""
    from formats.diligent_layout import NORMALS, write_diligent, write_normal_mat
    from formats.meshes.scan_files import write_mesh
    from scene.normals import encode_normals
    from scene.store import Store
    from twin.ground_truth import save_ground_truth

    truth = stack.truth
    write_diligent(folder, stack.frames, stack.lights, truth.mask)
    Store(folder).save_lights(stack.lights, files=tuple(f"{name}.png" for name in stack.frames.names))
    write_normal_mat(folder / NORMALS[0], truth.normals)
    write_png(folder / NORMALS[2], encode_normals(truth.normals))
    save_ground_truth(truth, folder / "truth")
    for one in dataset_scene(dataset).objects:
        # Corners and triangles alone, as of a scanner: whoever reads it makes its normals.
        write_mesh(folder / "truth" / f"{one.name}.ply", Mesh(one.placed.vertices, one.placed.faces))
    write_text(folder / "session.toml", _session_toml(dataset, stack))
    recipe = asdict(dataset.recipe) | {"near_mm": dataset.near_mm, "group": dataset.group, "sensor": dataset.sensor}
    write_text(
        folder / "README.md",
        _README.format(
            name=dataset.name,
            text=dataset.text[0].upper() + dataset.text[1:],
            family=dataset.family,
            recipe="\n".join(f"| {key} | {value} |" for key, value in recipe.items() if value),
        ),
    )
    write_json(folder / "recipe.json", dataset)
    write_text(folder / SUMS, checksums_of(folder))


def checksums_of(folder: Path) -> str:
    """Return a line for each file below a folder, but for `SUMS` and hidden files: its SHA-256, and its name."""
    lines = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != SUMS and not any(part.startswith(".") for part in name.split("/")):
            lines.append(f"{file_digest(path)}  {name}\n")
    return "".join(lines)


def _session_toml(dataset: Dataset, stack: VirtualPhotographs) -> str:
    """Return the text of session.toml, by which rgbn knows the camera and near lights."""
    camera = stack.camera
    files = "".join(f'  "{name}.png",\n' for name in stack.frames.names)
    numbers = "".join(f"{key} = {float(getattr(camera, key))!r}\n" for key in ("fx", "fy", "cx", "cy"))
    return (
        f'version = 1\nname = "{dataset.name}"\n\n[frames]\nflash = [\n{files}]\nlinear = true\n\n'
        f"[camera]\nwidth = {camera.width}\nheight = {camera.height}\n{numbers}\n"
        '[lights]\nfile = "lights.json"\n\n[object]\nmask = "mask.png"\nnormals = "Normal_gt.mat"\n'
    )
