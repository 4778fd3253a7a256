"""The photographs of a shoot: each file that is whole decoded once and counted once, and what it is by its light."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts, facts_of
from capture.camera.exif import Exif, read_exif
from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.kept import Kept
from capture.session.globs import natural_key
from capture.survey.folder_files import sorted_files
from capture.survey.hot_folder import WholeFile
from capture.survey.small_pictures import Small, by_light, of_one_size, small_of
from scene.current import file_digest, look_of
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

    Raises CaptureError: the file cannot be read: it is not whole yet, or no photograph.
    """
    if (photograph := kept.load(digest)) is None:
        kept.keep(digest, read_photograph(path, DevelopRecipe(kept.encoding, kept.half, path)))
        photograph = kept.load(digest)
        assert photograph is not None
    facts = facts_of(photograph.codes, white=photograph.white, is_mosaic=photograph.is_mosaic)
    return Shot(digest, path, photograph.codes, facts, small_of(path, photograph), read_exif(path))


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
    named = sorted_files(by_path, folder).by_role
    roles = {role: [by_path[path] for path in paths] for role, paths in named.items()}
    told = {shot.digest: "no RAW file, as the others are; it is left out. Set the camera to RAW." for shot in shots}
    for shot in (shot for some in roles.values() for shot in some):
        told.pop(shot.digest, None)
    flash, odd = [shot.small for shot in roles.get("flash", [])], []
    if flash:
        flash, odd = of_one_size(flash)
    for one in odd:
        told[by_path[one.path].digest] = (
            f"is {one.width} x {one.height} px, the others {flash[0].width} x {flash[0].height}; it is left out. "
            "One session has one size."
        )
    lit = by_light(flash).get("flash", []) if len(flash) > 1 else flash
    unlit = [by_path[one.path] for one in sorted(flash, key=lambda one: natural_key(one.path)) if one not in lit]
    for shot in unlit:
        told[shot.digest] = (
            "the flash did not fire; the frame is left out. Shoot it again."
            if roles.get("ambient")
            else "no flash is seen; it is taken for the ambient frame (flash off). If the flash was meant to fire, "
            "shoot it again."
        )
    roles["flash"] = [by_path[path] for path in sorted((one.path for one in lit), key=natural_key)]
    return roles | {"ambient": roles.get("ambient") or unlit}, told


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
        self._since: dict[WholeFile, tuple[float, str]] = {}
        """Of files that stand still and cannot be read, since when, and that on the wall."""
        self._refused: dict[WholeFile, str] = {}
        """Of these, what was said once patience was over."""
        self._known: dict[str, Shot] = {}
        self.shots: dict[str, Shot] = {}
        """By the digest of their files: those that count."""

    @property
    def unreadable(self) -> list[str]:
        """What was said of the files that are no photographs."""
        return list(self._refused.values())

    @property
    def is_waiting(self) -> bool:
        """Whether a file will be tried again."""
        return bool(self._since.keys() - self._refused.keys())

    def renew(self, files: Sequence[WholeFile], now: float) -> tuple[list[Shot], bool]:
        """Take the photographs that stand in the folder, up to `LATEST` new ones.

        Returns
        -------
        fresh : list of Shot
            Those of which nothing was said before.
        is_changed : bool
            Whether others count than before, or one is called otherwise.
        """
        fresh: list[Shot] = []
        read: list[Shot] = []
        for known in (self._read, self._since, self._refused):
            for gone in known.keys() - set(files):
                del known[gone]
        for whole in files:
            if whole in self._read or whole in self._refused or len(fresh) == LATEST:
                continue
            if shot := self._shot_of(whole, now):
                self._read[whole] = shot
                read.append(shot)
                if shot.digest not in self._known:
                    self._known[shot.digest] = shot
                    fresh.append(shot)
        before, self.shots = self.shots, self._counted(files)
        for shot in (shot for digest, shot in before.items() if digest not in self.shots):
            self._note(f"{shot.name}: is gone, or another stands in its place; it is left out")
        for shot in read:
            if shot.path != self.shots[shot.digest].path:
                self._note(f"{shot.name} is a copy of {self.shots[shot.digest].name}, and no other photograph")
        was, now_is = ({digest: shot.path for digest, shot in some.items()} for some in (before, self.shots))
        return [shot for shot in fresh if shot.digest in self.shots], was != now_is

    def _shot_of(self, whole: WholeFile, now: float) -> Shot | None:
        path = self._folder / whole.name
        try:
            digest = file_digest(path)
            # What is read while it changes is no photograph: the next look at it tells.
            if digest is None or look_of(path) != whole.look:
                return None
            if (known := self._known.get(digest)) is not None:
                return replace(known, path=path, small=replace(known.small, path=path))
            _, encoding = encoding_of(path, self._asking)
            shot = read_shot(path, digest, Kept(self._kept, encoding, half=False))
        except (OSError, CaptureError) as error:
            why = f"it cannot be read ({error.strerror})" if isinstance(error, OSError) else str(error)
            since, clock = self._since.setdefault(whole, (now, f"{datetime.now():%H:%M}"))
            if now - since >= PATIENCE_S:
                self._refused[whole] = (
                    f"{whole.name}: half written since {clock}, or damaged, and no photograph yet. Let the camera's "
                    f"program finish it, copy it again, or take it out of the folder. ({why})"
                )
                self._warn(self._refused[whole])
            return None
        self._since.pop(whole, None)
        return shot if look_of(path) == whole.look else None

    def _counted(self, files: Sequence[WholeFile]) -> dict[str, Shot]:
        """Return one photograph of each content: the one that counted before, if it is still there."""
        found: dict[str, Shot] = {}
        for shot in (self._read[whole] for whole in files if whole in self._read):
            before = self.shots.get(shot.digest)
            if shot.digest not in found or (before is not None and before.path == shot.path):
                found[shot.digest] = shot
        return found
