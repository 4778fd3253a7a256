"""Methods that are other programs: given the photographs as they read them, they write a normal map.

Learned methods above all: neither they, nor their weights and libraries, are part of this project
(docs/guide/methods.md).
"""

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import write_diligent
from formats.normal_maps import read_normal_map
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights

DATA = "object.data"
"""The folder to read: SDM-UniPS knows an object by this ending."""
RESULTS = (".npy", ".mat", ".png")
"""From the most digits to the fewest."""
PYTHONS = (".venv/bin/python", "venv/bin/python", "env/bin/python")
"""Where, in a published program's folder, its own Python is looked for."""
LARGE_PX = 1024
"""Side of a picture from which SDM-UniPS is told to work in tiles, as its authors advise."""
_MARGIN = 0.05
"""Of the object's picture, around it: such programs cut out a square, and shrink the whole frame where they cannot."""
_MARGIN_PX = 10
"""At least: the object's own margin of 8 pixels in such programs."""
_LAST_LINES = 6


@dataclass(frozen=True)
class Preset:
    """A published program, as `presets.toml` lists it.

    Parameters
    ----------
    source : str
        Where its authors publish it.
    entry : str
        A file in its folder by which it is known.
    command, large, gpu : tuple of str
        Its Python's words, {program}: its folder; with large pictures; where there is a GPU.
    most : int
        Photographs that it is given at most, evenly spread: its memory grows with them.
    weights : str
        Pattern of its weights' files in its folder; empty: it fetches them itself at its first run.
    """

    source: str
    entry: str
    command: tuple[str, ...]
    most: int = 16
    weights: str = ""
    large: tuple[str, ...] = ()
    gpu: tuple[str, ...] = ()


PRESETS = {
    name: Preset(**table)
    for name, table in tomllib.loads(Path(__file__).with_name("presets.toml").read_text("utf-8")).items()
}


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
    words : tuple of str
        What is started, {data} and {out} among them.
    files : tuple of Path
        That it is run again for when they change: those that the command names; of a preset its program and weights.
    preset : Preset or None
        How a published program wants its photographs.
    program : Path or None
        The folder of a preset's program.
    """

    name: str
    command: str
    timeout_s: float
    words: tuple[str, ...]
    files: tuple[Path, ...]
    preset: Preset | None = None
    program: Path | None = None

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
        is_preset = re.match(r"['\"]?[A-Za-z-]+:", command) and "{data}" not in command
        missing = [place for place in ("{data}", "{out}") if place not in command]
        if missing and not is_preset:
            raise SceneError(
                f"{where}: {' and '.join(missing)} missing. The command is told with {{data}} the folder to read, with "
                "{out} the folder to write normals to. Without a command of your own: PRESET:FOLDER, the presets are "
                f"{', '.join(PRESETS)}."
            )
        try:
            words = shlex.split(command)
        except ValueError as error:
            raise SceneError(f"--external {name}: {command!r} cannot be read as a command ({error}).") from None
        if is_preset:
            return cls._of_preset(name, words, timeout_s, where)
        return cls(name, command, timeout_s, tuple(words), tuple(map(Path, filter(os.path.isfile, words))))

    @classmethod
    def _of_preset(cls, name: str, words: list[str], timeout_s: float, where: str) -> "External":
        """Return the program that PRESET:FOLDER and, as a second word, a Python name; `where` begins a message."""
        called, _, folder = words[0].partition(":")
        if called.casefold() not in PRESETS or len(words) > 2:
            raise SceneError(
                f"{where}: found {' '.join(words)!r}; expected PRESET:FOLDER, then, where it is not in the folder, the "
                f"Python that runs it. Presets are {', '.join(PRESETS)}."
            )
        preset, program, files = PRESETS[called.casefold()], Path(os.path.expanduser(folder)).absolute(), []
        for what, pattern in (("", preset.entry), ("weights ", preset.weights)):
            found = sorted(program.glob(pattern)) if pattern and os.path.isdir(program) else []
            if pattern and not found:
                raise SceneError(
                    f"{where}: {program} has no {what}{pattern}. Its page says where it is: {preset.source}."
                )
            files += found
        tried = [Path(os.path.expanduser(words[1]))] if len(words) == 2 else [program / python for python in PYTHONS]
        # By os.path: a name may be too long. Not resolved: a virtual environment's python knows itself by its place.
        python = next((path.absolute() for path in tried if os.path.isfile(path)), None)
        if python is None:
            raise SceneError(
                f"{where}: found no {', '.join(map(str, tried))}. Name the Python that has its libraries as a second "
                f"word: '{words[0]} envs/name/bin/python'."
            )
        started = (str(python), *(word.replace("{program}", str(program)) for word in preset.command))
        command = shlex.join([f"{called}:{program}", str(python)])
        return cls(name, command, timeout_s, started, tuple(files), preset, program)

    def started(self, data: Path, out: Path, side_px: int) -> list[str]:
        """Return the command's words, the folders in their places; `side_px`: the pictures' longer side."""
        words = [*self.words]
        if self.preset:
            words += self.preset.large if side_px > LARGE_PX else ()
            words += self.preset.gpu if shutil.which("nvidia-smi") else ()
        return [word.replace("{data}", str(data)).replace("{out}", str(out)) for word in words]


def normals_by(external: External, frames: Frames, lights: Lights, mask: NDArray[np.bool_], folder: Path) -> NDArray:
    """Run the program and read what it wrote.

    `folder` gets object.data/ and out/, and stdout.txt and stderr.txt; the first is removed when all went well. Near
    lights are written as seen from the reference point.

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
    data, out = folder.resolve() / DATA, folder.resolve() / "out"
    box = _square(mask)
    inside = mask[box]
    write_diligent(data, frames, lights, mask, box, external.preset and external.preset.most)
    out.mkdir(parents=True)
    _run(external, external.started(data, out, max(inside.shape)), folder)
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
    data, where = folder.resolve() / DATA, external.program
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
    """Return the one normal map in a folder; of several files of one name that with the most digits."""
    found = sorted(path for path in out.rglob("*") if path.suffix.lower() in RESULTS and path.is_file())
    found = [path for path in found if path.stem.lower() in ("normal", "normals", "normal_est")] or found
    if len({path.with_suffix("") for path in found}) != 1:
        there = ", ".join(str(path.relative_to(out)) for path in found[:5]) or "nothing"
        raise SceneError(
            f"--external {external.name}: the command left {there} in {out}; expected one normal map, normals.npy, "
            f".mat (Normal_est) or .png (16 bits)."
        )
    return min(found, key=lambda path: RESULTS.index(path.suffix.lower()))
