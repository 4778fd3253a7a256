"""The photographs of a shoot under way: each decoded once, and what it is by its name, its size and its light."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts, facts_of
from capture.camera.exif import Exif, read_exif
from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.kept import Kept
from capture.photographs.photograph import Photograph
from capture.session.globs import natural_key
from capture.survey.folder_files import sorted_files
from capture.survey.small_pictures import Small, by_light, of_one_size, small_of


@dataclass(frozen=True, eq=False)
class Shot:
    """A photograph that was taken.

    Parameters
    ----------
    digest : str
        Of its file's content.
    path : Path
        Its file, absolute.
    codes : (H, W, 3) uint16 or float16
        Memory-mapped.
    facts, small, exif : what is known of it.
    """

    digest: str
    path: Path
    codes: NDArray
    facts: FrameFacts
    small: Small
    exif: Exif

    @property
    def name(self) -> str:
        return self.path.name


def read_shot(path: Path, digest: str, kept: Kept) -> Shot:
    """Decode a photograph and keep it, unless it was kept before.

    Raises
    ------
    CaptureError
        The file cannot be read: it is not whole yet, or no photograph.
    """
    photograph = kept.load(digest)
    if photograph is None:
        photograph = read_photograph(path, DevelopRecipe(kept.encoding, kept.half, path))
        kept.keep(digest, photograph)
    codes = photograph.codes
    facts = facts_of(codes, white=photograph.white, is_mosaic=photograph.is_mosaic)
    mapped = kept.load(digest)
    small = small_of(path, Photograph(codes, is_mosaic=photograph.is_mosaic), full=2 if kept.half else 1)
    return Shot(digest, path, mapped.codes if mapped else codes, facts, small, read_exif(path))


def sort_shots(shots: Sequence[Shot], folder: Path) -> tuple[dict[str, list[Shot]], dict[str, str]]:
    """Give each photograph its role: by its name, its size, and, where the name tells nothing, by its light.

    A photograph without flash is an ambient one: nothing tells it from a flash that did not fire.

    Returns
    -------
    roles : dict of lists of Shot
        flash, one light each in the order of the session to be; ambient; dark, flat, board, chrome, white.
    told : dict of str to str
        By digest, what is to be said of a photograph that is no flash frame.
    """
    by_path = {shot.path: shot for shot in shots}
    named = sorted_files(by_path, folder).photographs
    roles = {role: [by_path[path] for path in paths] for role, paths in named.items()}
    listed = {shot.digest for some in roles.values() for shot in some}
    told = {
        shot.digest: "no RAW file, as the others are; it is left out. Set the camera to RAW."
        for shot in shots
        if shot.digest not in listed
    }
    by_small = {id(shot.small): shot for shot in shots}
    flash = [shot.small for shot in roles.get("flash", [])]
    if flash:
        flash, odd = of_one_size(flash)
        for one in odd:
            told[by_small[id(one)].digest] = (
                f"is {one.width} x {one.height} px, the others {flash[0].width} x {flash[0].height}; it is left out. "
                "One session has one size."
            )
    sorted_ = by_light(flash) if len(flash) > 1 else {"flash": flash}
    unlit = [by_small[id(one)] for role in ("ambient", "dark") for one in sorted_.get(role, [])]
    for shot in unlit:
        told[shot.digest] = (
            "the flash did not fire; the frame is left out. Shoot it again."
            if roles.get("ambient")
            else "no flash is seen; it is taken for the ambient frame (flash off). If the flash was meant to fire, "
            "shoot it again."
        )
    lit = [by_small[id(one)] for one in sorted_.get("flash", [])]
    roles["flash"] = sorted(lit, key=lambda shot: natural_key(shot.path))
    roles["ambient"] = roles.get("ambient") or sorted(unlit, key=lambda shot: natural_key(shot.path))
    return roles, told


def mean_codes(shots: Sequence[Shot]) -> NDArray | None:
    """Return the mean of photographs as codes (H, W, 3); None of none."""
    if len(shots) < 2:
        return shots[0].codes if shots else None
    total = np.zeros(shots[0].codes.shape, np.float32)
    for shot in shots:
        total += shot.codes
    mean = total / np.float32(len(shots))
    return np.round(mean).astype(np.uint16) if shots[0].codes.dtype == np.uint16 else mean.astype(np.float16)
