"""Which photographs were taken, by their content: written after each success, so that a kill loses and doubles none."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from capture.hot_folder.tracker import Look, Whole, photograph_of
from scene.errors import SceneError
from scene.files import write_json
from scene.reading import json_of, reading

Event = Literal["new", "known", "moved", "copy"]


@dataclass(frozen=True)
class Entry:
    """A photograph that was taken.

    Parameters
    ----------
    digest : str
        Of its file's content, see `scene.current.file_digest`.
    name : str
        Where it stands in the folder, or stood when it was last seen.
    look : Look
    is_replaced : bool
        Another photograph has its place: other content was written under its name, or its RAW file came.
    """

    digest: str
    name: str
    look: Look
    is_replaced: bool = False


class Ledger:
    """The photographs that were taken, in the order in which they were.

    Parameters
    ----------
    path : Path
        Of its file, read if it is there.

    Raises
    ------
    SceneError
        The file is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._entries: dict[str, Entry] = {}
        if path.is_file():
            do = "Remove it: the photographs are read again."
            data = json_of(path, do=do)
            with reading(path, "is no ledger of photographs", SceneError, do=do):
                for row in data["taken"]:
                    look = Look(*map(int, row["look"]))
                    entry = Entry(str(row["digest"]), str(row["name"]), look, bool(row["is_replaced"]))
                    self._entries[entry.digest] = entry

    @property
    def entries(self) -> list[Entry]:
        """The photographs that count, in the order in which they were taken."""
        return [entry for entry in self._entries.values() if not entry.is_replaced]

    @property
    def whole(self) -> list[Whole]:
        """The same as files, for a `Tracker`."""
        return [Whole(entry.name, entry.look) for entry in self.entries]

    def event(self, digest: str, whole: Whole, look_of: Callable[[str], Look | None]) -> Event:
        """Return what a file with this content is; nothing is noted.

        Parameters
        ----------
        digest : str
        whole : Whole
            The file.
        look_of : callable
            Gives how a file of the folder looks now; None where there is none.
        """
        known = self._entries.get(digest)
        if known is None:
            return "new"
        if known.is_replaced or photograph_of(known.name) == photograph_of(whole.name):
            return "known"
        # Where it stood, it stands no more: it was renamed.
        return "copy" if look_of(known.name) == known.look else "moved"

    def take(self, digest: str, whole: Whole, event: Event) -> None:
        """Note a photograph, after all that is done with it is done; a copy of one that counts is no other."""
        if event == "copy":
            return
        key = photograph_of(whole.name)
        for other in self.entries:
            if other.digest != digest and photograph_of(other.name) == key:
                self._entries[other.digest] = replace(other, is_replaced=True)
        self._entries[digest] = Entry(digest, whole.name, whole.look)
        write_json(self.path, {"taken": list(self._entries.values())})
