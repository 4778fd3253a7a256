"""From files that are whole to photographs that were taken: each decoded once, each noted after that."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from capture.hot_folder.hot_folder import HotFolder
from capture.hot_folder.ledger import Ledger
from capture.hot_folder.tracker import Whole
from capture.photographs.kept import Kept
from scene.current import file_digest
from scene.errors import CaptureError
from shoot.init.answers import Asking
from shoot.init.prepare import encoding_of
from shoot.watch.shoot import Shoot
from shoot.watch.shots import Shot, read_shot

LATEST = 4
"""Photographs that are decoded before they are judged together, where many come at once."""


@dataclass
class Taken:
    """What came of files.

    Parameters
    ----------
    shots : list of Shot
        New photographs.
    notes : list of str
        What happened to names.
    warnings : list of str
        Files that never became photographs.
    """

    shots: list[Shot]
    notes: list[str]
    warnings: list[str]


class Taking:
    """Takes photographs of a hot folder into a shoot.

    Parameters
    ----------
    hot : HotFolder
    ledger : Ledger
    kept : Path
        Where decoded photographs are kept.
    shoot : Shoot
    asking : Asking
        Silent: whether 8-bit values are proportional to light.
    """

    def __init__(self, hot: HotFolder, ledger: Ledger, kept: Path, shoot: Shoot, asking: Asking) -> None:
        self._hot, self._ledger, self._kept, self._shoot, self._asking = hot, ledger, kept, shoot, asking
        self.unreadable: dict[str, str] = {}
        """Files that stood still and are no photographs, with the reason."""

    def resume(self) -> Taken:
        """Return the photographs of an earlier run; one that is no longer kept is read again, if it is still there."""
        found = Taken([], [], [])
        for entry in self._ledger.entries:
            path = self._hot.folder / entry.name
            try:
                found.shots.append(self._read(path, entry.digest))
            except CaptureError:
                found.warnings.append(
                    f"{entry.name}: was taken by an earlier run, and is neither kept nor in the folder any more."
                )
        return found

    def take(self, files: Iterable[Whole]) -> Taken:
        """Take files that are whole, up to `LATEST` new photographs at a time."""
        found = Taken([], [], [])
        for whole in files:
            self._take_one(whole, found)
            if len(found.shots) == LATEST:
                break
        return found

    def _take_one(self, whole: Whole, found: Taken) -> None:
        hot, path = self._hot, self._hot.folder / whole.name
        try:
            digest = file_digest(path)
        except OSError as error:
            self._refuse(whole, f"{path}: cannot be read ({error.strerror}).", found)
            return
        # What is read while it changes is no photograph: the next look at it tells.
        if digest is None or hot.look_of(whole.name) != whole.look:
            return
        event = self._ledger.event(digest, whole, hot.look_of)
        known = {entry.digest for entry in self._ledger.entries}
        if event == "new" or (event == "known" and digest not in known):
            try:
                shot = self._read(path, digest)
            except CaptureError as error:
                self._refuse(whole, str(error), found)
                return
            if hot.look_of(whole.name) != whole.look:
                return
            found.shots.append(shot)
        before = {entry.digest: entry.name for entry in self._ledger.entries}
        self._ledger.take(digest, whole, event)
        hot.tracker.took(whole)
        self.unreadable.pop(whole.name, None)
        if event == "moved":
            found.notes.append(f"{before.get(digest, 'it')} is called {whole.name} now")
            self._shoot.rename(digest, path)
        elif event == "copy":
            found.notes.append(f"{whole.name} is a copy of {before[digest]}, and no other photograph")
        gone = set(before) - {entry.digest for entry in self._ledger.entries}
        found.notes += [f"{before[one]}: {whole.name} stands in its place now" for one in sorted(gone)]
        self._shoot.take_back(gone)

    def _read(self, path: Path, digest: str) -> Shot:
        _, encoding = encoding_of(path, self._asking)
        return read_shot(path, digest, Kept(self._kept, encoding, half=False))

    def _refuse(self, whole: Whole, why: str, found: Taken) -> None:
        again = self._hot.tracker.refused(whole, self._hot.clock())
        if not again:
            self.unreadable[whole.name] = why
            found.warnings.append(f"{whole.name}: has not become a photograph. {why}")
