"""Which photographs of a folder are whole: decided from listings and a clock that are handed in; nothing is read.

A file is whole once its size, its time and its identity have stood still for a while, by a clock that only goes
forward: what the clock on the wall says, or the files' own times, is compared as equal or not, and never subtracted.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import NamedTuple

from capture.session.globs import kind_of, natural_key
from capture.survey.folder_files import rank_of

STILL_S = 0.5
"""Seconds that a file stands still before it is read. One that is read too early changes again, and is read again."""
ALONE_S = 3.0
"""The same of a JPEG, or another picture, whose RAW file may still come."""
PATIENCE_S = 60.0
"""A file that cannot be read is tried again after twice the time, up to this; from then on only when it changes."""


class Look(NamedTuple):
    """What a listing says of a file; two looks that differ are two contents."""

    size: int
    mtime_ns: int
    inode: int


class Whole(NamedTuple):
    """A photograph that is to be read: its file's name in the folder, and how it looked."""

    name: str
    look: Look


@dataclass
class _Seen:
    """How a file looks, since when, and how long it must stand still before it is read."""

    look: Look
    since: float
    patience: float = 0.0


def photograph_of(name: str) -> str:
    """Return what all files of one photograph share, its RAW file and its JPEG: the name without its ending."""
    return PurePath(name).with_suffix("").as_posix()


class Tracker:
    """What is known of the files of a folder.

    A photograph is all files of one name, of whatever ending; the one that holds most stands for it. What was taken
    stays taken, whether its file is deleted or not; it is read again where other content stands under its name, or a
    better file comes.

    Parameters
    ----------
    taken : iterable of Whole
        What was taken before: by an earlier run, from its ledger.
    still_s, alone_s : float
        See `STILL_S` and `ALONE_S`.
    """

    def __init__(self, taken: Iterable[Whole] = (), *, still_s: float = STILL_S, alone_s: float = ALONE_S) -> None:
        self._still_s, self._alone_s = still_s, max(alone_s, still_s)
        self._seen: dict[str, _Seen] = {}
        self._taken: dict[str, Whole] = {}
        self._has_raw, self._has_alone = False, False
        for whole in taken:
            self.took(whole)

    def see(self, listing: Mapping[str, Look] | None, now: float) -> None:
        """Take in what stands in the folder at a time; None: the folder itself is gone, which says nothing of files."""
        if listing is None:
            return
        for name in set(self._seen) - set(listing):
            del self._seen[name]
        for name, look in listing.items():
            known = self._seen.get(name)
            if known is None or known.look != look:
                self._seen[name] = _Seen(look, now)

    def whole(self, now: float) -> list[Whole]:
        """Return the photographs that are to be read now, in natural order."""
        found = [self._whole_one(key, names, now) for key, names in self._photographs().items()]
        return sorted((one for one in found if one), key=lambda one: natural_key(PurePath(one.name)))

    def next_s(self, now: float) -> float | None:
        """Return after how many seconds a file may be whole that is not yet; None where none is waited for."""
        waits = [
            seen.since + self._wait_s(name, seen) - now
            for key, names in self._photographs().items()
            if (name := self._best(key, names)) is not None and (seen := self._seen[name]).patience <= PATIENCE_S
        ]
        return max(min(waits), 0.0) if waits else None

    def took(self, whole: Whole) -> None:
        """Note that a photograph was taken, or was known already."""
        self._taken[photograph_of(whole.name)] = whole
        is_raw = kind_of(PurePath(whole.name)) == "raw"
        self._has_raw, self._has_alone = self._has_raw or is_raw, self._has_alone or not is_raw

    def refused(self, whole: Whole, now: float) -> bool:
        """Note that a file cannot be read as it is; return whether it will be tried again without a change."""
        seen = self._seen.get(whole.name)
        if seen is None or seen.look != whole.look:
            return True
        seen.since, seen.patience = now, 2 * max(seen.patience, self._still_s)
        return seen.patience <= PATIENCE_S

    def _photographs(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for name in self._seen:
            found.setdefault(photograph_of(name), []).append(name)
        return found

    def _best(self, key: str, names: list[str]) -> str | None:
        """Return the file that stands for a photograph and is not taken as it looks; None where there is none."""
        name = min(names, key=lambda one: (rank_of(PurePath(one)), one))
        taken = self._taken.get(key)
        if taken is None:
            return name
        if rank_of(PurePath(name)) > rank_of(PurePath(taken.name)):
            return None
        return None if taken == (name, self._seen[name].look) else name

    def _whole_one(self, key: str, names: list[str], now: float) -> Whole | None:
        name = self._best(key, names)
        if name is None:
            return None
        seen = self._seen[name]
        if seen.patience > PATIENCE_S or now - seen.since < self._wait_s(name, seen):
            return None
        return Whole(name, seen.look)

    def _wait_s(self, name: str, seen: _Seen) -> float:
        # Where photographs are pictures alone, no RAW file is waited for.
        is_alone = kind_of(PurePath(name)) != "raw" and (self._has_raw or not self._has_alone)
        return max(self._alone_s if is_alone else self._still_s, seen.patience)
