"""The record of an output folder: what rgbn made there, each file with its checksum, and which work is done.

It lies in the folder's `.rgbn`. rgbn writes over and removes only files that the record lists with the content that
they have. `scene.output_folder` opens it.
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

from scene.current import file_digest, libraries
from scene.errors import SceneError
from scene.journal import Journal, Line
from scene.owned_file import TICK_NS, OwnedFile, is_settled, look_of, own_digest

PLACE = ".rgbn"
"""Folder in the output folder: the record, the lock, and what is not finished."""
JOURNAL = "record.jsonl"
FORMAT = 1


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
    _files: dict[str, OwnedFile] = field(default_factory=dict)
    _inputs: dict[str, tuple[list[int], str]] = field(default_factory=dict)
    _work: str = ""
    process: int = field(default_factory=os.getpid)
    _guard: threading.RLock = field(default_factory=threading.RLock)

    def __post_init__(self) -> None:
        self._journal = Journal(self.folder / PLACE / JOURNAL)

    # What is done.

    def is_current(self, work: str, mark: str) -> bool:
        """Whether a work is done, of this fingerprint, and all its files are as it left them."""
        entry = self.done.get(work)
        return entry is not None and entry["fingerprint"] == mark and all(map(self.is_intact, self.files_of(work)))

    def files_of(self, work: str) -> list[Path]:
        """Return the files that a work made."""
        return [self.folder / name for name, file in self._files.items() if file.of == work]

    def is_intact(self, path: Path) -> bool:
        """Whether a file is there and has the content that rgbn gave it."""
        known = self._files.get(self.name_of(path))
        return known is not None and known.content(path) is not None

    @property
    def is_bare(self) -> bool:
        """Whether no work has left a file."""
        return not any(file.of for file in self._files.values())

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
        self._finish(work, {"fingerprint": mark, **entry})

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
        names = [name for name, file in self._files.items() if file.of in works]
        for name in names:
            self.check_free(self.folder / name)
        for work in sorted(works & set(self.done)):
            del self.done[work]
            self._journal.append({"forgotten": work})
        for name in names:
            self._remove(self.folder / name)

    def remove(self, path: Path) -> None:
        """Remove a file that rgbn wrote, if it is there; raise SceneError where it is another's."""
        if self.check_free(path):
            self._remove(path)

    def _finish(self, work: str, entry: dict[str, Any]) -> None:
        # A file's look tells of later changes only when the clock has moved on.
        time.sleep(1.2e-9 * TICK_NS)
        looks = {}
        for path in self.files_of(work):
            file = self._files[self.name_of(path)]
            looks[self.name_of(path)] = file.look = file.look if is_settled(file.look) else None
        self._journal.append({"done": work, "entry": entry, "looks": looks})
        # What is kept in memory must be what a later run reads.
        self.done[work] = json.loads(json.dumps(entry))

    def note(self, name: str, value: Any) -> None:
        """Note a fact of the whole folder, a plain value; it holds until another is noted."""
        value = json.loads(json.dumps(value))
        if self.notes.get(name) != value:
            self._journal.append({"note": name, "value": value})
            self.notes[name] = value

    # What rgbn may write.

    def temporary(self, path: Path) -> Path:
        """Return where a file is written before it takes its place."""
        place, name = self.folder / PLACE / "tmp", f".{os.getpid()}.{threading.get_ident()}.tmp.{path.name[-200:]}"
        place.mkdir(exist_ok=True)
        # A file can only be renamed within one file system.
        return (place if place.stat().st_dev == path.parent.stat().st_dev else path.parent) / name

    def scratch(self, name: str) -> Path:
        """Return a folder for what is not finished; rgbn alone writes there. It stays when a run is killed."""
        return self.folder / PLACE / name

    def put(self, source: Path, path: Path) -> None:
        """Move a finished file to its place; note it before, so that a killed run leaves no file without an owner.

        Raises
        ------
        SceneError
            Something stands there that rgbn did not write, or that was changed since.
        """
        with self._guard:
            file = self._note(source, path)
            os.replace(source, path)
            file.look = look_of(path)

    def put_folder(self, source: Path, folder: Path) -> None:
        """Move a finished folder to its place, where nothing is, at once; see `put`."""
        with self._guard:
            within = [path.relative_to(source) for path in sorted(source.rglob("*")) if path.is_file()]
            files = {name: self._note(source / name, folder / name) for name in within}
            os.replace(source, folder)
            for name, file in files.items():
                file.look = look_of(folder / name)

    def _note(self, source: Path, path: Path) -> OwnedFile:
        """Note that a path may have the content of a file from now on, beside the one that it has."""
        name, digest = self.name_of(path), file_digest(source)
        assert digest is not None
        old, before = self._files.get(name), self.check_free(path)
        file = OwnedFile(old.of if old and before else self._work, (before, digest) if before else (digest,))
        self._journal.append({"file": name, "of": file.of, "digests": file.digests})
        self._files[name] = file
        return file

    def check_free(self, path: Path) -> str:
        """Return the digest of the file that may be written over, empty where there is none; see `own_digest`."""
        return own_digest(path, self._files.get(self.name_of(path)))

    def _remove(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        name = self.name_of(path)
        if name in self._files:
            del self._files[name]
            self._journal.append({"gone": name})
        # Folders that were made for it; one with another's file stays.
        for parent in path.parents:
            if parent == self.folder or not self.is_inside(parent):
                break
            with suppress(OSError):
                parent.rmdir()

    # Inputs.

    def digest(self, path: Path) -> str | None:
        """Return `file_digest` of an input; from memory where the file looks as it did, to the tick of its clock."""
        try:
            seen, name = look_of(path), str(path.resolve())
        except OSError:
            return None
        known = self._inputs.get(name)
        if known and known[0] == seen:
            return known[1]
        digest = file_digest(path)
        if digest is not None and is_settled(seen):
            self._inputs[name] = (seen, digest)
            self._journal.append({"input": name, "look": seen, "digest": digest})
        return digest

    def refuse_inputs(self, paths: Iterable[Path]) -> None:
        """Raise SceneError where an input is a file that rgbn made here, and would make anew."""
        for path in paths:
            known = self._files.get(self.name_of(path))
            if known is not None and known.of:
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

    def load(self, *, mend: bool = True) -> None:
        """Read the record; with `mend`, of a folder that is held, also begin it, or write it anew where it has grown.

        Raises
        ------
        SceneError
            It is damaged.
        """
        if not self._journal.path.exists():
            if mend:
                self._journal.rewrite(self._kept())
            return
        torn, kept = self._journal.read(self._replay), len(self.done) + len(self._files) + len(self._inputs)
        if mend and (torn or self._journal.count > 200 + 4 * kept):
            self._journal.rewrite(self._kept())

    def _replay(self, line: dict[str, Any]) -> None:
        if "file" in line:
            self._files[line["file"]] = OwnedFile(line["of"], tuple(line["digests"]))
        elif "gone" in line:
            self._files.pop(line["gone"], None)
        elif "done" in line:
            self.done[line["done"]] = dict(line["entry"])
            for name, look in line["looks"].items():
                self._files[name].look = look
        elif "forgotten" in line:
            self.done.pop(line["forgotten"], None)
        elif "note" in line:
            self.notes[line["note"]] = line["value"]
        elif "input" in line:
            self._inputs[line["input"]] = (line["look"], line["digest"])
        elif line["format"] != FORMAT:
            raise ValueError(f"format {line['format']}, expected {FORMAT}")

    def _kept(self) -> Iterator[Line]:
        """Yield the lines that count."""
        yield {"format": FORMAT, "made_by": libraries()["rgbn"]}
        for name, value in self.notes.items():
            yield {"note": name, "value": value}
        for name, file in self._files.items():
            yield {"file": name, "of": file.of, "digests": file.digests}
        for work, entry in self.done.items():
            looks = {name: file.look for name, file in self._files.items() if file.of == work and file.look}
            yield {"done": work, "entry": entry, "looks": looks}
        for name, (look, digest) in self._inputs.items():
            yield {"input": name, "look": look, "digest": digest}
