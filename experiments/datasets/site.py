"""A static site of datasets and results, one folder of HTML for any web server or browser."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Box, Exposure, colour_scale_end, error_picture, normal_picture, shrink
from experiments.datasets.checksums import sums_of
from experiments.datasets.describe import gray
from experiments.datasets.run_methods import NO_ERROR
from experiments.datasets.shelf import Entry, entries
from experiments.datasets.site_pages import Shown, dataset_page, index_page
from experiments.tables import DATASETS, Rows, grouped
from formats.diligent_layout import Layout, read_layout
from formats.pictures import read_values
from lab.progress import progress_bar
from scene.current import fingerprint, libraries
from scene.errors import SceneError
from scene.files import write_text
from scene.image_files import read_pixels
from scene.map_pictures import Image
from scene.notebook import csv_text
from scene.output_folder import open_record
from scene.reading import array_of

SITE, WIDTH = "site", 200
PHOTOGRAPHS = 6
"""How many a dataset's page shows."""
_HIGH = 0.9
"""Share of a dataset's errors, of all methods, that the colours of its error maps reach."""


def write_site(shelf: Path, out: Path, rows: Rows, *, downloads: str = "") -> Path:
    """Write OUT/site anew, and return its index.html.

    It holds index.html, results.csv and, of each dataset, NAME.html and NAME.sha256.

    rows: of `run_methods.run`. downloads: the address under which the shelf's folders are served; empty: where they
    are on this disk, relative to the site.
    """
    site, known = out / SITE, entries(shelf)
    found = {one.name: one for one in known if one.state and not one.same_as}
    by_dataset = {key[0]: group for key, group in grouped(rows, "dataset").items()}
    shown_entries, thumbnails = [found[name] for name in by_dataset], {}
    with (
        open_record(out, origin="table of datasets") as record,
        record.making(SITE, fingerprint(downloads)),
        progress_bar("site") as report,
    ):
        for done, entry in enumerate(shown_entries, 1):
            shown = _gather(entry, by_dataset[entry.name], site, downloads)
            aliases = [one.name for one in known if one.same_as == entry.name]
            write_text(site / f"{entry.name}.html", dataset_page(shown, aliases))
            sums = "".join(f"{value}  {file}\n" for file, value in shown.sums.items())
            write_text(site / f"{entry.name}.sha256", sums)
            thumbnails[entry.name] = shown.thumbnail
            report(done, len(shown_entries))
        write_text(site / "results.csv", csv_text([{key: row.get(key) for key in DATASETS} for row in rows]))
        said = (
            f"{len(shown_entries)} datasets, {len({row['method'] for row in rows})} methods · rgbn "
            f"{libraries()['rgbn']} · <a href='results.csv'>results.csv</a>"
        )
        write_text(site / "index.html", index_page(shown_entries, thumbnails, rows, said))
    return site / "index.html"


def _gather(entry: Entry, rows: Rows, site: Path, downloads: str) -> Shown:
    folder, layout = entry.folder, read_layout(entry.folder)
    base = f"{downloads.rstrip('/')}/{entry.name}" if downloads else Path(os.path.relpath(folder, site)).as_posix()
    maps, errors, end = {}, {}, 1.0
    if layout.mask is not None:
        box = Box.of_mask(layout.mask, margin=0.03)
        maps = _true_maps(folder, layout, box)
        found = {row["method"]: _error_map(row["map"]) for row in rows if row["status"] == "ok"}
        known = [error[np.isfinite(error)] for error in found.values()]
        end = colour_scale_end(float(np.quantile(np.concatenate(known), _HIGH))) if known else 1.0
        errors = {name: error_picture(shrink(box.of(error), WIDTH), end) for name, error in found.items()}
    photographs, middle = _strip(folder, layout.files), _strip(folder, [layout.files[len(layout.files) // 2]])
    return Shown(entry, photographs, middle, maps, errors, end, f"{base}/", sums_of(folder), rows)


def _strip(folder: Path, files: list[str]) -> Image:
    """Return some of the photographs (h, w, 3), evenly chosen, side by side; one brightness for all."""
    chosen = np.unique(np.linspace(0, len(files) - 1, min(PHOTOGRAPHS, len(files))).round().astype(int))
    small = []
    for index in chosen:
        image, photograph_white = read_values(folder / files[index], SceneError)
        colours = image[..., :3] if image.ndim == 3 else np.repeat(image[..., None], 3, -1)
        small.append(shrink(colours / np.float32(photograph_white), WIDTH))
    white = float(np.quantile(np.max(small, -1), 0.995))
    return Exposure(max(white, 1e-6), np.ones(3)).develop(np.concatenate(small, 1))


def _true_maps(folder: Path, layout: Layout, box: Box) -> dict[str, Image]:
    """Return small pictures of the true maps that there are."""
    assert layout.normals is not None
    maps = {"normals": normal_picture(box.of(layout.normals), WIDTH)}
    truth = folder / "truth"
    if (truth / "truth_albedo.npy").is_file():
        albedo = np.asarray(box.of(array_of(truth / "truth_albedo.npy")))
        if np.isfinite(albedo).any():
            maps["albedo"] = gray(albedo / (1.3 * max(float(np.nanquantile(albedo, 0.99)), 1e-6)), WIDTH)
    for name in ("attached", "cast"):
        if (truth / f"{name}.png").is_file() and layout.mask is not None:
            share, white = read_pixels(truth / f"{name}.png")
            share = box.of(np.where(layout.mask, share / white, np.nan))
            maps[f"{name} shadows, white: of all lights"] = gray(np.repeat(share[..., None], 3, -1), WIDTH, 1.0)
    return maps


def _error_map(path: Path) -> NDArray[np.float32]:
    """Return an error map (H, W), degrees, NaN where there is none, as `run_methods` keeps it."""
    codes, _ = read_pixels(path)
    return np.where(codes == NO_ERROR, np.nan, codes / np.float32(100)).astype(np.float32)
