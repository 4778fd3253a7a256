"""`rgbn dataset check`: is a folder in the DiLiGenT layout what it says, by its files and by its photographs?"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.datasets.checked_photographs import read_samples
from formats.diligent_layout import TABLES, Layout, read_layout
from scene.reading import listed
from solve.axes import Axes
from solve.convention import DISAGREES, FLOOR, Claim, Convention, infer_convention

Array = NDArray[np.float64]
LEAST_LIGHTS = 3
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
    samples = read_samples(found)
    facts: dict[str, float | int | str] = {"photographs": len(found.files)}
    mask, normals, directions, intensities = found.mask, found.normals, found.directions, found.intensities
    if mask is not None:
        facts |= {"height": mask.shape[0], "width": mask.shape[1], "object_pixels": int(mask.sum())}
    if samples is None or mask is None or normals is None or directions is None or intensities is None:
        if normals is not None:
            found.faults += mask_faults(found, normals)
    elif len(directions) >= LEAST_LIGHTS:
        proved = infer_convention(Claim(mask, normals, directions, intensities, samples.places, samples.values))
        facts |= {"agreement": proved.agreement, "best": proved.best}
        if not proved.explained:
            _tell_unexplained(found, proved)
        found.faults += mask_faults(found, proved.normals)
        if proved.intensities is not None:
            _tell_axes(found, proved)
            _tell_rows(found, proved)
            facts["intensity_spread"] = _tell_intensities(found, intensities, proved.intensities)
    return Verdict(folder, tuple(found.faults), tuple(found.notes), facts)


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


def _tell_axes(found: Layout, proved: Convention) -> None:
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
        found.faults.append(normals_fault(name, proved.of_normals, given, best))
    if not np.array_equal(proved.of_lights, np.eye(3)):
        found.faults.append(lights_fault(proved.of_lights, given, best, certain=proved.certain, normals_name=name))


def _tell_rows(found: Layout, proved: Convention) -> None:
    wrong, best = proved.misplaced, proved.rows.argmax(1)
    if not len(wrong):
        return
    shown = listed([f"{found.files[i]} that of row {best[i] + 1}" for i in wrong])
    found.faults.append(
        f"filenames.txt: {len(wrong)} of {len(best)} photographs show another light than their row of {TABLES[0]}: "
        f"{shown}. Put both in one order."
    )


def _tell_unexplained(found: Layout, proved: Convention) -> None:
    if proved.in_other_order:
        _tell_rows(found, proved)
        return
    found.faults.append(
        f"{found.normals_name}: no axes of normals or lights, and no mirroring of the map, explain the photographs "
        f"(agreement with Lambert's law at best {proved.best:.2f}, expected above {FLOOR:g}). Are the normals of this "
        "object and at this place, and the lights of these photographs?"
    )


def _tell_intensities(found: Layout, given: Array, seen: Array) -> float:
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


def lights_fault(turn: Array, given: float, best: float, *, certain: bool, normals_name: str) -> str:
    """Return what to say of light directions that `turn` (3, 3) mends.

    given, best: agreement of the photographs with Lambert's law, as given and mended. certain: the normals tell that it
    is not they.
    """
    words = _axes_words(turn)
    if words == "all three point the other way":
        words = "they go from the light to the surface"
    or_else = "" if certain and not _is_half_turn(turn) else (
        f" Or {normals_name} is in other axes: the photographs tell that the two differ."
    )  # fmt: skip
    return (
        f"light_directions.txt: {words}; expected x right, y up, z toward the viewer, from the surface to the light "
        f"(agreement {given:.2f}, put right {best:.2f}). {_axes_cure(turn, 'columns')}{or_else}"
    )


def normals_fault(name: str, turn: Array, given: float, best: float) -> str:
    """Return what to say of a normal map that `turn` (3, 3) mends."""
    return (
        f"{name}: {_axes_words(turn)}; expected x right, y up, z toward the viewer (by the map's own slopes and rim; "
        f"agreement {given:.2f}, put right {best:.2f}). {_axes_cure(turn, 'components')}"
    )


def _axes_words(turn: Array) -> str:
    """Return in words what is wrong with axes that `turn` (3, 3) mends."""
    return WORDS.get(str(Axes(turn)), "the axes are permuted")


def _axes_cure(turn: Array, things: str) -> str:
    """Return the sentence that says what to do to columns or components for `turn` (3, 3)."""
    flips = [axis for axis in range(3) if turn[axis, axis] == -1]
    if np.count_nonzero(np.diag(turn)) == 3:
        if len(flips) == 3:
            return f"Change the sign of all {things}."
        which = " and ".join(("first", "second", "third")[axis] for axis in flips)
        return f"Change the sign of the {which} of the {things}."
    return f"Of {things} (x, y, z) write {Axes(turn)}."


def _is_half_turn(turn: Array) -> bool:
    """Whether x and y change sign, which a hollow looks like."""
    return np.array_equal(turn, np.diag([-1.0, -1.0, 1.0]))
