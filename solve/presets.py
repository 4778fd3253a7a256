"""Learned methods that others publish, ready to run: where each reads its photographs and leaves its normals.

The programs, their weights and their Python are no part of this project. What stands here is what their own readers
expect, as of 2025: all of them are universal, none asks for lights.
"""

import shutil
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
LINO_RUN = """import sys, cv2, numpy as np, torch; from pathlib import Path
program, data, out = map(Path, sys.argv[1:])
pictures = [(cv2.imread(str(path), -1)[..., ::-1].copy(), None) for path in sorted(data.glob("L*.png"))]
weights = next(map(str, program.rglob("lino.pth")), None)
model = torch.hub.load(str(program), "LINO", source="local", local_file_path=weights)
np.save(out / "normals.npy", np.asarray(model.predict(pictures, cv2.imread(str(data / "mask.png"))), np.float32))"""
"""LINO-UniPS has no command of its own: what its torch.hub entry LINO wants, and its normals as they are."""


@dataclass(frozen=True)
class Preset:
    """A published program.

    Parameters
    ----------
    source : str
        Where its authors publish it.
    entry : str
        A file in its folder by which it is known.
    command : tuple of str
        Its Python's words; {program}: its folder.
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
        places = {"program": self.program, "data": data / self.folder, "out": out}
        words = [str(self.python), *(word.format(**places) for word in self.command)]
        if "--test_dir" in words and side_px > LARGE_PX:
            words.append("--scalable")
        if "--path_obj" in words and shutil.which("nvidia-smi"):
            words.append("--cuda")
        return words


PRESETS = {
    "lino-unips": Preset(
        "https://github.com/houyuanchen111/LINO_UniPS", "hubconf.py", ("-c", LINO_RUN, "{program}", "{data}", "{out}"),
        "object", "L{:04d}.png", "normals.npy",
    ),
    "sdm-unips": Preset(
        "https://github.com/satoshi-ikehata/SDM-UniPS-CVPR2023", "sdm_unips/main.py",
        (
            "{program}/sdm_unips/main.py", "--session_name", "{out}", "--test_dir", "{data}/..", "--test_ext", ".data",
            "--test_prefix", "L*", "--checkpoint", "{program}/checkpoint", "--target", "normal",
            "--max_image_num", "16",
        ),
        "object.data", "L{:04d}.png", "results/object.data/normal.png", weights="checkpoint/normal/*.pytmodel",
    ),
    "uni-ms-ps": Preset(
        "https://github.com/Clement-Hardy/Uni-MS-PS", "inference_file.py",
        ("{program}/inference_file.py", "--path_obj", "{data}", "--folder_save", "{out}"),
        "object", "{:03d}.png", "object.mat", most=32, weights="weights/model_uncalibrated.pth",
    ),
}  # fmt: skip
"""By the word that stands before the program's folder on the command line, as in lino-unips:FOLDER."""


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
