"""The photographs of a shoot: each file that is whole decoded once and counted once, and what it is by its light."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
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
from capture.survey.hot_folder import WholeFile, look_of
from capture.survey.small_pictures import Small, by_light, of_one_size, small_of
from scene.current import file_digest
from scene.errors import CaptureError
from shoot.init.answers import Asking
from shoot.init.prepare import encoding_of

LATEST = 4
"""Photographs that are decoded before they are judged together, where many come at once."""
PATIENCE_S = 10.0
"""A file that cannot be read is tried again for so long, and then when it changes."""


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


@dataclass
class _Unread:
    """A file that stands still and cannot be read: since when, and what was told of it once patience was over."""

    clock: str
    since: float
    told: str = ""


class Taken:
    """The photographs of a folder, as they stand there now.

    Parameters
    ----------
    folder, kept : Path
        Where the photographs are written, and where decoded ones are kept.
    asking : Asking
        Silent: whether 8-bit values are proportional to light.
    note, warn : callable
        Are told what happened to names, and which files are no photographs.
    """

    def __init__(
        self, folder: Path, kept: Path, asking: Asking, note: Callable[[str], None], warn: Callable[[str], None]
    ) -> None:
        self._folder, self._kept, self._asking, self._note, self._warn = folder, kept, asking, note, warn
        self._read: dict[WholeFile, Shot] = {}
        self._unread: dict[WholeFile, _Unread] = {}
        self._known: dict[str, Shot] = {}
        self.shots: dict[str, Shot] = {}
        """By the digest of their files: those that count."""

    @property
    def unreadable(self) -> list[str]:
        """What was said of the files that are no photographs."""
        return [one.told for one in self._unread.values() if one.told]

    @property
    def is_waiting(self) -> bool:
        """Whether a file will be tried again."""
        return any(not one.told for one in self._unread.values())

    def renew(self, files: Sequence[WholeFile], now: float) -> tuple[list[Shot], bool]:
        """Take the photographs that stand in the folder, up to `LATEST` new ones.

        Returns
        -------
        fresh : list of Shot
            Those of which nothing was said before.
        is_changed : bool
            Whether one that counted before is gone, or called otherwise.
        """
        fresh: list[Shot] = []
        read: list[Shot] = []
        self._read = {whole: shot for whole, shot in self._read.items() if whole in files}
        self._unread = {whole: one for whole, one in self._unread.items() if whole in files}
        for whole in files:
            is_hopeless = whole in self._unread and bool(self._unread[whole].told)
            if whole in self._read or is_hopeless or len(fresh) == LATEST:
                continue
            shot = self._shot_of(whole, now)
            if shot is not None:
                self._read[whole] = shot
                read.append(shot)
                if shot.digest not in self._known:
                    self._known[shot.digest] = shot
                    fresh.append(shot)
        before, self.shots = self.shots, self._counted(files)
        self._tell_names(before, read)
        paths = {digest: shot.path for digest, shot in self.shots.items()}
        is_changed = any(paths.get(digest) != shot.path for digest, shot in before.items())
        return [shot for shot in fresh if shot.digest in self.shots], is_changed

    def _shot_of(self, whole: WholeFile, now: float) -> Shot | None:
        path = self._folder / whole.name
        try:
            digest = file_digest(path)
            # What is read while it changes is no photograph: the next look at it tells.
            if digest is None or look_of(path) != whole.look:
                return None
            known = self._known.get(digest)
            if known is not None:
                return replace(known, path=path, small=replace(known.small, path=path))
            _, encoding = encoding_of(path, self._asking)
            shot = read_shot(path, digest, Kept(self._kept, encoding, half=False))
        except OSError as error:
            self._refuse(whole, f"it cannot be read ({error.strerror})", now)
            return None
        except CaptureError as error:
            self._refuse(whole, str(error), now)
            return None
        self._unread.pop(whole, None)
        return shot if look_of(path) == whole.look else None

    def _refuse(self, whole: WholeFile, why: str, now: float) -> None:
        one = self._unread.setdefault(whole, _Unread(f"{datetime.now():%H:%M}", now))
        if now - one.since >= PATIENCE_S:
            one.told = (
                f"{whole.name}: half written since {one.clock}, or damaged, and no photograph yet. Let the camera's "
                f"program finish it, copy it again, or take it out of the folder. ({why})"
            )
            self._warn(one.told)

    def _counted(self, files: Sequence[WholeFile]) -> dict[str, Shot]:
        """Return one photograph of each content: the one that counted before, if it is still there."""
        found: dict[str, Shot] = {}
        for shot in (self._read[whole] for whole in files if whole in self._read):
            before = self.shots.get(shot.digest)
            if shot.digest not in found or (before is not None and before.path == shot.path):
                found[shot.digest] = shot
        return found

    def _tell_names(self, before: dict[str, Shot], read: Sequence[Shot]) -> None:
        for shot in (shot for digest, shot in before.items() if digest not in self.shots):
            self._note(f"{shot.name}: is gone, or another stands in its place; it is left out")
        for shot in read:
            if shot.path != self.shots[shot.digest].path:
                self._note(f"{shot.name} is a copy of {self.shots[shot.digest].name}, and no other photograph")
