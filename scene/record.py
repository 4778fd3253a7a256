"""The record of an output folder: what rgbn made there, each file with its checksum, and which work is done.

It lies in the folder's `.rgbn`, one file that is replaced whole: a killed run or a full disk leaves the last one. rgbn
writes over and removes only files that the record lists with the content that they have. `scene.output_folder` opens
it.
"""

import json
import os
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scene.current import TICK_NS, FileLook, file_digest, fingerprint, libraries, look_of
from scene.errors import SceneError
from scene.reading import reading

PLACE = ".rgbn"
"""Folder in the output folder: the record, the lock, and what is not finished."""
NAME = "record.json"
FORMAT = 4


def temporary_name(path: Path) -> str:
    """Return the name under which a file is written; no longer than file systems allow, 255 bytes."""
    return f".{os.getpid()}.{threading.get_ident()}.tmp.{os.fsdecode(os.fsencode(path.name)[-200:])}"


@dataclass
class Record:
    """What an output folder holds; opened by `scene.output_folder`.

    Parameters
    ----------
    folder : Path
        Resolved.

    Attributes
    ----------
    done : dict of str to dict
        Of each finished work its fingerprint and what it gave.
    notes : dict of str to object
        What is known of the whole folder, as JSON has it; see `note`.
    """

    folder: Path
    done: dict[str, dict[str, Any]] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)
    _files: dict[str, tuple[str, list[str]]] = field(default_factory=dict)
    """Of each file that rgbn wrote the work that made it, empty: none that is ever forgotten; and the contents that it
    may have: two, while nobody knows whether a killed run had put the second in place."""
    _seen: dict[str, tuple[FileLook, str]] = field(default_factory=dict)
    """How a file looked when it had this digest: inputs, and files that rgbn wrote."""
    _work: str = ""
    process: int = field(default_factory=os.getpid)
    _guard: threading.RLock = field(default_factory=threading.RLock)

    # What is done.

    def is_current(self, work: str, mark: str) -> bool:
        """Whether a work is done, of this fingerprint, and all its files are as it left them."""
        entry = self.done.get(work)
        return entry is not None and entry["fingerprint"] == mark and all(map(self.is_intact, self.files_of(work)))

    def files_of(self, work: str) -> list[Path]:
        """Return the files that a work made."""
        return [self.folder / name for name, (of, _) in self._files.items() if of == work]

    def is_intact(self, path: Path) -> bool:
        """Whether a file is there and has the content that rgbn gave it."""
        return bool(self._own_digest(path))

    def _own_digest(self, path: Path) -> str:
        """Return the digest of a file, if rgbn gave it that content; else nothing."""
        _, digests = self._files.get(self.name_of(path), ("", []))
        found = self.digest(path) if digests and path.is_file() and not path.is_symlink() else None
        return found if found in digests else ""

    @property
    def is_bare(self) -> bool:
        """Whether no work has left a file."""
        return not any(of for of, _ in self._files.values())

    @contextmanager
    def making(self, work: str, mark: str, after: Iterable[str] = ()) -> Iterator[dict[str, Any]]:
        """Do a work: files that are written meanwhile are its own, and it counts as done when the block ends well.

        Parameters
        ----------
        work, mark : str
            Its name and fingerprint.
        after : iterable of str
            Works that were made from it. They are forgotten with it first: a run that is killed, or stops after this
            work, must find neither an old mark on new files nor old results beside new ones.

        Yields
        ------
        entry : dict
            To be filled with what is to be kept of the work, plain values.
        """
        self.forget([work, *after])
        entry: dict[str, Any] = {}
        with self.part_of(work):
            yield entry
        # A file's look tells of later changes only when the clock has moved on.
        time.sleep(1.2e-9 * TICK_NS)
        # What is kept in memory must be what a later run reads.
        self.done[work] = json.loads(json.dumps({"fingerprint": mark, **entry}))
        self.save()

    @contextmanager
    def part_of(self, work: str) -> Iterator[None]:
        """Count files that are written meanwhile to a work: they are forgotten with it."""
        before, self._work = self._work, work
        try:
            yield
        finally:
            self._work = before

    def forget(self, works: Iterable[str]) -> None:
        """Forget works, and remove their files.

        Raises
        ------
        SceneError
            A file has changed since rgbn wrote it. Nothing is removed then.
        """
        works = set(works)
        paths = [path for work in works for path in self.files_of(work)]
        for path in paths:
            self.check_free(path)
        if works & set(self.done):
            self.done = {work: entry for work, entry in self.done.items() if work not in works}
            self.save()
        self._remove(paths)

    def remove(self, path: Path) -> None:
        """Remove a file that rgbn wrote, if it is there; raise SceneError where it is another's."""
        if self.check_free(path):
            self._remove([path])

    def note(self, name: str, value: Any) -> None:
        """Note a fact of the whole folder, a plain value; it holds until another is noted."""
        value = json.loads(json.dumps(value))
        if self.notes.get(name) != value:
            self.notes[name] = value
            self.save()

    # What rgbn may write.

    def temporary(self, path: Path) -> Path:
        """Return where a file is written before it takes its place."""
        place = self.folder / PLACE / "tmp"
        place.mkdir(exist_ok=True)
        # A file can only be renamed within one file system.
        return (place if place.stat().st_dev == path.parent.stat().st_dev else path.parent) / temporary_name(path)

    def scratch(self, name: str) -> Path:
        """Return a folder for what is not finished; rgbn alone writes there. It stays when a run is killed."""
        return self.folder / PLACE / name

    def put(self, source: Path, path: Path) -> None:
        """Move a finished file, or a folder where nothing is, to its place.

        It is noted before, with the content that it has and the one that it gets: a killed run leaves no file without
        an owner.

        Raises
        ------
        SceneError
            Something stands there that rgbn did not write, or that was changed since.
        """
        with self._guard:
            within = sorted(source.rglob("*")) if source.is_dir() else [source]
            places = {path / file.relative_to(source): file_digest(file) for file in within if file.is_file()}
            for place, digest in places.items():
                name, before = self.name_of(place), self.check_free(place)
                of = self._files[name][0] if before else self._work
                self._files[name] = of, [one for one in (before, digest) if one]
            self.save()
            os.replace(source, path)
            for place, digest in places.items():
                if look := look_of(place):
                    self._seen[self.name_of(place)] = look, str(digest)

    def check_free(self, path: Path) -> str:
        """Return the digest of the file that may be written over, empty where there is none.

        Raises
        ------
        SceneError
            Something is there that rgbn did not write, or that was changed since.
        """
        if not os.path.lexists(path):
            return ""
        if self.name_of(path) not in self._files:
            raise SceneError(
                f"{path}: is there already, and rgbn did not write it; it is not written over. Move it away, or choose "
                "another name or folder (--out)."
            )
        if not (digest := self._own_digest(path)):
            raise SceneError(
                f"{path}: was changed after rgbn wrote it; it is not written over or removed. Move it away and run "
                "again, or choose another folder with --out."
            )
        return digest

    def _remove(self, paths: list[Path]) -> None:
        for path in paths:
            path.unlink(missing_ok=True)
            # Folders that were made for it; one with another's file stays.
            for parent in path.parents:
                if parent == self.folder or not self.is_inside(parent):
                    break
                with suppress(OSError):
                    parent.rmdir()
        names = {self.name_of(path) for path in paths} & set(self._files)
        for name in names:
            del self._files[name]
            self._seen.pop(name, None)
        if names:
            self.save()

    # Inputs.

    def digest(self, path: Path) -> str | None:
        """Return `file_digest`; from memory where the file looks as it did, to the tick of its clock."""
        name, look = self.name_of(path), look_of(path)
        known = self._seen.get(name)
        if known and known[0] == look:
            return known[1]
        digest = file_digest(path) if look else None
        if look and digest is not None and look.is_settled:
            self._seen[name] = look, digest
        return digest

    def refuse_inputs(self, paths: Iterable[Path]) -> None:
        """Raise SceneError where an input is a file that rgbn made here, and would make anew."""
        for path in paths:
            if self._files.get(self.name_of(path), ("",))[0]:
                raise SceneError(
                    f"{path}: is an input, and one of the results in {self.folder}, which this run would write over. "
                    "Choose another folder with --out."
                )

    # The file.

    def name_of(self, path: Path) -> str:
        """Return a path below the folder as it is written here; another one in full."""
        place = Path(os.path.abspath(path))
        if not place.is_relative_to(self.folder):
            place = place.parent.resolve() / place.name
        return place.relative_to(self.folder).as_posix() if place.is_relative_to(self.folder) else str(place)

    def is_inside(self, path: Path) -> bool:
        """Whether a path lies below the folder."""
        return not self.name_of(path).startswith("/")

    def load(self) -> None:
        """Read the record, if there is one; raise SceneError where it is damaged."""
        path = self.folder / PLACE / NAME
        if not path.exists():
            return
        do = "Without it rgbn cannot tell which files here are its own. Choose another folder with --out."
        with reading(path, "cannot be read", do=do):
            data = json.loads(path.read_bytes())
            if data["format"] != FORMAT:
                raise ValueError(f"format {data['format']}, expected {FORMAT}")
            if data.pop("digest") != fingerprint(data):
                raise ValueError("its content is not what rgbn wrote")
            self.notes, self.done, self._files, seen = (data[name] for name in ("notes", "done", "files", "seen"))
            self._seen = {name: (FileLook(*look), digest) for name, (look, digest) in seen.items()}

    def save(self) -> None:
        """Replace the record on disk; raise SceneError where the disk is full, or the file cannot be written."""
        path = self.folder / PLACE / NAME
        with self._guard:
            # Other threads may see files meanwhile.
            seen = {name: known for name, known in self._seen.copy().items() if known[0].is_settled}
            data = {"format": FORMAT, "made_by": libraries()["rgbn"], "notes": self.notes, "done": self.done}
            data |= {"files": self._files, "seen": seen}
            try:
                text = json.dumps({**data, "digest": fingerprint(data)}, allow_nan=False)
                if path.is_file() and path.read_text() == text:
                    return
                path.with_suffix(".new").write_text(text)
                os.replace(path.with_suffix(".new"), path)
            except OSError as error:
                raise SceneError(
                    f"{path}: cannot be written ({error.strerror}). Free some space or choose another folder with "
                    "--out; what is done is kept."
                ) from error
