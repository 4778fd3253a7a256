"""From files that are whole to photographs that were taken: each decoded once, each counted once, by its content."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from capture.photographs.kept import Kept
from capture.survey.hot_folder import STILL_S, WholeFile, look_of
from scene.current import file_digest
from scene.errors import CaptureError
from shoot.init.answers import Asking
from shoot.init.prepare import encoding_of
from shoot.watch.shots import Shot, read_shot

LATEST = 4
"""Photographs that are decoded before they are judged together, where many come at once."""
PATIENCE_S = 10.0
"""A file that cannot be read is tried again for so long, and then when it changes."""


@dataclass
class _Unread:
    """A file that stands still and cannot be read: since when, when it is tried again, and why it is none."""

    clock: str
    since: float
    again: float
    why: str = ""
    is_told: bool = False


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
        self._gone: dict[str, Shot] = {}
        self.shots: dict[str, Shot] = {}
        """By the digest of their files: those that count."""

    @property
    def unreadable(self) -> list[str]:
        """What was said of the files that are no photographs."""
        return [one.why for one in self._unread.values() if one.is_told]

    @property
    def is_waiting(self) -> bool:
        """Whether a file will be tried again."""
        return any(not one.is_told for one in self._unread.values())

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
            if whole in self._read or not self._is_due(whole, now) or len(fresh) == LATEST:
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

    def _is_due(self, whole: WholeFile, now: float) -> bool:
        one = self._unread.get(whole)
        return one is None or (not one.is_told and now >= one.again)

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
        one = self._unread.setdefault(whole, _Unread(f"{datetime.now():%H:%M}", now, now))
        one.again = now + max(STILL_S, now - one.since)
        if now - one.since >= PATIENCE_S:
            one.is_told = True
            one.why = (
                f"{whole.name}: half written since {one.clock}, or damaged, and no photograph yet. Let the camera's "
                f"program finish it, copy it again, or take it out of the folder. ({why})"
            )
            self._warn(one.why)

    def _counted(self, files: Sequence[WholeFile]) -> dict[str, Shot]:
        """Return one photograph of each content: the one that counted before, if it is still there."""
        found: dict[str, Shot] = {}
        for shot in (self._read[whole] for whole in files if whole in self._read):
            before = self.shots.get(shot.digest)
            if shot.digest not in found or (before is not None and before.path == shot.path):
                found[shot.digest] = shot
        return found

    def _tell_names(self, before: dict[str, Shot], read: Sequence[Shot]) -> None:
        for digest, shot in before.items():
            now = self.shots.get(digest)
            if now is None:
                self._gone[digest] = shot
                self._note(f"{shot.name}: is gone, or another stands in its place; it is left out")
            elif now.path != shot.path:
                self._note(f"{shot.name} is called {now.name} now")
        for digest in self._gone.keys() & self.shots.keys():
            shot, now = self._gone.pop(digest), self.shots[digest]
            again = "is there again" if now.path == shot.path else f"is called {now.name} now"
            self._note(f"{shot.name} {again}, and counts")
        for shot in read:
            if shot.path != self.shots[shot.digest].path:
                self._note(f"{shot.name} is a copy of {self.shots[shot.digest].name}, and no other photograph")
