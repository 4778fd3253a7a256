"""Lights from a file instead of balls: which reader, checked, in the frames' order."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from formats.light_files.light_formats import read_light_file
from formats.light_files.light_names import keys_of, places
from formats.light_files.light_programs import parsed
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.lights import Lights
from scene.reading import ENCODE, listed, shortened

LARGEST = 1e9  # of any number of a light: a thousand kilometres, or a flash a billion times as bright as the others
AS_THEY_ARE = "used as they are"
NO_INTENSITIES = "has no intensities"
"""Ends the flag, after the file's name, of lights whose intensities are 1 because their file has none."""


def lacks_intensities(lights: Lights) -> bool:
    """Whether the lights' file had directions only, and nothing has given the intensities since."""
    return bool((lights.intensities == 1).all()) and any(f.endswith(NO_INTENSITIES) for fs in lights.flags for f in fs)


def without_flag(lights: Lights) -> tuple[tuple[str, ...], ...]:
    """Return the lights' flags less the one that says that their file has no intensities."""
    return tuple(tuple(flag for flag in flags if not flag.endswith(NO_INTENSITIES)) for flags in lights.flags)


def read_lights(
    path: Path, names: tuple[str, ...], *, skipped: tuple[int, ...] = (), camera: Camera | None = None
) -> Lights:
    """Read the lights of the frames `names` from a file.

    Parameters
    ----------
    path : Path
        `.lp` (RTI), DiLiGenT's light_directions.txt with light_intensities.txt and filenames.txt beside it where
        present, `.json` (this program's lights.json and rig.json, or AliceVision's), `.dome` (RelightLab), or `.mat`
        (light.mat of near_ps).
    names : tuple of F str
        The frames' names, without suffix, in order.
    skipped : tuple of int
        Places, among all that were photographed, of frames that are left out: a file without names counts them too.
    camera : Camera or None
        Places what a `.dome` holds in millimetres; see `light_programs.read_dome`.

    Returns
    -------
    Lights
        Camera frame, in the frames' order, each channel's mean intensity 1; intensities 1, and a flag, where the file
        has none.

    Raises
    ------
    CalibrationError
        The file is missing or malformed, its count is not the frames', or a frame has no light in it.

    Notes
    -----
    `light_names.places` says which names are the same. A file whose names are none of the frames' is taken in its own
    order, and each light is flagged so; it is refused where the numbers in its names tell another order.
    `light_programs` states each format's axes, origin and unit.
    """
    if not path.is_file():
        raise CalibrationError(f"{path}: no such file. Correct lights.file in session.toml.")
    return _in_order(path, _checked(path, read_light_file(path, camera)), names, skipped).normalised()


def _checked(path: Path, lights: Lights) -> Lights:
    """Return a file's lights with unit directions; intensities 1 and flagged where the file has none, coded as NaN."""
    if not len(lights):
        raise CalibrationError(f"{path}: holds no lights. Write or export the file again.")
    columns = [("direction", lights.directions), ("intensity", lights.intensities), ("position", lights.positions_mm)]
    has_intensities = not np.isnan(lights.intensities).all()
    for what, rows in columns:
        if rows is None or (what == "intensity" and not has_intensities):
            continue
        bad = np.flatnonzero(~(np.abs(rows) < LARGEST).all(axis=1))
        if len(bad):
            raise CalibrationError(
                f"{path}: light {bad[0] + 1} has the {what} {rows[bad[0]].tolist()}, not a finite number of sensible "
                "size each."
            )
    if (lights.intensities <= 0).any():
        raise CalibrationError(f"{path}: intensities must be positive, found {lights.intensities.min():g}.")
    length = np.linalg.norm(lights.directions, axis=-1, keepdims=True)
    if (length < 1e-4).any():
        raise CalibrationError(
            f"{path}: light {int(length.argmin()) + 1} has no direction (length {length.min():g}). "
            "Correct it; or take it out, and list its frame under frames.skip."
        )
    lights = replace(lights, directions=lights.directions / length)
    if has_intensities:
        return lights
    flags = tuple((*flags, f"{path.name} {NO_INTENSITIES}") for flags in lights.flags)
    return replace(lights, intensities=np.ones_like(lights.directions), flags=flags)


def _in_order(path: Path, lights: Lights, names: tuple[str, ...], skipped: tuple[int, ...]) -> Lights:
    """Return the lights in the frames' order, under the frames' names."""
    found = places(names, lights.names)
    flag: tuple[str, ...] = ()
    is_named = all(len(rows) == 1 for rows in found)
    is_rig = path.suffix.lower() == ".json" and "sessions" in parsed(path)
    if is_rig and not is_named:
        # Of lamps that stay the order is known; a few names that are the same say nothing.
        found = [[] for _ in names]
    if is_named:
        order = [rows[0] for rows in found]
    elif not any(found) and len(lights) == len(names):
        order, flag = list(range(len(names))), ("taken in the file's order: its names are not the frames'",)
    elif not any(found) and len(lights) == len(names) + len(skipped):
        order = [i for i in range(len(lights)) if i not in skipped]
        flag = ("taken in the file's order, which counts the skipped frames",)
    else:
        wrong = [(name, len(rows)) for name, rows in zip(names, found, strict=True) if len(rows) != 1 and any(found)]
        odd = [f"{count or 'no'} light{'s' * (count > 1)} for the frame {name!r}" for name, count in wrong]
        raise CalibrationError(
            f"{path}: {listed(odd)}{': ' * bool(odd)}{len(lights)} lights for {len(names)} flash frames. Each frame "
            "needs its light, in order or by name: complete the file, take lights without a frame out of it, or list "
            f"frames without a light under frames.skip.{_encode(lights)}"
        )
    as_frames = _by_number(names) if len(lights) == len(names) else list(range(len(lights)))
    if is_rig:
        flag = ()
    if flag and _by_number(lights.names) != as_frames:
        raise CalibrationError(
            f"{path}: its names ({listed(map(shortened, lights.names), 2)}) are not the frames' ({listed(names, 2)}), "
            "and by their numbers the lights stand in another order than the frames. Write the photographs' names in "
            f"the file.{_encode(lights)}"
        )
    ordered = lights.only(order)
    return replace(ordered, names=names, flags=tuple(flags + flag for flags in ordered.flags))


def _by_number(names: Sequence[str]) -> list[int]:
    """Return the order of names by the last number in each; as they stand, if not each has its own."""
    numbers = [int(digits[-1][-15:]) if (digits := re.findall(r"\d+", keys_of(name)[-1])) else 0 for name in names]
    return sorted(range(len(names)), key=numbers.__getitem__) if len({*numbers}) == len(names) else [*range(len(names))]


def _encode(lights: Lights) -> str:
    """Say that names are not UTF-8, which may be why they are not the frames'."""
    is_text = not any("\ud800" <= letter <= "\udfff" for name in lights.names for letter in name)
    return "" if is_text else f" Its names are not UTF-8. {ENCODE}"
