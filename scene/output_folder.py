"""Opening an output folder: whose it is, one run at a time, nothing of the user's in it."""

import errno
import fcntl
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

from scene.errors import SceneError
from scene.origin import NOTE, Origin
from scene.record import NAME, PLACE, Record

_active: list[Record] = []


@contextmanager
def open_record(
    folder: Path,
    *,
    origin: Origin | str | None = None,
    inputs: Iterable[Path] = (),
    input_folders: Iterable[Path] = (),
    among_others: bool = False,
) -> Iterator[Record]:
    """Hold an output folder for one run.

    Parameters
    ----------
    folder : Path
        New, empty, or with a record of its own.
    origin : Origin or str or None
        What results are made from; the folder belongs to it from then on. A word: what the folder is, where no input
        makes it what it is: "sweep". None: files of any origin may lie here.
    inputs : iterable of Path
        Files that the run reads.
    input_folders : iterable of Path
        Folders whose files it reads: a session's, a dataset's.
    among_others : bool
        The user said that files are to lie here, beside his own: the folder may be another's.

    Raises
    ------
    SceneError
        The folder is another's or of another origin, lies in an input folder or holds one, cannot be written, or
        another run is at work there.
    """
    try:
        record = Record(folder.resolve())
    except (OSError, RuntimeError) as error:
        raise _unusable(folder, error) from error
    if not among_others:
        _check_place(record.folder, folder, [place.resolve() for place in input_folders])
    _refuse_links(record.folder, folder)
    with _locked(record.folder, folder):
        record.load()
        if not (record.folder / PLACE / NAME).exists():
            record.save()
        record.refuse_inputs(inputs)
        if origin is not None:
            origin = Origin(origin, record.folder) if isinstance(origin, str) else origin
            origin.claim(record, folder)
        # What a killed run was writing: nobody else writes here now.
        shutil.rmtree(record.folder / PLACE / "tmp", ignore_errors=True)
        _active.append(record)
        try:
            yield record
        finally:
            _active.remove(record)
            # How files looked that were read spares the next run reading them; all else is saved already.
            with suppress(SceneError):
                record.save()


def own_folder(folder: Path, origin: Origin) -> Path:
    """Return FOLDER, or FOLDER-2 and so on: the one that belongs to an origin, or else the first that none owns."""
    numbered = (
        path for path in folder.parent.glob(f"{escape(folder.name)}-*") if path.name[len(folder.name) + 1 :].isdigit()
    )
    found = {place: read_record(place) for place in (folder, *sorted(numbered))}
    for place, record in found.items():
        if record is not None and NOTE in record.notes and origin.owns(record):
            return place
    place, number = folder, 1
    while (record := found.get(place)) is not None and not origin.owns(record):
        number += 1
        place = folder.with_name(f"{folder.name}-{number}")
    return place


def read_record(folder: Path) -> Record | None:
    """Return the record of a folder as it is, without holding it; None where there is none, or it cannot be read."""
    record = Record(folder.resolve())
    if not (record.folder / PLACE).is_dir():
        return None
    with suppress(SceneError, OSError):
        record.load()
    return record


def record_for(path: Path) -> Record | None:
    """Return the record that a write to a path is noted in: of the innermost folder that is held, or the last one."""
    here = [record for record in _active if record.process == os.getpid()]
    inside = [record for record in here if record.is_inside(path)]
    record = max(inside, key=lambda record: len(record.folder.parts), default=here[-1] if here else None)
    # What is not finished is nobody's yet.
    return None if record is None or record.name_of(path).startswith(f"{PLACE}/") else record


def scratch_for(folder: Path) -> Path:
    """Return where files lie until they are moved below a folder; what is there stays when a run is killed."""
    record = record_for(folder / "any")
    return folder / "unfinished" if record is None else record.scratch(f"unfinished/{record.name_of(folder)}")


def _check_place(folder: Path, said: Path, input_folders: list[Path]) -> None:
    for place in input_folders:
        if folder.is_relative_to(place):
            where = "is" if folder == place else "lies in"
            raise SceneError(
                f"--out {said}: {where} the folder {place}, which is read; rgbn writes nothing there. Choose a folder "
                f"outside of it with --out, for example {place.parent / (place.name + '-out')}."
            )
    try:
        there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise _unusable(said, error) from error
    # A run that was killed before it had begun leaves the folder of the record alone.
    if there not in ([], [PLACE]) and not (folder / PLACE / NAME).is_file():
        shown = ", ".join(there[:3]) + (" ..." if len(there) > 3 else "")
        raise SceneError(
            f"--out {said}: is not empty ({shown}), and rgbn did not make it, or an earlier version did: "
            f"it has no record ({PLACE}/{NAME}). Choose a new folder; nothing was written or removed."
        )


def _refuse_links(folder: Path, said: Path) -> None:
    """Raise SceneError where a part of the record is a link: what it names is not rgbn's to write over."""
    place = folder / PLACE
    links = [path for path in (place, *(place.iterdir() if place.is_dir() else ())) if path.is_symlink()]
    if links:
        raise SceneError(
            f"--out {said}: {links[0].relative_to(folder)} is a link, and rgbn makes none. Remove the link, or choose "
            "another folder with --out; nothing was written or removed."
        )


@contextmanager
def _locked(folder: Path, said: Path) -> Iterator[None]:
    try:
        (folder / PLACE).mkdir(parents=True, exist_ok=True)
        # Held for the whole block; never emptied.
        file = open(folder / PLACE / "lock", "a")  # noqa: SIM115
    except OSError as error:
        raise _unusable(said, error) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SceneError(f"{said}: another run is writing here. Wait for it, or choose another --out.") from None
        except OSError as error:
            # Some network folders have no locks: then only the user can see to it that one run writes there.
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
                raise _unusable(said, error) from error
        yield


def _unusable(folder: Path, error: OSError | RuntimeError) -> SceneError:
    why = getattr(error, "strerror", None) or error
    return SceneError(f"--out {folder}: cannot be used for output ({why}). Choose another with --out.")
