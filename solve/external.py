"""Methods that are other programs: given the photographs in the DiLiGenT layout, they write a normal map.

Learned methods above all: neither their weights nor their libraries are part of this project
(docs/guide/learned-methods.md).
"""

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import write_diligent
from formats.normal_maps import read_normal_map
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from solve.presets import PRESETS, Preset, find_program

RESULTS = (".npy", ".mat", ".png")
_MARGIN = 0.05
"""Of the object's picture, around it: such programs cut out a square, and shrink the whole frame where they cannot."""
_MARGIN_PX = 10
"""At least: the object's own margin of 8 pixels in such programs."""
_LAST_LINES = 6


@dataclass(frozen=True)
class External:
    """A program that finds normals.

    Parameters
    ----------
    name : str
        Begins with a capital, as their names do: ours are in small letters.
    command : str
        As in a shell, but without one; {data} becomes the folder to read, {out} the folder to write to. Of a preset
        PRESET:FOLDER PYTHON.
    timeout_s : float
    preset : Preset or None
        How a published program wants its photographs, and what its command is.
    """

    name: str
    command: str
    timeout_s: float = 3600.0
    preset: Preset | None = None

    @classmethod
    def parse(cls, text: str, timeout_s: float) -> "External":
        """Return what NAME=COMMAND or NAME=PRESET:FOLDER [PYTHON] says.

        Raises
        ------
        SceneError
            No name, no place to read from or write to, or a preset's program is not there.
        """
        name, _, command = (part.strip() for part in text.partition("="))
        where = f"--external {text}"
        if not re.fullmatch(r"[A-Z][A-Za-z0-9_-]*", name):
            raise SceneError(
                f"{where}: found the name {name!r}, expected NAME=COMMAND with a name that begins with a capital and "
                "goes on with letters, digits, - and _."
            )
        if not 0 < timeout_s < np.inf:
            raise SceneError(f"--external-timeout-s {timeout_s:g}: expected seconds above 0, as in 3600.")
        if re.match(r"['\"]?[A-Za-z-]+:", command) and "{data}" not in command:
            words = _split(command, name)
            preset = find_program(words, where)
            words = [f"{words[0].partition(':')[0]}:{preset.program}", str(preset.python)]
            return cls(name, shlex.join(words), timeout_s, preset)
        missing = [place for place in ("{data}", "{out}") if place not in command]
        if missing:
            raise SceneError(
                f"{where}: {' and '.join(missing)} missing. The command is told with {{data}} the folder to read, with "
                "{out} the folder to write normals to. Without a command of your own: PRESET:FOLDER, the presets are "
                f"{', '.join(PRESETS)}."
            )
        return cls(name, command, timeout_s)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the command names: the program itself, its weights."""
        if self.preset:
            return self.preset.files
        return tuple(path for path in map(Path, self.words(Path("{data}"), Path("{out}"))) if path.is_file())

    def words(self, data: Path, out: Path, side_px: int = 0) -> list[str]:
        """Return the command's words, the folders in their places; `side_px`: the pictures' longer side."""
        if self.preset:
            return self.preset.words(data, out, side_px)
        words = _split(self.command, self.name)
        return [word.replace("{data}", str(data)).replace("{out}", str(out)) for word in words]


def _split(command: str, name: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise SceneError(f"--external {name}: {command!r} cannot be read as a command ({error}).") from None


def normals_by(external: External, frames: Frames, lights: Lights, mask: NDArray[np.bool_], folder: Path) -> NDArray:
    """Run the program and read what it wrote.

    `folder` gets data/ and out/, and stdout.txt and stderr.txt; data/ is removed when all went well. Near lights are
    written as seen from the reference point.

    Returns
    -------
    normals : (H, W, 3) float64
        Unit, in the program's axes; NaN where it gave none, and outside the mask.

    Raises
    ------
    SceneError
        The program is not there, fails, takes too long, or writes no normals of the object's size.
    """
    shutil.rmtree(folder, ignore_errors=True)
    data, out = folder.resolve() / "data", folder.resolve() / "out"
    box = _square(mask)
    inside = mask[box]
    if external.preset:
        external.preset.write(data, frames, mask, box)
    else:
        write_diligent(data, frames, lights, mask, box)
    out.mkdir(parents=True)
    _run(external, external.words(data, out, max(inside.shape)), folder)
    path = _result(external, out)
    found = read_normal_map(path, *inside.shape).astype(np.float64)
    length = np.linalg.norm(found, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.where(inside[..., None] & np.isfinite(length) & (length > 0.1), found / length, np.nan)
    if not np.isfinite(found[..., 0]).any():
        raise SceneError(
            f"{path}: no pixel of the object has a normal (all are zero or no numbers). Run the command by hand: "
            f"{data} is kept."
        )
    normals = np.full((*mask.shape, 3), np.nan)
    normals[box] = found
    shutil.rmtree(data)
    return normals


def _square(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the square about the object, with a margin, as far as the frame has room."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    tall, wide = rows[-1] + 1 - rows[0], columns[-1] + 1 - columns[0]
    side = int(max(tall, wide) + 2 * max(np.ceil(_MARGIN * max(tall, wide)) + 1, _MARGIN_PX))

    def centred(first: int, extent: int, room: int) -> slice:
        start = min(max(first - (side - extent) // 2, 0), max(room - side, 0))
        return slice(start, min(start + side, room))

    return centred(int(rows[0]), int(tall), mask.shape[0]), centred(int(columns[0]), int(wide), mask.shape[1])


def _run(external: External, words: list[str], folder: Path) -> None:
    """Run the command to its end, and whatever it started; its words are kept in files, which never fill a pipe."""
    data, where = folder.resolve() / "data", external.preset.program if external.preset else None
    with open(folder / "stdout.txt", "wb") as said, open(folder / "stderr.txt", "wb") as complained:
        try:
            process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=said, stderr=complained, start_new_session=True, cwd=where
            )
        except OSError as error:
            raise SceneError(
                f"--external {external.name}: {words[0]} cannot be started ({error.strerror}). Give the program's "
                "path; for pipes and variables use bash -c '...'."
            ) from error
        try:
            code = process.wait(external.timeout_s)
        except BaseException as error:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            if isinstance(error, subprocess.TimeoutExpired):
                raise SceneError(
                    f"--external {external.name}: stopped after {external.timeout_s:g} s without an end. Give it more "
                    f"with --external-timeout-s.{_last_words(folder)}"
                ) from None
            raise
    if code:
        what = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        raise SceneError(
            f"--external {external.name}: the command {what}. Run it by hand{f' in {where}' if where else ''}, {data} "
            f"is kept: {shlex.join(words)}{_last_words(folder)}"
        )


def _last_words(folder: Path) -> str:
    """Return the last lines of what the program wrote to stderr, or else to stdout."""
    for name in ("stderr.txt", "stdout.txt"):
        lines = (folder / name).read_text(errors="replace").strip().splitlines()
        if lines:
            return f" Its last words ({folder / name}):\n" + "\n".join(f"  {line}" for line in lines[-_LAST_LINES:])
    return " It said nothing."


def _result(external: External, out: Path) -> Path:
    """Return the one normal map in a folder, or that of a preset."""
    if external.preset:
        path = out / external.preset.result
        if path.is_file():
            return path
    found = sorted(path for path in out.rglob("*") if path.suffix.lower() in RESULTS and path.is_file())
    named = [path for path in found if path.stem.lower() in ("normal", "normals", "normal_est")]
    found = named if len(named) == 1 else found
    if len(found) != 1:
        there = ", ".join(str(path.relative_to(out)) for path in found[:5]) or "nothing"
        raise SceneError(
            f"--external {external.name}: the command left {there} in {out}; expected one normal map, normals.npy, "
            f".mat (Normal_est) or .png (16 bits)."
        )
    return found[0]
