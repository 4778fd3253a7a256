"""`rgbn export --format heritage`: what an archive takes in, as one bag of files with their SHA-256s [Kunze2018].

In its `data/`: the photographs and one method's maps, under the names that the scanner Selene gives and Princeton's
figgy reads; the same as tiles with a IIIF manifest; the lights, and every number of the summary.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom
from scipy.optimize import linear_sum_assignment
from tifffile import imread

from compare.report.facts import all_warnings
from compare.report.pictures import Exposure, colour_scale_end, error_picture
from formats.iiif_files import write_manifest, write_tiles
from formats.light_files.light_formats import export_lights
from formats.picture_files import srgb_from_linear, srgb_profile
from formats.tiff_files import write_map
from lab.job import Job
from lab.results import FOLDER, Colours, albedo_colours, method_maps
from lab.run import ARCHIVED, STEPS, summed_up
from scene.current import file_digest
from scene.errors import SceneError
from scene.files import move, write_json, write_text
from scene.normals import angular_error_deg

FIRST = np.array([[0, 1, 1], [1, 0, 1], [0, -1, 1], [-1, 0, 1]]) / np.sqrt(2)
"""Lights that figgy notes of 1.TIF to 4.TIF: from above, right, below and left, at 45 degrees."""
SRGB = np.round(65535 * srgb_from_linear(np.arange(65536) / 65535)).astype(np.uint16)
"""Of linear codes of 16 bits."""
EIGHT_BITS = np.round(np.arange(65536) / 257).astype(np.uint8)
"""Of codes of 16."""
SHARE = 0.98
"""Of the mean picture's pixels that are below white, and of sigma that its scale of colours reaches."""


def export_heritage(job: Job, base: str) -> tuple[list[Path], list[str]]:
    """Write OUT/export/heritage, after the steps that `process` takes; return the folder, and notes.

    It takes its place whole. Raises SceneError: no method found a normal; or rgbn did not write what lies there.
    """
    folder = job.store.path("export", "heritage")
    for path in (folder, *folder.rglob("*")):
        if not path.is_dir():
            job.record.check_free(path)
    for step in job.wanted("compare"):
        job.run(STEPS, step)
    if job.done[FOLDER]["result"]["surface"] is None:
        raise SceneError(f"{job.session.name}: no method found a normal, so there is nothing to archive.")
    made = job.record.scratch("tmp/heritage")
    notes = _write_payload(job, made / "data", base)
    files = sorted(path for path in made.rglob("*") if path.is_file())
    sums = [f"{file_digest(path)}  {path.relative_to(made).as_posix()}\n" for path in files]
    write_text(made / "manifest-sha256.txt", "".join(sums))
    write_text(made / "bagit.txt", "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n")
    job.record.forget([ARCHIVED])
    with job.record.part_of(ARCHIVED):
        move(made, folder)
    return [folder], [f"heritage: {note}" for note in notes]


def _write_payload(job: Job, data: Path, base: str) -> list[str]:
    """Write `data/`; return notes."""
    store, lights, facts = job.store, job.store.load_lights(), job.done[FOLDER]["result"]
    (order, notes), colours = _ordered(lights.directions), albedo_colours(job)
    pictures = {"picture": ("composite", "mean of the photographs", _write_photographs(job, data, order, colours))}
    pictures |= _write_maps(job, data / "Selene_Output", facts, colours)
    images = [write_tiles(data, base, shown, name, label, part) for name, (part, label, shown) in pictures.items()]
    taken = {f"{place}.TIF": job.session.flash[index] for place, index in enumerate(order, 1)}
    told = {name: {"photograph": path.name, "sha256": job.record.digest(path)} for name, path in taken.items()}
    summary = summed_up(job, "export")
    write_json(data / "summary.json", {**summary, "heritage": told})
    if warned := len(all_warnings(summary)):
        notes.append(f"{warned} warnings stand in data/summary.json; rgbn process shows them.")
    write_json(data / "lights.json", store.read_json("lights.json"))
    if not lights.is_unknown:
        export_lights(data, "lp", lights.only(order), store.load_camera(), files=tuple(taken))
    if facts["pixel_mm"] is None:
        notes.append("nothing tells how large a pixel is: no .tfw and no depthmap_m1 are written; figgy asks for them.")
    if "sigma" not in pictures:
        notes.append(f"{facts['surface']['method']} knows no sigma: that layer is left out.")
    maps = sorted(path.relative_to(data).as_posix() for path in data.glob("*/*.tif"))
    address = write_manifest(data, base, job.session.name, images, facts["pixel_mm"], ["summary.json", *maps])
    return [*notes, f"the manifest's address is {address}, with data/ served there; --base-url gives another."]


def _ordered(directions: NDArray) -> tuple[list[int], list[str]]:
    """Return the photographs' order, first the four whose lights come nearest to `FIRST`; and what to say of it."""
    every = list(range(len(directions)))
    if len(every) < len(FIRST) or not np.isfinite(directions).all():
        return every, ["figgy asks for four photographs with known lights."]
    angles = angular_error_deg(FIRST[:, None], directions[None])
    rows, first = linear_sum_assignment(angles**2)
    said = f"1.TIF to 4.TIF are off by up to {angles[rows, first].max():.0f} degrees from the light that figgy notes."
    return [*first.tolist(), *(index for index in every if index not in first)], [said]


def _write_photographs(job: Job, data: Path, order: list[int], colours: Colours) -> NDArray[np.uint8]:
    """Write the photographs as people see them, all with one white; return their mean, each flash of strength 1."""
    frames, lights = job.store.load_frames(), job.store.load_lights()
    # The camera's RGB of a neutral surface: the brightest that all photographs show is white.
    neutral = np.linalg.solve(colours.matrix, np.ones(3))
    exposure = Exposure.for_frames(frames, white_value=neutral)
    matrix = (colours.matrix.T * (neutral.mean() / exposure.white)).astype(np.float32)
    white, profile = exposure.white * exposure.balance, srgb_profile() if colours.source else None
    strengths = np.nan_to_num(lights.intensities, nan=1.0).astype(np.float32)
    total = np.zeros((frames.height, frames.width, 3), np.float32)
    codes = np.empty(total.shape, np.uint16)
    for place, index in enumerate(order, 1):
        for rows in frames.only([index]).bands(32 << 20):
            linear = frames.read(rows, [index])[0]
            total[rows] += (linear / strengths[index]) @ matrix
            codes[rows] = SRGB[np.round(np.clip(linear @ matrix, 0, 1) * 65535).astype(np.uint16)]
        said = f"sRGB's curve; {colours.colour}; white: {white.tolist()} of the sensor's"
        told = {"photograph": job.session.flash[index].name, "value": said}
        write_map(data / f"{place}.TIF", codes, told, None, iccprofile=profile)
    total *= np.float32(65535 / max(float(np.quantile(total[::4, ::4], SHARE)), 1e-6))
    return EIGHT_BITS[SRGB[np.clip(total, 0, 65535, out=total).astype(np.uint16)]]


def _write_maps(
    job: Job, folder: Path, facts: dict[str, Any], colours: Colours
) -> dict[str, tuple[str, str, NDArray[np.uint8]]]:
    """Write the method's maps as TIFF, lengths in metres; return part in relighting, label and picture of each."""
    store, method, pixel_mm, shown = job.store, facts["surface"]["method"], facts["pixel_mm"], {}

    def write(name: str, values: NDArray, told: dict[str, Any]) -> None:
        profile = srgb_profile() if name == "albedo" and colours.source else None
        path = folder / f"{name}_m1.tif"
        write_map(path, values, {"method": method, **told}, pixel_mm, world_mm=1000, iccprofile=profile)

    for kind, values, told in method_maps(store, method, facts["normals_axes"], colours):
        if kind in ("normals", "albedo"):
            name, codes = kind.removesuffix("s"), SRGB[values] if kind == "albedo" else values
            write(name, codes, {"sRGB of": told["value"], "colour": told["colour"]} if kind == "albedo" else told)
            shown[name] = (name, f"{kind}, {method}", EIGHT_BITS[codes])
    if pixel_mm is not None:
        metres = np.asarray(imread(store.path(FOLDER, f"depth_{method}.tif")) / 1000, np.float32)
        told = {"value": "metres, z toward the camera; negative"}
        write("depthmap", _enlarged(metres, *shown["normal"][2].shape[:2]), told)
    trusted = job.done.get("trust", {}).get("result", {}).get("recommended")
    words, name = ("wrong models included", "recommended") if trusted == method else ("by noise alone", method)
    path = store.path("sigma", f"{name}.npy")
    sigma = np.asarray(store.read_array("sigma", path.name) if path.exists() else np.nan, np.float32)
    if (known := np.isfinite(sigma)).any():
        end = colour_scale_end(float(np.quantile(sigma[known], SHARE)), least=0.1)
        write("sigma", sigma, {"value": f"degrees, one standard deviation of the normal, {words}"})
        label = f"sigma of the normals, {words}: dark 0 to bright {end:g} degrees"
        shown["sigma"] = ("", label, error_picture(sigma, end))
    return shown


def _enlarged(values: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Return a map of every n-th pixel at full size, linear between them."""
    step = -(-width // values.shape[1])
    fine = np.asarray(zoom(values, [((length - 1) * step + 1) / length for length in values.shape], order=1))
    return np.pad(fine, [(0, height - fine.shape[0]), (0, width - fine.shape[1])], mode="edge")
