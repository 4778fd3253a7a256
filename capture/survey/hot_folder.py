"""A folder that a camera's program writes into: which photographs are whole, by listings and a clock.

A file is whole once its size, its time and its identity have stood still for a while, by a clock that only goes
forward: what the clock on the wall says, or the files' own times, is compared as equal or not, and never subtracted.
Nothing is read, and nothing asked of the file system but listings: of files on a network many systems tell no events.
"""

from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import NamedTuple

from capture.session.globs import kind_of, natural_key
from capture.survey.folder_files import files_below, rank_of
from scene.current import FileLook, look_of

STILL_S = 0.5
"""Seconds that a file stands still before it is read. One that is read too early changes again, and is read again."""
ALONE_S = 3.0
"""The same of a JPEG, or another picture, whose RAW file may still come."""


class WholeFile(NamedTuple):
    """A photograph that can be read: its file's name in the folder, and how it looked."""

    name: str
    look: FileLook


def list_photographs(folder: Path) -> dict[str, FileLook] | None:
    """Return how each photograph of a folder looks, by its name below it; None where the folder is not there.

    Raises
    ------
    SessionError
        The folder holds more files than a capture has.
    """
    looks = {path.relative_to(folder).as_posix(): look_of(path) for path in files_below(folder) if kind_of(path)}
    # Between the listing and the look a file may be gone.
    return {name: look for name, look in looks.items() if look is not None} if folder.is_dir() else None


def photograph_of(name: str) -> str:
    """Return what all files of one photograph share, its RAW file and its JPEG: the name without its ending."""
    return PurePath(name).with_suffix("").as_posix()


class HotFolder:
    """What is known of the files of a folder.

    A photograph is all files of one name, of whatever ending; the one that holds most stands for it. Where that is
    being written, the one that stood for it before still does.
    """

    def __init__(self) -> None:
        self._since: dict[str, tuple[FileLook, float]] = {}
        self._whole: dict[str, WholeFile] = {}
        self.is_there, self.is_growing = True, False
        """Whether the folder is there; whether a file in it is not whole yet."""

    def see(self, listing: Mapping[str, FileLook] | None, now: float) -> list[WholeFile]:
        """Take in what stands in the folder at a time, and return the photographs that are whole, in natural order.

        `listing` None: the folder itself is gone, which says nothing of its files.
        """
        self.is_there = listing is not None
        if listing is not None:
            known = self._since
            self._since = {
                name: known[name] if name in known and known[name][0] == look else (look, now)
                for name, look in listing.items()
            }
        groups: dict[str, list[str]] = {}
        for name in self._since:
            groups.setdefault(photograph_of(name), []).append(name)
        kinds = {kind_of(PurePath(one.name)) for one in self._whole.values()}
        whole = {key: self._whole[key] for key in groups if key in self._whole}
        self.is_growing = False
        for key, names in groups.items():
            best = min(names, key=lambda one: (rank_of(PurePath(one)), one))
            look, since = self._since[best]
            # Where photographs are pictures alone, no RAW file is waited for.
            is_alone = kind_of(PurePath(best)) != "raw" and ("raw" in kinds or not kinds)
            if now - since >= (ALONE_S if is_alone else STILL_S):
                whole[key] = WholeFile(best, look)
            else:
                self.is_growing = True
        self._whole = whole
        return sorted(whole.values(), key=lambda one: natural_key(PurePath(one.name)))
