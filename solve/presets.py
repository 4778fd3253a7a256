"""Learned methods that others publish, ready to run: where each reads its photographs and leaves its normals.

The programs, their weights and their Python are no part of this project.
"""

import shutil
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import MASK, write_photographs
from scene.errors import SceneError
from scene.files import write_png
from scene.frames import Frames

PYTHONS = (".venv/bin/python", "venv/bin/python", "env/bin/python")
"""Where, in a program's folder, its own Python is looked for."""
LARGE_PX = 1024
"""Side of a picture from which SDM-UniPS is told to work in tiles, as its authors advise."""


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
    folder, picture, result : str
        The object's folder below {data}, a photograph's name there by its number from 1, its normals below {out}.
    most : int
        Photographs that it is given at most, evenly spread: its memory grows with them.
    weights : str
        Pattern of its weights' files in its folder; empty: it fetches them itself at its first run.
    program, python : Path
        Its folder, and the Python that runs it, where the user has put them; absolute.
    """

    source: str
    entry: str
    command: tuple[str, ...]
    folder: str
    picture: str
    result: str
    most: int = 16
    weights: str = ""
    large: tuple[str, ...] = ()
    gpu: tuple[str, ...] = ()
    program: Path = Path()
    python: Path = Path()

    @property
    def files(self) -> tuple[Path, ...]:
        """The program's file and its weights: what it is run again for when it changes."""
        return self.program / self.entry, *(sorted(self.program.glob(self.weights)) if self.weights else ())

    def write(self, data: Path, frames: Frames, mask: NDArray[np.bool_], box: tuple[slice, slice]) -> None:
        """Write the photographs, 16-bit linear RGB, and the mask as the program expects them."""
        chosen = np.unique(np.linspace(0, len(frames) - 1, min(self.most, len(frames))).round().astype(int))
        files = {self.picture.format(number): int(index) for number, index in enumerate(chosen, 1)}
        write_photographs(data / self.folder, frames, files, box)
        write_png(data / self.folder / MASK, mask[box])

    def words(self, data: Path, out: Path, side_px: int) -> list[str]:
        """Return the command; `side_px`: the longer side of the pictures."""
        places = {"{program}": self.program, "{data}": data / self.folder, "{out}": out}
        words = [str(self.python), *self.command, *(self.large if side_px > LARGE_PX else ())]
        for name, place in places.items():
            words = [word.replace(name, str(place)) for word in words]
        return words + [*(self.gpu if shutil.which("nvidia-smi") else ())]


PRESETS = {name: Preset(**table) for name, table in tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text()
).items()}  # fmt: skip


def find_program(words: list[str], where: str) -> Preset:
    """Return the program that PRESET:FOLDER and, as a second word, a Python name.

    Raises
    ------
    SceneError
        No such preset, or program, weights or Python are not there; `where` begins the message.
    """
    name, _, folder = words[0].partition(":")
    if name.casefold() not in PRESETS or len(words) > 2:
        raise SceneError(
            f"{where}: found {' '.join(words)!r}; expected PRESET:FOLDER, then, where it is not in the folder, the "
            f"Python that runs it. Presets are {', '.join(PRESETS)}."
        )
    preset, program = PRESETS[name.casefold()], Path(folder).expanduser().absolute()
    for what, pattern in (("", preset.entry), ("weights ", preset.weights)):
        if pattern and not any(program.glob(pattern)):
            raise SceneError(f"{where}: {program} has no {what}{pattern}. Its page says where it is: {preset.source}.")
    tried = [Path(words[1]).expanduser()] if len(words) == 2 else [program / python for python in PYTHONS]
    # Not resolved: a virtual environment's python is a link, and knows itself by where it lies.
    python = next((path.absolute() for path in tried if path.is_file()), None)
    if python is None:
        raise SceneError(
            f"{where}: found no {', '.join(map(str, tried))}. Name the Python that has its libraries as a second word: "
            f"'{words[0]} envs/name/bin/python'."
        )
    return replace(preset, program=program, python=python)
