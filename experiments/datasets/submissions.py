"""Submissions: a folder with submission.toml and one normal map a dataset; what is wrong with it, all at once."""

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from experiments.catalogue import first_name
from experiments.datasets.check import axes_cure, axes_words
from experiments.datasets.checked_photographs import read_samples
from experiments.datasets.shelf import entries
from formats.diligent_layout import FILENAMES, MASK, Layout, read_layout
from formats.normal_maps import read_normal_map
from scene.errors import SceneError
from scene.normals import angular_error_deg, unit
from scene.reading import listed, reading, shortened, text_of, told
from solve.axes import AXES, INVERTED, some_pixels
from solve.convention import CLIPPED, arrangements

Array = NDArray[np.float64]
FILE = "submission.toml"
SUFFIXES = (".npy", ".png")
_CLEARLY, _DEGREES = 0.6, 5.0
"""Other axes are believed where they leave at most this share of the mean error, and take so many degrees off it."""
_ALIKE = 0.1
"""Degrees within which axes fit alike: of those the first, which changes least."""
_LENGTH = {".npy": 0.01, ".png": 0.05}
_LIT = 0.1


class Description(BaseModel):
    """What submission.toml says."""

    model_config = ConfigDict(extra="forbid", strict=True)

    method: str = Field(pattern=r"^[A-Z][A-Za-z0-9 ._+-]{0,39}$")
    authors: str = Field(min_length=1)
    settings: str = Field(min_length=1)
    hardware: str = Field(min_length=1)
    seconds: float = Field(gt=0, allow_inf_nan=False)  # of one dataset, on the mean
    paper: str = ""
    code: str = ""


_EXPECTED = {
    "method": "a name that begins with a capital: up to 40 letters, digits, blanks, . _ + -",
    "authors": "their names, with commas",
    "settings": "in words, what was chosen and how; the same for all datasets",
    "hardware": "processor or graphics card",
    "seconds": "a number above 0, of one dataset on the mean",
    "paper": "a text or a link",
    "code": "a link",
}


@dataclass
class Submission:
    """What was found in a submission's folder."""

    folder: Path
    description: Description | None = None
    maps: dict[str, Path] = field(default_factory=dict)  # by the dataset's name
    faults: list[str] = field(default_factory=list)  # what must be mended
    notes: list[str] = field(default_factory=list)  # what is suspicious but usable

    @property
    def method(self) -> str:
        """The method's name."""
        return self.description.method if self.description else self.folder.name

    @property
    def seconds(self) -> float:
        """Of one dataset, on the mean."""
        return self.description.seconds if self.description else float("nan")


def dataset_folders(shelf: Path) -> dict[str, Path]:
    """Return the folders of the datasets there are, by name: those of a shelf, and any other in the layout below it."""
    found = {one.name: one.folder for one in entries(shelf) if one.state and not one.same_as}
    for path in sorted(shelf.glob("*")):
        if (path / FILENAMES).is_file() and (path / MASK).is_file():
            found.setdefault(path.name, path)
    return found


def read_submissions(folder: Path, shelf: Path) -> list[Submission]:
    """Return the submissions of a folder: itself, or each folder in it with a submission.toml; checked.

    Raises
    ------
    SceneError
        There is none, or one is at fault: all faults of all.
    """
    places = [folder] if (folder / FILE).is_file() else sorted(path.parent for path in folder.glob(f"*/{FILE}"))
    if not places:
        raise SceneError(f"{folder}: found no submission, expected a folder with {FILE}, or folders with one each.")
    there = dataset_folders(shelf)
    found = [check_submission(place, there) for place in places]
    for name, count in Counter(one.method for one in found).items():
        if count > 1:
            found[0].faults.append(f"method: {name} names {count} submissions. Give each method its own name.")
    wrong = [told(one.folder, one.faults, "not scored, ") for one in found if one.faults]
    if wrong:
        raise SceneError("\n".join(wrong))
    return found


def check_submission(folder: Path, there: Mapping[str, Path]) -> Submission:
    """Check a submission against datasets, {name: folder}.

    A map's axes are held against the truth, or where a dataset has none against least squares of its photographs.
    """
    found = Submission(folder)
    _read_description(found)
    _find_maps(found, there)
    turns: Counter[tuple[str, int]] = Counter()
    errors: dict[tuple[str, int], list[tuple[str, float, float]]] = {}
    gaps = []
    for name, path in found.maps.items():
        layout = read_layout(there[name])
        if layout.mask is None:
            raise SceneError(told(there[name], layout.faults))
        try:
            normals = _read_map(path, layout.mask, found)
        except SceneError as error:
            found.faults.append(str(error).removeprefix(f"{folder}/"))
            continue
        gap = float(np.isnan(normals[layout.mask][:, 0]).mean())
        gaps += [f"{path.name} {gap:.1%}"] if gap else []
        if gap == 1:
            found.faults.append(f"{path.name}: no pixel of the object has a normal (all are zero or no numbers).")
        elif (better := _other_axes(normals, layout)) is not None:
            turn, given, best = better
            turns[turn] += 1
            errors.setdefault(turn, []).append((path.name, given, best))
    for turn, cases in errors.items():
        _tell_axes(found, turn, cases)
    if gaps:
        found.notes.append(f"gaps, each counted as 90 degrees in one of the two means: {listed(gaps)}.")
    missing = [name for name in there if name not in found.maps]
    if missing:
        found.notes.append(f"{len(missing)} of {len(there)} datasets have no map here: {listed(missing)}. Allowed.")
    return found


def submitted_normals(path: Path, mask: NDArray[np.bool_]) -> Array:
    """Return the unit normals (H, W, 3) of a submitted map; NaN where there is none, and outside the mask."""
    values = read_normal_map(path, *mask.shape).astype(np.float64)
    known = mask & np.isfinite(values).all(-1)
    known &= np.linalg.norm(np.where(known[..., None], values, 0), axis=-1) > 0.1
    return unit(np.where(known[..., None], values, np.nan))


def _read_description(found: Submission) -> None:
    path = found.folder / FILE
    if not path.is_file():
        found.faults.append(f"{FILE}: missing. Write {', '.join(_EXPECTED)} into it.")
        return
    try:
        with reading(path, "not TOML", do="Correct that line."):
            data = tomllib.loads(text_of(path))
    except SceneError as error:
        found.faults.append(str(error).removeprefix(f"{found.folder}/"))
        return
    try:
        found.description = Description.model_validate(data)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            key = ".".join(map(str, fault["loc"]))
            if key not in _EXPECTED:
                found.faults.append(f"{FILE}: {key}: unknown key; there are {', '.join(_EXPECTED)}.")
            else:
                said = "missing" if fault["type"] == "missing" else f"found {shortened(repr(fault['input']), 80)}"
                found.faults.append(f"{FILE}: {key}: {said}; expected {_EXPECTED[key]}.")


def _find_maps(found: Submission, there: Mapping[str, Path]) -> None:
    import difflib

    others = []
    for path in sorted(found.folder.iterdir()):
        if path.suffix.lower() not in SUFFIXES or path.name.startswith("."):
            others += [path.name] if path.name != FILE and not path.name.startswith(".") else []
            continue
        name = first_name(path.name[: -len(path.suffix)])
        if name not in there:
            near = difflib.get_close_matches(name, there, 1)
            hint = f" Did you mean {near[0]}?" if near else ""
            found.faults.append(f"{path.name}: there is no dataset {name}.{hint}")
        elif name in found.maps:
            found.faults.append(f"{path.name}: {found.maps[name].name} is of the same dataset. Leave one.")
        else:
            found.maps[name] = path
    if others:
        found.notes.append(f"{listed(others)}: no normal map (.npy or .png), not looked at.")
    if not found.maps:
        found.faults.append("no normal map. Expected DATASET.npy (H x W x 3) or DATASET.png (16 bits, (n + 1) / 2).")


def _read_map(path: Path, mask: NDArray[np.bool_], found: Submission) -> Array:
    """Return `submitted_normals`, and append what is wrong with its numbers."""
    values: Any = read_normal_map(path, *mask.shape)
    length = np.linalg.norm(values[mask & np.isfinite(values).all(-1)].astype(np.float64), axis=-1)
    length = length[length > 0.1]
    off = np.abs(length - 1) > _LENGTH[path.suffix.lower()]
    if length.size and off.mean() > 0.001:
        found.faults.append(
            f"{path.name}: {off.mean():.1%} of the vectors are not of length 1 (median length "
            f"{np.median(length):.4g}). Divide each by its length; where there is none, write 0 0 0 or NaN."
        )
    if path.suffix.lower() == ".png" and path.read_bytes()[24] < 16:
        found.notes.append(f"{path.name}: 8 bits, expected 16: its normals are coarse by 0.2 degrees.")
    return submitted_normals(path, mask)


def _other_axes(normals: Array, layout: Layout) -> tuple[tuple[str, int], float, float] | None:
    """Return how a map must lie, in which of `AXES`, and its mean errors as given and so, degrees; None: as given."""
    assert layout.mask is not None
    reference, places = layout.normals, np.flatnonzero(layout.mask)
    if reference is None:
        reference, places = _least_squares(layout)
    places = places[some_pixels(np.isfinite(reference.reshape(-1, 3)[places, 0]))]
    expected, errors = reference.reshape(-1, 3)[places], {}
    for lies, grid in arrangements(*layout.mask.shape):
        given = normals.reshape(-1, 3)[grid.ravel()[places]]
        if np.isfinite(given[:, 0]).mean() > 0.2:
            for number, axes in enumerate(AXES):
                errors[lies, number] = float(np.nanmean(angular_error_deg(given @ axes.T, expected)))
    if ("", 0) not in errors:
        return None
    as_given, least = errors["", 0], min(errors.values())
    if least > _CLEARLY * as_given or as_given - least < _DEGREES:
        return None
    changes = {turn: (turn[0] != "", np.count_nonzero(AXES[turn[1]] != AXES[0])) for turn in errors}
    best = min((turn for turn in errors if errors[turn] < least + _ALIKE), key=changes.__getitem__)
    return best, as_given, errors[best]


def _least_squares(layout: Layout) -> tuple[Array, NDArray[np.intp]]:
    """Return normals (H, W, 3) of some pixels by least squares over their lit samples, and those pixels."""
    samples = read_samples(layout)
    if samples is None or layout.mask is None or layout.directions is None or layout.intensities is None:
        raise SceneError(told(layout.folder, layout.faults))
    gray = (samples.values / layout.intensities.astype(np.float32)).mean(-1).astype(np.float64)
    used = (gray > _LIT * gray.max(1, keepdims=True)) & (samples.values.max(-1) < CLIPPED)
    light = layout.directions * used[..., None]
    matrix = np.swapaxes(light, 1, 2) @ light + 1e-6 * np.eye(3)
    fitted = np.linalg.solve(matrix, np.swapaxes(light, 1, 2) @ gray[..., None])[..., 0]
    normals = np.full((layout.mask.size, 3), np.nan)
    normals[samples.places] = np.where((used.sum(1) >= 3)[:, None], unit(fitted), np.nan)
    return normals.reshape(*layout.mask.shape, 3), samples.places


def _tell_axes(found: Submission, turn: tuple[str, int], cases: list[tuple[str, float, float]]) -> None:
    """Append a fault where half of the maps are turned alike; else a note: a method may fail so on single datasets."""
    lies, number = turn
    wrong = [f"the map is {lies}"] if lies else []
    cure = ["Store it as the photographs lie."] if lies else []
    if number:
        wrong.append(axes_words(AXES[number]))
        cure.append(axes_cure(AXES[number], "components"))
    given, best = float(np.mean([case[1] for case in cases])), float(np.mean([case[2] for case in cases]))
    text = (
        f"{listed(case[0] for case in cases)}: {'; '.join(wrong)}; expected x right, y up, z toward the viewer (mean "
        f"error {given:.1f} degrees, put right {best:.1f}). {' '.join(cure)}"
    )
    # Convex for concave is what a method without known lights may well find: its error, not its axes.
    is_error = np.array_equal(AXES[number], INVERTED) and not lies
    if 2 * len(cases) >= len(found.maps) and not is_error:
        found.faults.append(f"{len(cases)} of {len(found.maps)} maps: {text}")
    else:
        found.notes.append(f"{text} Scored as given.")
