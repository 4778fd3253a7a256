"""A folder in the DiLiGenT layout, read with every fault of its files, shapes and units."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.image_files import read_pixels
from scene.normal_files import read_normal_map

Array = NDArray[np.float64]
TABLES = ("light_directions.txt", "light_intensities.txt")
NORMALS = ("Normal_gt.mat", "normal.txt", "Normal_gt.png")
MOST_PIXELS = 1600
_UNIT = 0.01
DISAGREES = 0.02
"""Share of the mask that may lack normals, at its border."""
_WRONG_LENGTHS = 0.001


@dataclass
class Layout:
    """What was found; None where it is missing or at fault.

    Parameters
    ----------
    folder : Path
    faults, notes : list of str
        What must be mended; what is suspicious but usable.
    files : list of str
        The N photographs.
    directions, intensities : (N, 3) float64 or None
    mask : (H, W) bool or None
    normals_name : str
        File of the normals.
    normals : (H, W, 3) float64 or None
        As they stand in the file; NaN where there is none.
    """

    folder: Path
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    directions: Array | None = None
    intensities: Array | None = None
    mask: NDArray[np.bool_] | None = None
    normals_name: str = ""
    normals: Array | None = None


def read_layout(folder: Path) -> Layout:
    """Read all but the photographs' pixels.

    Raises
    ------
    SceneError
        There is no such folder.
    """
    if not folder.is_dir():
        raise SceneError(f"{folder}: there is no such folder. Give one in the DiLiGenT layout (docs/datasets.md).")
    found = Layout(folder)
    _read_names(found)
    found.directions, found.intensities = (_read_table(found, name) for name in TABLES)
    _check_directions(found)
    _check_intensities(found)
    _read_mask(found)
    _read_normals(found)
    return found


def _read_names(found: Layout) -> None:
    path = found.folder / "filenames.txt"
    if not path.is_file():
        pictures = sorted(one.name for one in found.folder.glob("[0-9]*.png"))
        there = f"the folder has {len(pictures)} numbered PNGs" if pictures else "the folder has no numbered PNG"
        found.faults.append(f"filenames.txt: missing; {there}. List the photographs there, one a line.")
        return
    names = [line.strip() for line in path.read_text("utf-8-sig", "replace").splitlines() if line.strip()]
    absent = [name for name in names if not (found.folder / name).is_file()]
    twice = sorted({name for name in names if names.count(name) > 1})
    if not names:
        found.faults.append("filenames.txt: names no file. List the photographs there, one a line.")
    if absent:
        found.faults.append(
            f"filenames.txt: {_some(absent)} {_are(absent)} not in the folder. Add, or take off the list."
        )
    if twice:
        found.faults.append(f"filenames.txt: names {_some(twice)} more than once. One line a photograph.")
    found.files = [] if absent or twice else names
    listed = {Path(name).name for name in names}
    spare = [one.name for one in sorted(found.folder.glob("[0-9][0-9][0-9].png")) if one.name not in listed]
    if names and spare:
        found.notes.append(f"filenames.txt: {_some(spare)} {_are(spare)} in the folder but not on the list: left out.")


def _read_table(found: Layout, name: str) -> Array | None:
    path = found.folder / name
    if not path.is_file():
        found.faults.append(f"{name}: missing. Write three numbers a line, one line a photograph.")
        return None
    rows = [line.replace(",", " ").split() for line in path.read_text("utf-8-sig", "replace").splitlines()]
    rows = [row for row in rows if row]
    bad = next((number for number, row in enumerate(rows, 1) if len(row) != 3 or not _are_numbers(row)), None)
    if not rows or bad is not None:
        where = f"line {bad} is {' '.join(rows[bad - 1])[:60]!r}" if bad is not None else "it is empty"
        found.faults.append(f"{name}: {where}; expected three numbers a line, one line a photograph.")
        return None
    table = np.array(rows, float)
    if found.files and len(table) != len(found.files):
        found.faults.append(
            f"{name}: found {len(table)} rows, expected {len(found.files)}, one for each line of filenames.txt. Add or "
            "remove rows; their order is that of filenames.txt."
        )
        return None
    wrong = np.flatnonzero(~np.isfinite(table).all(1)) + 1
    if len(wrong):
        found.faults.append(f"{name}: row {_some(wrong)} {_are(wrong)} not finite. Give every light its numbers.")
        return None
    return table


def _check_directions(found: Layout) -> None:
    name, table = TABLES[0], found.directions
    if table is None:
        return
    length = np.linalg.norm(table, axis=1)
    if length.min() < 1e-6:
        found.faults.append(f"{name}: row {_some(np.flatnonzero(length < 1e-6) + 1)} is zero. Give a direction.")
        found.directions = None
        return
    off = np.flatnonzero(np.abs(length - 1) > _UNIT) + 1
    if len(off):
        places = " They look like positions: this layout holds directions." if np.median(length) > 3 else ""
        found.faults.append(
            f"{name}: row {_some(off)} {'has' if len(off) == 1 else 'have'} the length {length[off[0] - 1]:.4g}"
            f"{' (the first)' if len(off) > 1 else ''}, expected 1: unit vectors toward the lights.{places} Divide "
            "each row by its length."
        )
    table = found.directions = table / length[:, None]
    singular = np.linalg.svd(table, compute_uv=False)
    if len(table) < 3 or singular[2] < 0.02 * singular[0]:
        found.faults.append(
            f"{name}: {len(table)} lights whose directions span no space (smallest to largest singular value "
            f"{singular[-1] / singular[0]:.4f}, expected above 0.02). Three that are not in one plane are the least."
        )


def _check_intensities(found: Layout) -> None:
    table = found.intensities
    if table is None:
        return
    low = np.flatnonzero((table <= 0).any(1)) + 1
    if len(low):
        found.faults.append(f"{TABLES[1]}: row {_some(low)} {_are(low)} not above 0. Give R G B of each light.")
        found.intensities = None


def _read_mask(found: Layout) -> None:
    path = found.folder / "mask.png"
    if not path.is_file():
        found.faults.append("mask.png: missing. White where the object is, black elsewhere, of the photographs' size.")
        return
    import cv2

    try:
        image = read_pixels(path, cv2.IMREAD_UNCHANGED)
    except SceneError as error:
        found.faults.append(_inside(found, str(error)))
        return
    values = image.reshape(*image.shape[:2], -1)[..., :3].max(-1)
    low, high = int(values.min()), int(values.max())
    if low == high:
        kind = "white" if high > 0 else "black"
        found.faults.append(f"mask.png: all {kind}. Expected white where the object is, black elsewhere.")
        return
    found.mask = values > (low + high) / 2


def _read_normals(found: Layout) -> None:
    there = [name for name in NORMALS if (found.folder / name).is_file()]
    if not there:
        found.faults.append(
            "Normal_gt.mat: missing, and so are normal.txt and Normal_gt.png. Without true normals nothing can be "
            "judged; give one of them."
        )
        return
    if found.mask is None:
        return
    name = found.normals_name = there[0]
    height, width = found.mask.shape
    try:
        values = read_normal_map(found.folder / name, height, width).astype(np.float64)
    except SceneError as error:
        found.faults.append(f"{_inside(found, str(error))}{_is_turned(found, name, height, width)}")
        return
    bad = np.asarray(~np.isfinite(values).all(-1))
    length: Array = np.asarray(np.linalg.norm(np.where(bad[..., None], 0, values), axis=-1))
    known = length > 0.1
    if not known.any():
        found.faults.append(f"{name}: no pixel has a normal (all are zero or no numbers).")
        return
    tolerance = 0.05 if name.endswith(".png") else _UNIT
    off = np.abs(length[known] - 1) > tolerance
    if off.mean() > _WRONG_LENGTHS:
        found.faults.append(
            f"{name}: {off.mean():.1%} of the vectors are not of length 1 (median length "
            f"{np.median(length[known]):.4g}). Divide each by its length; where there is none, write 0 0 0."
        )
    if (bad & found.mask).any() and not name.endswith(".png"):
        found.notes.append(
            f"{name}: {int((bad & found.mask).sum())} pixels under the mask are NaN or infinite: no normal."
        )
    found.normals = np.where(known[..., None], values / np.maximum(length, 1e-9)[..., None], np.nan)


def mask_faults(found: Layout, normals: Array) -> list[str]:
    """Return what the mask and normals (H, W, 3), laid as the photographs lie, contradict each other in."""
    assert found.mask is not None
    mask, known, name = found.mask, np.isfinite(normals[..., 0]), found.normals_name
    missing, beyond = (mask & ~known).sum() / mask.sum(), (known & ~mask).sum() / mask.sum()
    if missing <= DISAGREES:
        if beyond > DISAGREES:
            found.notes.append(f"{name}: normals also outside mask.png, {beyond:.0%} of its size: not judged.")
        return []
    inverted = (~mask & ~known).sum() / max((~mask).sum(), 1) < DISAGREES
    do = "mask.png seems inverted: white is the object" if inverted else "Draw the mask where normals are known"
    return [f"mask.png: {missing:.1%} of its pixels have no normal in {name}, expected none. {do}."]


def _is_turned(found: Layout, name: str, height: int, width: int) -> str:
    """Return a hint where a map has the size of one that is transposed."""
    if height == width or name == "normal.txt":
        return ""
    try:
        read_normal_map(found.folder / name, width, height)
    except SceneError:
        return ""
    return f" It has the size of a transposed map: store {height} rows of {width} pixels."


def _inside(found: Layout, message: str) -> str:
    return message.removeprefix(f"{found.folder}/")


def _are_numbers(words: list[str]) -> bool:
    try:
        [float(word) for word in words]
    except ValueError:
        return False
    return True


def _are(things) -> str:
    return "is" if len(things) == 1 else "are"


def _some(things) -> str:
    """Return the first few of some names or numbers."""
    words = [str(one) for one in things]
    return ", ".join(words[:5]) + (f" and {len(words) - 5} more" if len(words) > 5 else "")
