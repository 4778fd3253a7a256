"""Lights from a file instead of balls."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import CalibrationError
from scene.lights import Lights

Array = NDArray[np.float64]
NO_INTENSITIES = "has no intensities"
"""Ends the flag, after the file's name, of lights whose intensities are 1 because their file has none."""


def lacks_intensities(lights: Lights) -> bool:
    """Whether the lights' file had directions only, and nothing has told the intensities since."""
    return bool((lights.intensities == 1).all()) and any(f.endswith(NO_INTENSITIES) for fs in lights.flags for f in fs)


def without_flag(lights: Lights) -> tuple[tuple[str, ...], ...]:
    """Return the lights' flags less the one that says that their file has no intensities."""
    return tuple(tuple(flag for flag in flags if not flag.endswith(NO_INTENSITIES)) for flags in lights.flags)


def read_lights(path: Path, names: tuple[str, ...], *, skipped: tuple[int, ...] = ()) -> Lights:
    """Read the lights of the frames `names` from a file.

    Parameters
    ----------
    path : Path
        `.lp` (RTI), `.json` (this program's lights.json), or DiLiGenT's light_directions.txt, beside which
        light_intensities.txt and filenames.txt are read where present.
    names : tuple of F str
        The frames' names, without suffix, in order.
    skipped : tuple of int
        Places, among all that were photographed, of frames that are left out: a file without names counts them too.

    Returns
    -------
    Lights
        In the frames' order, each channel's mean intensity 1; intensities 1, and a flag, where the file has none.

    Raises
    ------
    CalibrationError
        The file is missing or malformed, its count is not the frames', or a frame has no light in it.

    Notes
    -----
    All three are in the camera frame already: x right, y up, z to the viewer. A file whose names are none of
    the frames' is taken in its own order, and each light is flagged so.
    """
    if not path.is_file():
        raise CalibrationError(f"{path}: no such file. Correct lights.file in session.toml.")
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read as text ({error}).") from error
    readers = {".lp": _read_lp, ".json": _read_json, ".txt": _read_text}
    if path.suffix.lower() not in readers:
        raise CalibrationError(
            f"{path}: lights in {path.suffix or 'a file without suffix'} are not known; expected .lp, .json or .txt "
            "(DiLiGenT's light_directions.txt)."
        )
    lights = readers[path.suffix.lower()](path, text)
    return _in_order(path, lights, names, skipped).normalised()


def _read_lp(path: Path, text: str) -> Lights:
    """First line the count, then `name x y z`; the name may hold spaces."""
    lines = [line.split() for line in text.splitlines() if line.strip()]
    try:
        count = int(lines[0][0])
    except (IndexError, ValueError):
        raise CalibrationError(f"{path}: line 1 must be the number of lights, found {text[:40]!r}.") from None
    rows = lines[1:]
    if len(rows) != count:
        raise CalibrationError(f"{path}: line 1 says {count} lights, but {len(rows)} follow.")
    if any(len(row) < 4 for row in rows):
        bad = next(i for i, row in enumerate(rows) if len(row) < 4)
        raise CalibrationError(f"{path}: light {bad + 1} is {' '.join(rows[bad])!r}; expected: name x y z.")
    directions = np.array([[_number(path, word) for word in row[-3:]] for row in rows]).reshape(-1, 3)
    names = tuple(_stem(" ".join(row[:-3])) for row in rows)
    return Lights(names, _unit(path, directions), np.ones_like(directions), flags=_no_intensities(path, len(rows)))


def _read_text(path: Path, text: str) -> Lights:
    """DiLiGenT: one direction a line, with light_intensities.txt and filenames.txt beside it."""
    directions = _table(path, text)
    intensities = np.ones_like(directions)
    beside = path.with_name(path.name.replace("directions", "intensities"))
    flags = _no_intensities(path, len(directions))
    if beside != path and beside.is_file():
        flags = ()
        intensities = _table(beside, beside.read_text())
        if len(intensities) != len(directions):
            raise CalibrationError(
                f"{beside}: {len(intensities)} intensities, but {path.name} has {len(directions)} lights."
            )
        if (intensities <= 0).any():
            raise CalibrationError(f"{beside}: intensities must be positive, found {intensities.min():g}.")
    listed = path.with_name("filenames.txt")
    names = tuple(_stem(line) for line in listed.read_text().splitlines() if line.strip()) if listed.is_file() else ()
    if len(names) != len(directions):
        # Never a frame's name: frames are often named by number, and row 1 need not be frame "1".
        names = tuple(f"(row {i + 1})" for i in range(len(directions)))
    return Lights(names, _unit(path, directions), intensities, flags=flags)


def _no_intensities(path: Path, count: int) -> tuple[tuple[str, ...], ...]:
    return ((f"{path.name} {NO_INTENSITIES}",),) * count


def _read_json(path: Path, text: str) -> Lights:
    """This program's own lights.json; see docs/conventions.md."""
    try:
        data: Any = json.loads(text)
        rows = data["frames"]
        near = data.get("model") == "near"
        white, ambient = data.get("white_value"), data.get("ambient")

        def column(name: str, missing: float = np.nan) -> Array:
            return np.array([missing if row.get(name) is None else row[name] for row in rows], np.float64)

        return Lights(
            tuple(str(row["name"]) for row in rows),
            _unit(path, np.array([row["direction"] for row in rows], np.float64)),
            np.array([row["intensity"] for row in rows], np.float64),
            np.array([row["position_mm"] for row in rows], np.float64) if near else None,
            np.array(data.get("reference_point_mm") or [0.0, 0.0, 0.0], np.float64),
            column("direction_sigma_deg"),
            column("intensity_sigma"),
            None if ambient is None else np.array(ambient, np.float64),
            None if white is None else np.array(white, np.float64),
            tuple(tuple(row.get("flags", ())) for row in rows),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CalibrationError(
            f"{path}: not a lights.json ({type(error).__name__}: {error}). Expected frames[] with name, direction, "
            "intensity and, for near lights, position_mm."
        ) from error


def _table(path: Path, text: str) -> Array:
    rows = [line.split() for line in text.splitlines() if line.strip()]
    bad = next((i for i, row in enumerate(rows) if len(row) != 3), None)
    if bad is not None or not rows:
        found = f"line {bad + 1} has {len(rows[bad])}" if bad is not None else "the file is empty"
        raise CalibrationError(f"{path}: expected three numbers a line, one light each; {found}.")
    return np.array([[_number(path, word) for word in row] for row in rows])


def _number(path: Path, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise CalibrationError(f"{path}: {word!r} is not a number.") from None
    if not np.isfinite(value):
        raise CalibrationError(f"{path}: {word!r} is not a finite number.")
    return value


def _unit(path: Path, directions: Array) -> Array:
    length = np.linalg.norm(directions, axis=-1, keepdims=True)
    if (length < 1e-4).any():
        raise CalibrationError(f"{path}: light {int(length.argmin()) + 1} has no direction (length {length.min():g}).")
    return directions / length


def _stem(name: str) -> str:
    """`folder/flash_000.dng` -> `flash_000`; `.lp` files are written on Windows too."""
    return Path(name.strip().replace("\\", "/")).stem


def _in_order(path: Path, lights: Lights, names: tuple[str, ...], skipped: tuple[int, ...]) -> Lights:
    """Return the lights in the frames' order, under the frames' names."""
    known = {name: i for i, name in enumerate(lights.names)}
    no_name_known = not any(name in known for name in names)
    if len(known) == len(lights) and all(name in known for name in names):
        order, flag = [known[name] for name in names], ()
    elif len(lights) == len(names) and no_name_known:
        order, flag = list(range(len(names))), ("taken in the file's order: its names are not the frames'",)
    elif len(lights) == len(names) + len(skipped) and no_name_known:
        order = [i for i in range(len(lights)) if i not in skipped]
        flag = ("taken in the file's order, which counts the skipped frames",)
    elif len(lights) != len(names):
        raise CalibrationError(
            f"{path}: {len(lights)} lights for {len(names)} flash frames. Each frame needs its light, in order or by "
            "name."
        )
    else:
        missing = [name for name in names if name not in known]
        raise CalibrationError(
            f"{path}: no light for the frame {missing[0]!r} ({len(missing)} of {len(names)} missing)."
        )
    return Lights(
        names,
        lights.directions[order],
        lights.intensities[order],
        None if lights.positions_mm is None else lights.positions_mm[order],
        lights.reference_point_mm,
        lights.direction_sigma_deg[order],
        lights.intensity_sigma[order],
        lights.ambient,
        lights.white_value,
        tuple(lights.flags[i] + flag for i in order),
    )
