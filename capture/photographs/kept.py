"""Photographs decoded before their session was whole: kept beside it, so that none is decoded a second time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.photographs.photograph import Photograph
from capture.session.session_types import Encoding
from scene.current import code_fingerprint, fingerprint
from scene.files import write_json, write_npy
from scene.reading import json_of
from scene.record import PLACE


def kept_folder(out: Path) -> Path:
    """Return where the photographs of an output folder are kept until its session is decoded."""
    return out / PLACE / "decoded"


@dataclass(frozen=True)
class Kept:
    """Decoded photographs in a folder, by the content of their files.

    Parameters
    ----------
    folder : Path
    encoding, half : as of `capture.photographs.develop.DevelopRecipe`.
    """

    folder: Path
    encoding: Encoding
    half: bool

    def _place(self, digest: str | None) -> Path:
        """Return where a photograph's files are, but for their endings: elsewhere where it would be read otherwise."""
        return self.folder / fingerprint(digest, self.encoding, self.half, code=code_fingerprint("capture"))

    def keep(self, digest: str, photograph: Photograph) -> None:
        """Write a photograph, as it was read; `digest` is that of its file."""
        write_npy(self._place(digest).with_suffix(".npy"), photograph.codes)
        about = {"white": photograph.white, "sensor_range": photograph.sensor_range, "is_mosaic": photograph.is_mosaic}
        # Last: its presence says that the codes are whole.
        write_json(self._place(digest).with_suffix(".json"), about)

    def load(self, digest: str | None, *, sensor_range: float | None = None) -> Photograph | None:
        """Return a photograph, its codes memory-mapped; None where it was not kept, or not as it would be read now."""
        place = self._place(digest)
        about = json_of(place.with_suffix(".json")) if place.with_suffix(".json").is_file() else None
        if about is None or sensor_range not in (None, about["sensor_range"]):
            return None
        white = np.inf if about["white"] is None else float(about["white"])
        codes = np.load(place.with_suffix(".npy"), mmap_mode="r")
        return Photograph(codes, white, about["sensor_range"], bool(about["is_mosaic"]))


class KeptStack:
    """Pictures of one size, each an array of its own, read as the one array (F, H, W, 3) that `Frames.codes` is.

    It is never one in memory: whoever reads asks for rows and columns of some frames, and gets a copy.
    """

    ndim = 4

    def __init__(self, pictures: Sequence[NDArray]) -> None:
        self._pictures = list(pictures)
        self.dtype = self._pictures[0].dtype
        self.shape = (len(self._pictures), *self._pictures[0].shape)

    def __len__(self) -> int:
        return len(self._pictures)

    def __getitem__(self, key: Any) -> Any:
        which, *rest = key if isinstance(key, tuple) else (key,)
        if isinstance(which, int | np.integer):
            return self._pictures[which][tuple(rest)]
        chosen = self._pictures[which] if isinstance(which, slice) else [self._pictures[i] for i in which]
        return np.stack([one[tuple(rest)] for one in chosen]) if rest else KeptStack(chosen)
