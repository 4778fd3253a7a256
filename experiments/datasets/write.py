"""One dataset as a folder: the DiLiGenT layout, the true maps, pictures for people; the same bytes every time."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.datasets.checksums import FILE, checksums_of
from experiments.datasets.describe import preview, readme, session_toml
from experiments.photographs import Photographs, photograph_dataset
from experiments.recipe import Dataset
from scene.current import code_fingerprint, fingerprint

RECIPE = "recipe.json"


def mark_of(dataset: Dataset) -> str:
    """Return a hash of a dataset's recipe and of the code that makes it: where it is the same, so are the bytes."""
    return fingerprint(dataset, code=code_fingerprint("experiments"))


def write_dataset(folder: Path, dataset: Dataset) -> None:
    """Make a dataset in an empty folder.

    Parameters
    ----------
    folder : Path
        Gets the DiLiGenT layout (001.png ..., filenames.txt, light_directions.txt, light_intensities.txt, mask.png,
        Normal_gt.mat, Normal_gt.png), session.toml and lights.json with camera and near lights, truth/, preview.png,
        README.md, recipe.json and, last, SHA256SUMS.
    dataset : Dataset

    Raises
    ------
    RenderError
        The scene cannot be rendered here.
    """
    from formats.diligent_layout import NORMALS, write_diligent, write_normal_mat
    from formats.pictures import write_exr
    from scene.files import write_json, write_png, write_text
    from scene.normals import encode_normals
    from scene.store import Store
    from twin.ground_truth import save_ground_truth

    stack = photograph_dataset(dataset)
    truth = stack.truth
    write_diligent(folder, stack.frames, stack.lights, truth.mask)
    files = tuple(f"{name}.png" for name in stack.frames.names)
    Store(folder).save_lights(stack.lights, files=files)
    write_normal_mat(folder / NORMALS[0], truth.normals)
    write_png(folder / NORMALS[2], encode_normals(truth.normals))
    save_ground_truth(truth, folder / "truth")
    for name in ("normals", "z_mm", "albedo"):
        values = getattr(truth, name)
        # What a picture program makes of NaN nobody knows.
        write_exr(folder / "truth" / f"{name}.exr", np.nan_to_num(values if values.ndim == 3 else values[..., None]))
    for name in ("attached", "cast"):
        write_png(folder / "truth" / f"{name}.png", _share_of_lights(getattr(truth, name), len(stack.lights)))
    write_png(folder / "preview.png", preview(stack))
    write_text(folder / "session.toml", session_toml(dataset, stack))
    write_text(folder / "README.md", readme(dataset, stack, _facts(stack)))
    write_json(folder / RECIPE, dataset)
    write_text(folder / FILE, checksums_of(folder))


def _share_of_lights(bits: NDArray[np.uint8], count: int) -> NDArray[np.uint8]:
    """Return a picture of how many of the lights a pixel does not see, white: none of them."""
    from twin.ground_truth import lights_of

    return np.round(255 * lights_of(bits, count).mean(0)).astype(np.uint8)


def _facts(stack: Photographs) -> dict[str, Any]:
    from twin.ground_truth import lights_of

    mask, count = stack.truth.mask, len(stack.lights)
    shadows = {name: lights_of(getattr(stack.truth, name), count)[:, mask].mean() for name in ("attached", "cast")}
    return {
        "pixels of the object": int(mask.sum()),
        "samples in attached shadow": f"{shadows['attached']:.1%}",
        "samples in cast shadow": f"{shadows['cast']:.1%}",
        "clipped samples": f"{stack.frames.saturated()[:, mask].mean():.1%}",
    }
