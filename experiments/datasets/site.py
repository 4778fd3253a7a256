"""The leaderboard: a static site of datasets and results, one folder of HTML for any web server or browser."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Box, colour_scale_end, error_picture, normal_picture, shrink
from experiments.datasets import croissant
from experiments.datasets.checksums import sums_of
from experiments.datasets.describe import gray
from experiments.datasets.publish import strip
from experiments.datasets.run_methods import NO_ERROR
from experiments.datasets.shelf import Entry, entries
from experiments.datasets.site_pages import Shown, dataset_page, index_page, submit_page
from experiments.datasets.submissions import Submission
from experiments.tables import DATASETS, Rows, grouped
from formats.csv_text import csv_text
from formats.diligent_layout import Layout, read_layout
from lab.progress import progress_bar
from scene.current import file_digest, fingerprint, libraries
from scene.files import write_json, write_text
from scene.image_files import read_pixels
from scene.map_pictures import Image
from scene.output_folder import open_record
from scene.reading import array_of

SITE, WIDTH = "site", 200
_HIGH = 0.9
"""Share of a dataset's errors, of all methods, that the colours of its error maps reach."""


def write_site(
    shelf: Path, out: Path, rows: Rows, submissions: Sequence[Submission] = (), *, downloads: str = ""
) -> Path:
    """Write OUT/site anew, and return its index.html.

    It holds index.html, submit.html, results.csv, croissant.json and, of each dataset, NAME.html, NAME.sha256 and
    NAME.croissant.json. Of a dataset whose truth is kept back neither true maps nor error maps are shown: from several
    methods' answers and errors the truth could be computed.

    rows: of `run_methods.run`. downloads: the address under which the shelf's folders are served; empty: where they
    are on this disk, relative to the site.
    """
    site, known = out / SITE, entries(shelf)
    found = {one.name: one for one in known if one.state and not one.same_as}
    by_dataset = {key[0]: group for key, group in grouped(rows, "dataset").items()}
    shown_entries, thumbnails, about = [found[name] for name in by_dataset], {}, []
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
            folder, page = _public(entry), f"{entry.name}.html"
            described = croissant.of_dataset(folder, entry.name, entry.text, base=shown.base, url=page)
            write_json(site / f"{entry.name}.croissant.json", described)
            thumbnails[entry.name] = shown.thumbnail
            about.append({"name": entry.name, "family": entry.family, "description": entry.text, "page": page,
                          "list": "benchmark" if entry.benchmark else "ours"})  # fmt: skip
            report(done, len(shown_entries))
        write_text(site / "results.csv", csv_text([{key: row.get(key) for key in DATASETS} for row in rows]))
        write_json(site / croissant.FILE, _croissant(site, about))
        write_text(site / "submit.html", submit_page(shown_entries[0].name))
        said = (
            f"{len(shown_entries)} datasets, {len({row['method'] for row in rows})} methods · rgbn "
            f"{libraries()['rgbn']} · <a href='submit.html'>how to submit</a> · <a href='results.csv'>results.csv</a> "
            "· <a href='croissant.json'>croissant.json</a>"
        )
        write_text(site / "index.html", index_page(shown_entries, thumbnails, rows, submissions, said))
    return site / "index.html"


def _public(entry: Entry) -> Path:
    """Return the folder that others are given."""
    return Path(entry.kept_back) if entry.kept_back else entry.folder


def _gather(entry: Entry, rows: Rows, site: Path, downloads: str) -> Shown:
    public, layout = _public(entry), read_layout(entry.folder)
    base = f"{downloads.rstrip('/')}/{entry.name}" if downloads else Path(os.path.relpath(public, site)).as_posix()
    maps, errors, end = {}, {}, 1.0
    if not entry.kept_back and layout.mask is not None:
        box = Box.of_mask(layout.mask, margin=0.03)
        maps = _true_maps(entry.folder, layout, box)
        found = {row["method"]: _error_map(row["map"]) for row in rows if row["status"] == "ok"}
        known = [error[np.isfinite(error)] for error in found.values()]
        end = colour_scale_end(float(np.quantile(np.concatenate(known), _HIGH))) if known else 1.0
        errors = {name: error_picture(shrink(box.of(error), WIDTH), end) for name, error in found.items()}
    sums = {file: value for file, value in sums_of(public).items() if file != croissant.FILE}
    photographs, middle = strip(entry.folder, layout.files), [layout.files[len(layout.files) // 2]]
    return Shown(entry, photographs, strip(entry.folder, middle), maps, errors, end, f"{base}/", sums, rows)


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


def _croissant(site: Path, about: list[dict[str, str]]) -> dict:
    names = ["results.csv", *(f"{one['name']}.croissant.json" for one in about)]
    files = [croissant.file_object(name, file_digest(site / name) or "") for name in names]
    record_sets = [
        croissant.inline("datasets", "The datasets; each has a croissant.json of its own.", about),
        croissant.of_table("results", "Angular errors of methods on datasets, degrees.", "results.csv", DATASETS),
    ]
    text = "Photographs of objects with known normals, one light each, and how well methods recover the normals."
    return croissant.metadata("rgbn-datasets", text, files, record_sets, url="index.html")
