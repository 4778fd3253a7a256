"""What an output folder is made from: results of two sessions never lie in one folder."""

import os
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scene.current import blocks_digest
from scene.errors import SceneError
from scene.record import Record

NOTE = "origin"
"""Of a record."""


@dataclass(frozen=True)
class Origin:
    """A session, a scene description, a scan to plan for.

    Its photographs tell a session from others, not its name; nor its place, when it was moved.

    Parameters
    ----------
    kind : str
        "session", "scene", "scan" ...
    place : Path
        Absolute.
    files : tuple of Path
        Its photographs. Empty: it has none yet, or none at all.
    """

    kind: str
    place: Path
    files: tuple[Path, ...] = ()

    @cached_property
    def contents(self) -> dict[str, str]:
        """The `blocks_digest` of each file that is there."""
        found = {str(file): blocks_digest(file) for file in self.files}
        return {file: digest for file, digest in found.items() if digest}

    def owns(self, record: Record) -> bool:
        """Whether the results of a folder are those of this origin, or of none."""
        note = record.notes.get(NOTE)
        if note is None or record.is_bare:
            return True
        if note["kind"] != self.kind or (note["files"] and not self._shares(note["files"])):
            return False
        if _is_one(self.place, Path(note["place"]), record.folder / note["relative"]) or self._is_within(record):
            return True
        # Moved: a copy beside the first one is another session.
        return bool(note["files"]) and not (os.path.lexists(note["place"]) and _any_is_there(note["files"]))

    def claim(self, record: Record, said: Path) -> None:
        """Note in a record that is held that its folder belongs to this origin.

        Parameters
        ----------
        record : Record
        said : Path
            The folder as the user gave it.

        Raises
        ------
        SceneError
            The folder belongs to another origin.
        """
        note = record.notes.get(NOTE)
        if note and not self.owns(record):
            raise SceneError(f"--out {said}: {self._whose(note)} Choose another folder with --out; or remove this one, "
                             "if its results are not needed. Nothing was written or removed.")  # fmt: skip
        place, relative = str(self.place), os.path.relpath(self.place, record.folder)
        if note and self._is_within(record):
            place, relative = note["place"], note["relative"]
        record.note(NOTE, {"kind": self.kind, "place": place, "relative": relative, "files": self.contents})

    def _shares(self, files: dict[str, str]) -> bool:
        return bool(set(files.values()) & set(self.contents.values())) if self.files else _any_is_there(files)

    def _is_within(self, record: Record) -> bool:
        """Whether this is a correction of the session, which lies in the output folder itself."""
        return self.place.is_relative_to(record.folder)

    def _whose(self, note: dict[str, Any]) -> str:
        if note["kind"] == self.kind and _is_one(self.place, Path(note["place"])):
            return f"it holds the results of other photographs, which lay in {self.place} before."
        return f"it holds the results of the {note['kind']} {note['place']}, not of the {self.kind} {self.place}."


def _is_one(place: Path, *others: Path) -> bool:
    """Whether a place is one of others, by whatever name."""
    for other in others:
        with suppress(OSError):
            if os.path.samefile(place, other):
                return True
    return False


def _any_is_there(files: dict[str, str]) -> bool:
    return any(blocks_digest(Path(file)) == digest for file, digest in files.items())
