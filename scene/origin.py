"""What an output folder is made from: results of two sessions never lie in one folder."""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

    def owns(self, record: Record) -> bool:
        """Whether the results of a folder are those of this origin, or of none."""
        note = record.notes.get(NOTE)
        if note is None or record.is_bare:
            return True
        own = self._digests(record) if self.files else None
        shares = _is_there(note, record) if own is None else not own.keys().isdisjoint(note["files"])
        if note["kind"] != self.kind or (note["files"] and not shares):
            return False
        if _is_one(self.place, Path(note["place"]), record.folder / note["relative"]) or self._is_within(record):
            return True
        # Moved: a copy beside the first one is another session.
        return bool(note["files"]) and not (os.path.lexists(note["place"]) and _is_there(note, record))

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
            whose = f"of the {note['kind']} {note['place']}, not of the {self.kind} {self.place}."
            if note["kind"] == self.kind and _is_one(self.place, Path(note["place"])):
                whose = f"of other photographs, which lay in {self.place} before."
            raise SceneError(
                f"--out {said}: it holds the results {whose} Choose another folder with --out; or remove this one, if "
                "its results are not needed. Nothing was written or removed."
            )
        place, relative = str(self.place), os.path.relpath(self.place, record.folder)
        if note and self._is_within(record):
            place, relative = note["place"], note["relative"]
        files = self._digests(record)
        record.note(NOTE, {"kind": self.kind, "place": place, "relative": relative, "files": files})

    def _digests(self, record: Record) -> dict[str, str]:
        """Return the path of each photograph that is there by its digest."""
        return {digest: str(file) for file in self.files if (digest := record.digest(file))}

    def _is_within(self, record: Record) -> bool:
        """Whether this is a correction of the session, which lies in the output folder itself."""
        return self.place.is_relative_to(record.folder)


def _is_one(place: Path, *others: Path) -> bool:
    """Whether a place is one of others, by whatever name."""
    for other in others:
        with suppress(OSError):
            if os.path.samefile(place, other):
                return True
    return False


def _is_there(note: dict[str, Any], record: Record) -> bool:
    """Whether a photograph that was noted stands where it did."""
    return any(record.digest(Path(file)) == digest for digest, file in note["files"].items())
