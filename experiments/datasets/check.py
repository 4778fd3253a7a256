"""`rgbn dataset check`: is a folder in the DiLiGenT layout what it says, by its files and by its photographs?"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import TABLES, DiligentFolder, read_layout
from formats.picture_files import read_values
from scene.errors import SceneError
from scene.reading import listed
from solve.convention import CLIPPED, DISAGREES, FLOOR, Claim, Convention, infer_convention
from solve.plausible_axes import axes_words

Array = NDArray[np.float64]
LEAST_LIGHTS = 3
MOST_PIXELS = 1600
_MUCH_CLIPPED = 0.3
"""Share of the object from which a photograph is called clipped."""
_SPREAD, _CLEARLY_LESS = 0.1, 0.4
_OFF, _OFF_MADS = 0.35, 6.0
_FEW = 0.2

WORDS = {
    "(-x, y, z)": "x points left",
    "(x, -y, z)": "y points down",
    "(x, y, -z)": "z points away from the viewer",
    "(x, -y, -z)": "y points down and z away from the viewer (OpenCV's frame)",
    "(-x, -y, z)": "x points left and y down",
    "(-x, y, -z)": "x points left and z away from the viewer",
    "(-x, -y, -z)": "all three point the other way",
    "(y, x, z)": "x and y are swapped",
}


@dataclass
class Verdict:
    """What a check found."""

    folder: Path
    faults: tuple[str, ...]  # what must be mended
    notes: tuple[str, ...]  # what is suspicious but usable
    # `photographs`, `agreement` (median correlation of the photographs with Lambert's law, as given), `best` (in the
    # best convention) and more.
    facts: dict[str, float | int | str] = field(default_factory=dict)


def check_dataset(folder: Path) -> Verdict:
    """Check files, shapes and units, and then the conventions against the photographs.

    Raises
    ------
    SceneError
        There is no such folder.
    """
    found = read_layout(folder)
    samples = _read_samples(found)
    facts: dict[str, float | int | str] = {"photographs": len(found.files)}
    mask, normals, directions, intensities = found.mask, found.normals, found.directions, found.intensities
    if mask is not None:
        facts |= {"height": mask.shape[0], "width": mask.shape[1], "object_pixels": int(mask.sum())}
    if samples is None or mask is None or normals is None or directions is None or intensities is None:
        if normals is not None:
            _tell_mask(found, normals)
    elif len(directions) >= LEAST_LIGHTS:
        proved = infer_convention(Claim(mask, normals, directions, intensities, *samples))
        facts |= {"agreement": proved.agreement, "best": proved.best}
        if not proved.explained:
            _tell_unexplained(found, proved)
        _tell_mask(found, proved.normals)
        if proved.intensities is not None:
            _tell_axes(found, proved)
            _tell_rows(found, proved)
            facts["intensity_spread"] = _tell_intensities(found, intensities, proved.intensities)
    return Verdict(folder, tuple(found.faults), tuple(found.notes), facts)


def _read_samples(found: DiligentFolder) -> tuple[NDArray[np.intp], NDArray[np.float32]] | None:
    """Return places (P,) of some of the object's pixels, row by row, and their values (P, N, 3), 0 to 1, as in files.

    What is wrong with the photographs is appended to the layout's faults and notes. None where there is no mask, or a
    photograph is at fault.
    """
    mask = found.mask
    size, inside = (None, np.zeros(0, np.intp)) if mask is None else (mask.shape, np.flatnonzero(mask))
    places = inside[np.unique(np.linspace(0, len(inside) - 1, min(MOST_PIXELS, len(inside))).astype(int))]
    values, faults = np.zeros((len(places), len(found.files), 3), np.float32), []
    shallow, dark, clipped, within, around = [], [], [], 0.0, 0.0
    for index, name in enumerate(found.files):
        try:
            image, white = read_values(found.folder / name, SceneError, do="Save it as a 16-bit PNG.")
        except SceneError as error:
            faults.append(str(error).removeprefix(f"{found.folder}/"))
            continue
        size = size or image.shape[:2]
        if image.shape[:2] != size:
            faults.append(
                f"{name}: {image.shape[1]} x {image.shape[0]} px, expected {size[1]} x {size[0]} px, the size of "
                f"{found.files[0] if mask is None else 'mask.png'}."
            )
        elif image.dtype not in (np.uint8, np.uint16):
            faults.append(f"{name}: holds {image.dtype}, expected whole numbers of 16 bits. Save it as a 16-bit PNG.")
        elif mask is not None:
            colours = image if image.ndim == 3 else np.repeat(image[..., None], 3, -1)
            scaled = colours[..., :3].astype(np.float32) / white
            values[:, index] = scaled.reshape(-1, 3)[places]
            within, around = within + float(scaled[mask].mean()), around + float(scaled[~mask].mean())
            shallow += [name] * (image.dtype == np.uint8)
            dark += [name] * (not scaled[mask].any())
            clipped += [name] * bool((values[:, index].max(-1) >= CLIPPED).mean() > _MUCH_CLIPPED)
    found.faults += faults
    if shallow:
        found.notes.append(f"{listed(shallow)}: 8 bits, expected 16. Dark places have few steps; save 16-bit PNGs.")
    if dark:
        found.faults.append(
            f"{listed(dark)}: black all over the object. The flash did not fire? Take it off the lists."
        )
    if clipped:
        found.notes.append(f"{listed(clipped)}: more than {_MUCH_CLIPPED:.0%} of the object is clipped. Expose less.")
    if around > within > 0:
        found.notes.append("mask.png: the photographs are brighter outside it than inside. White must be the object.")
    return None if faults or mask is None or not found.files else (places, values)


def _tell_mask(found: DiligentFolder, normals: Array) -> None:
    """Append what the mask and normals (H, W, 3), laid as the photographs lie, contradict each other in."""
    assert found.mask is not None
    mask, known, name = found.mask, np.isfinite(normals[..., 0]), found.normals_name
    missing, beyond = (mask & ~known).sum() / mask.sum(), (known & ~mask).sum() / mask.sum()
    if missing > DISAGREES:
        inverted = (~mask & ~known).sum() / max((~mask).sum(), 1) < DISAGREES
        do = "mask.png seems inverted: white is the object" if inverted else "Draw the mask where normals are known"
        found.faults.append(f"mask.png: {missing:.1%} of its pixels have no normal in {name}, expected none. {do}.")
    elif beyond > DISAGREES:
        found.notes.append(f"{name}: normals also outside mask.png, {beyond:.0%} of its size: not judged.")


def _tell_axes(found: DiligentFolder, proved: Convention) -> None:
    """Append the faults of the axes and of how the map lies."""
    name, given, best = found.normals_name, proved.agreement, proved.best
    if proved.hollow:
        found.notes.append(
            f"{name}: the normals point inward at the object's rim. That is right for a hollow; of any other object x "
            "and y have the wrong sign, in the normals and in the lights."
        )
    if proved.turned:
        found.faults.append(
            f"{found.files[0]} ...: the photographs are {proved.lies} against {name} and {TABLES[0]} (agreement "
            f"{given:.2f}, put right {best:.2f}). Mirror or turn the photographs and mask.png."
        )
    elif proved.lies:
        found.faults.append(
            f"{name}: the map is {proved.lies} against the photographs (agreement {given:.2f}, put right {best:.2f}). "
            "Store it as the photographs lie."
        )
    if not np.array_equal(proved.of_normals, np.eye(3)):
        found.faults.append(_axes_fault(name, proved.of_normals, proved))
    if not np.array_equal(proved.of_lights, np.eye(3)):
        # A hollow looks like a half turn of x and y.
        certain = proved.certain and not np.array_equal(proved.of_lights, np.diag([-1, -1, 1]))
        or_else = "" if certain else f" Or {name} is in other axes: the photographs tell that the two differ."
        found.faults.append(_axes_fault(TABLES[0], proved.of_lights, proved) + or_else)


def _axes_fault(name: str, turn: Array, proved: Convention) -> str:
    """Return what to say of vectors that `turn` (3, 3) mends."""
    return (
        f"{name}: {WORDS.get(axes_words(turn), 'the axes are permuted')}; expected x right, y up, z toward the viewer, "
        f"from the surface to the light (agreement {proved.agreement:.2f}, put right {proved.best:.2f}). For x, y, z "
        f"write {axes_words(turn)}."
    )


def _tell_rows(found: DiligentFolder, proved: Convention) -> None:
    wrong, best = proved.misplaced, proved.rows.argmax(1)
    if not len(wrong):
        return
    shown = listed([f"{found.files[i]} that of row {best[i] + 1}" for i in wrong])
    found.faults.append(
        f"filenames.txt: {len(wrong)} of {len(best)} photographs show another light than their row of {TABLES[0]}: "
        f"{shown}. Put both in one order."
    )


def _tell_unexplained(found: DiligentFolder, proved: Convention) -> None:
    if proved.in_other_order:
        _tell_rows(found, proved)
        return
    found.faults.append(
        f"{found.normals_name}: no axes of normals or lights, and no mirroring of the map, explain the photographs "
        f"(agreement with Lambert's law at best {proved.best:.2f}, expected above {FLOOR:g}). Are the normals of this "
        "object and at this place, and the lights of these photographs?"
    )


def _tell_intensities(found: DiligentFolder, given: Array, seen: Array) -> float:
    """Append what is wrong with the intensities (N, 3); return the spread of those seen over those given."""
    name = TABLES[1]
    seen = np.log(seen)
    told = np.log(given) - np.log(given).mean(0)
    spread = float(np.std(seen - told))
    ratio = (seen - told).mean(1)
    ratio -= np.median(ratio)
    limit = max(_OFF, _OFF_MADS * 1.4826 * float(np.median(np.abs(ratio))))
    off = np.flatnonzero(np.abs(ratio) > limit)
    others = {
        "the photographs look as if all lights were alike. Were they divided by these? Then write 1 1 1": 0 * told,
        "they are the inverse of what the photographs show. Write 1 / each number": -told,
        "they are the square roots of what the photographs show. Write the square of each number": 2 * told,
        "red and blue are swapped. Write R G B": told[:, ::-1],
    }
    words, least = min(((text, float(np.std(seen - other))) for text, other in others.items()), key=lambda one: one[1])
    if len(off) <= _FEW * len(ratio) + 1 and len(off):
        shown = listed([f"row {i + 1} by {np.exp(ratio[i]):.2g}" for i in off])
        found.faults.append(
            f"{name}: the photographs show other intensities than given: {shown} (1 is right). Measure them "
            "again, or take the photographs off the lists."
        )
    elif spread > _SPREAD and least < _CLEARLY_LESS * spread:
        found.faults.append(f"{name}: {words} (spread of seen over given {spread:.0%}, put right {least:.0%}).")
    elif spread > _OFF:
        found.faults.append(
            f"{name}: not what the photographs show, but for one factor (spread of seen over given {spread:.0%}, "
            f"expected under {_OFF:.0%}). Measure the intensities again."
        )
    return spread
