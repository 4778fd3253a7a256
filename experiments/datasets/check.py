"""`rgbn dataset check`: is a folder in the DiLiGenT layout what it says, by its files and by its photographs?"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.datasets.axes_message import lights_fault, normals_fault
from experiments.datasets.checked_photographs import CLIPPED, Samples, read_samples
from experiments.datasets.convention import Evidence, arrangements, fitted_intensities
from formats.diligent_layout import TABLES, Layout, read_layout
from solve.axes import AXES
from solve.axes_test import axes_by_themselves

Array = NDArray[np.float64]
LEAST_LIGHTS = 3
DISAGREES = 0.02
"""Share of the mask that may lack normals, at its border."""
_BETTER, _HALF = 0.05, 0.5
"""Another convention is taken when it agrees by so much more, and leaves at most this share of the disagreement."""
_ALIKE = 0.02
_FLOOR = 0.5
"""Agreement under which the photographs are not explained at all."""
_GOOD = 0.9
_ROW_GAP = 0.2
_SPREAD, _CLEARLY_LESS = 0.1, 0.4
_OFF, _OFF_MADS = 0.35, 6.0
_FEW = 0.2
_NAMED = 5


@dataclass
class Verdict:
    """What a check found.

    Parameters
    ----------
    folder : Path
    faults, notes : tuple of str
        What must be mended; what is suspicious but usable.
    facts : dict
        `photographs`, `agreement` (median correlation of the photographs with Lambert's law, as given), `best` (in the
        best convention) and more.
    """

    folder: Path
    faults: tuple[str, ...]
    notes: tuple[str, ...]
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
        facts |= _judge(found, samples, mask, normals, directions, intensities)
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


def _judge(
    found: Layout, samples: Samples, mask: NDArray[np.bool_], normals: Array, directions: Array, intensities: Array
) -> dict[str, float | int | str]:
    """Append what the photographs contradict; return the figures."""
    evidence = _evidence(samples, intensities)
    ways = arrangements(*mask.shape)
    maps = [normals.reshape(-1, 3)[way.places] for way in ways]
    at = [one.reshape(-1, 3)[samples.places] for one in maps]
    scores = np.array([evidence.all_axes(one, directions) for one in at])
    if scores.max() < _GOOD:
        # Wrong intensities hide the axes: without any, they may show.
        plain = _evidence(samples, np.ones_like(intensities))
        others = np.array([plain.all_axes(one, directions) for one in at])
        if others.max() > scores.max() + _BETTER:
            evidence, scores = plain, others
    covers = [float((mask & ~np.isfinite(one[..., 0])).sum() / mask.sum()) <= DISAGREES for one in maps]
    way, axes = _simplest(scores, covers)
    given, best = float(scores[0, 0]), float(scores[way, axes])
    facts: dict[str, float | int | str] = {"agreement": given, "best": best}
    wrong = best - given > _BETTER and 1 - best < _HALF * (1 - given)
    if not wrong:
        way = axes = 0
    rows = evidence.rows_of(at[0], directions)
    if best < _FLOOR or (wrong and _is_other_order(rows, best)):
        _tell_unexplained(found, rows, best)
        found.faults += mask_faults(found, normals)
        return facts
    found.faults += mask_faults(found, maps[way])
    how = (way, axes, given, best)
    of_lights, of_normals = _tell_axes(found, mask, normals, maps[way], ways[way].words, how, wrong)
    at_best, directions = at[way] @ of_normals.T, directions @ of_lights.T
    seen = fitted_intensities(samples.values, intensities, at_best, directions)
    # An intensity that is wrong makes a photograph look like another: rows are at fault only where neither will do.
    by_both = [_evidence(samples, each).rows_of(at_best, directions) for each in (intensities, seen)]
    _tell_rows(found, min(by_both, key=lambda rows: float(np.sum(_gaps(rows) > _ROW_GAP))))
    facts["intensity_spread"] = _tell_intensities(found, intensities, seen)
    return facts


def _evidence(samples: Samples, intensities: Array) -> Evidence:
    gray = (samples.values / intensities.astype(np.float32)).mean(-1)
    return Evidence(gray, samples.values.max(-1) >= CLIPPED)


def _simplest(scores: Array, covers: list[bool]) -> tuple[int, int]:
    """Return the way to lie and the axes that agree best; of those alike, the ones that change least.

    Parameters
    ----------
    scores : (W, 48) float64
    covers : list of W bool
        Lying so, the map has normals all over the mask.
    """
    changed = [int(np.count_nonzero(axes != AXES[0])) for axes in AXES]
    most = float(scores.max())
    alike = np.argwhere(scores >= most - min(_ALIKE, max(0.002, _HALF * (1 - most))))

    def cost(pair):
        return not covers[pair[0]], pair[0] > 0, changed[pair[1]], pair[0], -scores[tuple(pair)]

    way, axes = min(alike, key=cost)
    return int(way), int(axes)


def _tell_axes(
    found: Layout,
    mask: NDArray[np.bool_],
    given_map: Array,
    normals: Array,
    words: str,
    how: tuple[int, int, float, float],
    wrong: bool,
) -> tuple[Array, Array]:
    """Append the faults of the axes and of how the map lies; return what mends lights and normals, (3, 3) each.

    Parameters
    ----------
    found : Layout
    mask : (H, W) bool
    given_map, normals : (H, W, 3) float64
        As in the file, and as the photographs lie.
    words : str
        How the two differ.
    how : tuple
        Number of that way, and of the best axes; agreement as given, and in these.
    wrong : bool
        Those as given are not the best.
    """
    way, axes, given, best = how
    relation = AXES[axes]
    alone = axes_by_themselves(normals, mask, AXES)
    # Of a hollow the rim misleads: it counts only where it leaves nothing for the lights to be wrong in.
    by_rim = wrong and (alone.plain or np.array_equal(AXES[alone.by_rim], relation))
    own = alone.by_rim if by_rim else alone.plain
    if not wrong and not own and alone.by_rim:
        found.notes.append(
            f"{found.normals_name}: the normals point inward at the object's rim. That is right for a hollow; of any "
            "other object x and y have the wrong sign, in the normals and in the lights."
        )
    as_it_lies = np.isfinite(given_map[..., 0])
    if way and own and not axes and not axes_by_themselves(given_map, as_it_lies, AXES).by_rim:
        found.faults.append(
            f"{found.files[0]} ...: the photographs are {words} against {found.normals_name} and {TABLES[0]} ("
            f"agreement {given:.2f}, put right {best:.2f}). Mirror or turn the photographs and mask.png."
        )
        return np.eye(3), np.eye(3)
    mended = AXES[own]
    turn = mended @ relation.T
    if way:
        found.faults.append(
            f"{found.normals_name}: the map is {words} against the photographs (agreement {given:.2f}, put right "
            f"{best:.2f}). Store it as the photographs lie."
        )
    if own:
        found.faults.append(normals_fault(found.normals_name, mended, given, best))
    if not np.array_equal(turn, np.eye(3)):
        found.faults.append(lights_fault(turn, given, best, certain=alone.told, normals_name=found.normals_name))
    return turn, mended


def _is_other_order(rows: Array, best: float) -> bool:
    """Whether the lights' rows in another order, each used about once, explain more than any axes do."""
    used = len(set(rows.argmax(1).tolist()))
    return used >= (1 - _FEW) * len(rows) and float(np.median(rows.max(1))) > best + _BETTER


def _gaps(rows: Array) -> Array:
    """Return how much better than its own row the best row explains each photograph (N,)."""
    return rows.max(1) - np.diag(rows)


def _tell_rows(found: Layout, rows: Array) -> None:
    wrong = np.flatnonzero(_gaps(rows) > _ROW_GAP)
    if not len(wrong):
        return
    shown = ", ".join(f"{found.files[i]} that of row {int(rows[i].argmax()) + 1}" for i in wrong[:_NAMED])
    more = f" and {len(wrong) - _NAMED} more" if len(wrong) > _NAMED else ""
    found.faults.append(
        f"filenames.txt: {len(wrong)} of {len(rows)} photographs show another light than their row of {TABLES[0]}: "
        f"{shown}{more}. Put both in one order."
    )


def _tell_unexplained(found: Layout, rows: Array, best: float) -> None:
    if np.median(rows.max(1)) > _FLOOR and np.median(_gaps(rows)) > _ROW_GAP:
        _tell_rows(found, rows)
        return
    found.faults.append(
        f"{found.normals_name}: no axes of normals or lights, and no mirroring of the map, explain the photographs "
        f"(agreement with Lambert's law at best {best:.2f}, expected above {_FLOOR:g}). Are the normals of this object "
        "and at this place, and the lights of these photographs?"
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
        shown = ", ".join(f"row {i + 1} by {np.exp(ratio[i]):.2g}" for i in off[:_NAMED])
        more = f" and {len(off) - _NAMED} more" if len(off) > _NAMED else ""
        found.faults.append(
            f"{name}: the photographs show other intensities than given: {shown}{more} (1 is right). Measure them "
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
