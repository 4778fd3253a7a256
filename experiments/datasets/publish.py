"""`rgbn dataset publish`: datasets for others without their truth, which stays on the shelf and scores submissions."""

import tomllib
from pathlib import Path

from compare.report.pictures import Exposure
from experiments.datasets import croissant
from experiments.datasets.checksums import write_checksums
from experiments.datasets.shelf import KEPT_BACK, Entry, contents_of
from formats.diligent_layout import MASK, TABLES, read_tables
from formats.pictures import read_values
from formats.toml_text import toml_text
from lab.progress import say
from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import write_json, write_png, write_text, write_whole
from scene.light_text import FILENAMES
from scene.map_pictures import Image, shrink
from scene.output_folder import open_record
from scene.reading import listed, text_of

STRIP, STRIP_WIDTH = 6, 200
_README = """# {name}

Photographs of one object, one light each, for photometric stereo. The true normals are kept back; submissions are
scored where they are.

![some of the photographs](preview.png)

The layout is that of the DiLiGenT benchmark: photographs (16 bits, linear), `filenames.txt`, `light_directions.txt` (x
right, y up, z toward the viewer), `light_intensities.txt`, `mask.png`; `croissant.json` for machine-learning tools;
`SHA256SUMS`.

A submission is a folder with `submission.toml` and, of each dataset, `NAME.npy` (H x W x 3, the same axes, NaN or 0
where there is no answer) or `NAME.png` (16 bits, (n + 1) / 2): here `{name}.npy`.
"""


def publish(shelf: Path, found: list[Entry], to: Path) -> list[Path]:
    """Copy datasets of a shelf to a folder without their truth; return the copies' folders.

    A copy holds what is named here and nothing else, so that no file of a newcomer's dataset slips through: the
    photographs, the lights, the mask, the camera, and what is written anew from these. From then on the shelf's list
    and the site show the dataset without its truth. SceneError: nothing of them is on the shelf; a dataset has changed.
    """
    there = [one for one in found if one.state]
    if not there:
        raise SceneError(f"dataset {found[0].name}: is not on the shelf {shelf}. Make it, or add it.")
    known = [one.name for one in there if one.state != "added"]
    if known:
        say(
            f"note: {listed(known)}: of the catalogue, whose truth anybody who has rgbn can make. What must stay "
            "unknown is a dataset of your own, photographed or rendered elsewhere, and added."
        )
    with open_record(shelf, origin="shelf of datasets") as shelf_record:
        read = [shelf, *(one.folder for one in there)]
        with open_record(to, origin="publication of datasets", input_folders=read) as record:
            for one in there:
                with record.making(one.name, fingerprint(contents_of(shelf, one))):
                    _copy(one, to / one.name)
        for one in there:
            with shelf_record.part_of(KEPT_BACK):
                write_json(shelf / KEPT_BACK / f"{one.name}.json", {"published": str((to / one.name).resolve())})
    return [to / one.name for one in there]


def _copy(entry: Entry, folder: Path) -> None:
    source, tables = entry.folder, read_tables(entry.folder)
    for name in (*tables.files, FILENAMES, *TABLES, MASK, *(["lights.json"] if entry.state != "added" else [])):
        with write_whole(folder / name) as file:
            file.write((source / name).read_bytes())
    if entry.state != "added":
        told = tomllib.loads(text_of(source / "session.toml"))
        kept = {key: told[key] for key in ("version", "frames", "camera", "lights") if key in told}
        write_text(folder / "session.toml", toml_text({"name": entry.name, **kept, "object": {"mask": MASK}}))
    write_png(folder / "preview.png", strip(source, tables.files))
    write_text(folder / "README.md", _README.format(name=entry.name))
    text = "Photographs of one object, one light each. The true normals are kept back."
    write_json(folder / croissant.FILE, croissant.of_dataset(folder, entry.name, text))
    write_checksums(folder)


def strip(folder: Path, files: list[str], shown: int = STRIP) -> Image:
    """Return some of the photographs (h, w, 3), evenly chosen, side by side; one brightness for all."""
    import numpy as np

    chosen = np.unique(np.linspace(0, len(files) - 1, min(shown, len(files))).round().astype(int))
    small = []
    for index in chosen:
        image, photograph_white = read_values(folder / files[index], SceneError)
        colours = image[..., :3] if image.ndim == 3 else np.repeat(image[..., None], 3, -1)
        small.append(shrink(colours / np.float32(photograph_white), STRIP_WIDTH))
    white = float(np.quantile(np.max(small, -1), 0.995))
    return Exposure(max(white, 1e-6), np.ones(3)).develop(np.concatenate(small, 1))
