"""Learned methods that others publish, ready to run: their folders, their commands, where they leave their normals.

Each is a program in a folder of its own, with weights and a Python that its authors' page says how to get; none of it
is part of this project. What stands here is what their own readers of photographs expect, as of 2025: all of them are
universal, none asks for lights.
"""

import os
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import MASK, write_photographs
from scene.errors import SceneError
from scene.files import write_png, write_text
from scene.frames import Frames

PYTHONS = (".venv/bin/python", "venv/bin/python", "env/bin/python")
"""Where, in a program's folder, its own Python is looked for."""
LARGE_PX = 1024
"""Side of a picture from which SDM-UniPS is told to work in tiles, as its authors advise."""
LINO_RUN = '''\
"""Run LINO-UniPS on a folder: what its torch.hub entry LINO expects, and its normals as they are."""

import sys
from pathlib import Path

import cv2
import numpy as np
import torch

program, data, out = map(Path, sys.argv[1:])
weights = next(iter(sorted(program.rglob("lino.pth"))), None)
photographs = sorted(data.glob("L*.png"))
pixels = [(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1].copy(), None) for path in photographs]
mask = cv2.imread(str(data / "mask.png"))
model = torch.hub.load(str(program), "LINO", source="local", local_file_path=None if weights is None else str(weights))
np.save(out / "normals.npy", np.asarray(model.predict(pixels, mask), np.float32))
'''


@dataclass(frozen=True)
class Preset:
    """A published program.

    Parameters
    ----------
    source : str
        Where its authors publish it.
    entry : str
        A file in its folder by which it is known.
    weights : str
        Pattern of its weights' files there; empty: it fetches them itself at its first run.
    folder : str
        The object's folder below {data}.
    picture : str
        A photograph's name there, by its number from 1.
    most : int
        Photographs that it is given at most, evenly spread: its memory grows with them.
    result : str
        Where it leaves its normals, below {out}.
    words : tuple of str
        Its command; {python}, {program}: its Python and folder.
    script : str
        A program of ours that starts it, written to {data}/run.py; empty: none.
    """

    source: str
    entry: str
    weights: str
    folder: str
    picture: str
    most: int
    result: str
    words: tuple[str, ...]
    script: str = ""

    def write(self, data: Path, frames: Frames, mask: NDArray[np.bool_], box: tuple[slice, slice]) -> None:
        """Write the photographs, 16-bit linear RGB, and the mask as the program expects them."""
        chosen = np.unique(np.linspace(0, len(frames) - 1, min(self.most, len(frames))).round().astype(int))
        files = {self.picture.format(number): int(index) for number, index in enumerate(chosen, 1)}
        write_photographs(data / self.folder, frames, files, box)
        write_png(data / self.folder / MASK, mask[box])
        if self.script:
            write_text(data / "run.py", self.script)


PRESETS = {
    "lino-unips": Preset(
        "https://github.com/houyuanchen111/LINO_UniPS",
        "hubconf.py",
        "",
        "object",
        "L{:04d}.png",
        16,
        "normals.npy",
        ("{python}", "{data}/run.py", "{program}", "{data}/object", "{out}"),
        LINO_RUN,
    ),
    "sdm-unips": Preset(
        "https://github.com/satoshi-ikehata/SDM-UniPS-CVPR2023",
        "sdm_unips/main.py",
        "checkpoint/normal/*.pytmodel",
        "object.data",
        "L{:04d}.png",
        16,
        "results/object.data/normal.png",
        (
            "{python}", "{program}/sdm_unips/main.py", "--session_name", "{out}", "--test_dir", "{data}",
            "--test_ext", ".data", "--test_prefix", "L*", "--checkpoint", "{program}/checkpoint", "--target", "normal",
            "--max_image_num", "16",
        ),
    ),
    "uni-ms-ps": Preset(
        "https://github.com/Clement-Hardy/Uni-MS-PS",
        "inference_file.py",
        "weights/model_uncalibrated.pth",
        "object",
        "{:03d}.png",
        32,
        "object.mat",
        ("{python}", "{program}/inference_file.py", "--path_obj", "{data}/object", "--folder_save", "{out}"),
    ),
}  # fmt: skip
"""By the word that stands before the program's folder on the command line, as in lino-unips:FOLDER."""


@dataclass(frozen=True)
class Installed:
    """A preset's program where the user has put it.

    Parameters
    ----------
    name : str
        A key of `PRESETS`.
    program, python : Path
        Its folder, and the Python that runs it; absolute.
    """

    name: str
    program: Path
    python: Path

    @classmethod
    def parse(cls, words: list[str], where: str) -> "Installed":
        """Return what PRESET:FOLDER and, as a second word, a Python say.

        Raises
        ------
        SceneError
            No such preset, or program, weights or Python are not there; `where` begins the message.
        """
        name, _, folder = words[0].partition(":")
        name = name.casefold()
        if name not in PRESETS or len(words) > 2:
            raise SceneError(
                f"{where}: found {' '.join(words)!r}; expected PRESET:FOLDER, then, where it is not in the folder, the "
                f"Python that runs it. Presets are {', '.join(PRESETS)}."
            )
        preset, program = PRESETS[name], Path(folder).expanduser().absolute()
        if not (program / preset.entry).is_file():
            raise SceneError(f"{where}: {program} has no {preset.entry}. Download the program there: {preset.source}.")
        if preset.weights and not any(program.glob(preset.weights)):
            raise SceneError(
                f"{where}: {program} has no weights ({preset.weights}). Its page says where they are: {preset.source}."
            )
        given = Path(words[1]).expanduser() if len(words) == 2 else None
        usual = (program / python for python in PYTHONS)
        python = given or next((path for path in usual if path.is_file()), None)
        if python is None or not os.access(python, os.X_OK):
            found = f"{python} is no program" if python else f"found none of {', '.join(PYTHONS)} in {program}"
            raise SceneError(
                f"{where}: {found}. Name the Python that has its libraries as a second word: "
                f"'{name}:{folder} envs/name/bin/python'."
            )
        # Not resolved: a virtual environment's python is a link, and knows itself by where it lies.
        return cls(name, program, python.absolute())

    def __str__(self) -> str:
        return shlex.join([f"{self.name}:{self.program}", str(self.python)])

    @property
    def preset(self) -> Preset:
        """What is run."""
        return PRESETS[self.name]

    @property
    def files(self) -> tuple[Path, ...]:
        """The program's file and its weights: what it is run again for when it changes."""
        weights = sorted(self.program.glob(self.preset.weights)) if self.preset.weights else []
        return self.program / self.preset.entry, *weights

    def words(self, data: Path, out: Path, side_px: int) -> list[str]:
        """Return the command; `side_px`: the longer side of the pictures."""
        places = {"python": self.python, "program": self.program, "data": data, "out": out}
        words = [word.format(**places) for word in self.preset.words]
        if self.name == "sdm-unips" and side_px > LARGE_PX:
            words.append("--scalable")
        if self.name == "uni-ms-ps" and shutil.which("nvidia-smi"):
            words.append("--cuda")
        return words
