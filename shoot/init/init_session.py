"""`rgbn init`: a folder looked at, shown, and its session.toml written."""

import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from capture.survey.folder_files import FolderFiles, survey
from lab.progress import progress_bar, say
from lab.session_place import MANIFEST, default_out
from scene.errors import SessionError
from scene.files import write_png, write_text
from scene.light_text import FILENAMES
from scene.origin import Origin
from scene.output_folder import open_record
from shoot.init.answers import Answers, Asking
from shoot.init.contact_sheet import contact_sheet
from shoot.init.draft import Draft
from shoot.init.prepare import prepare
from shoot.init.session_text import is_unedited, session_text, signed

SHEET = "contact-sheet.png"
PART = "init"


class Made(NamedTuple):
    """A session that was written: what was found, its file, and its contact sheet."""

    draft: Draft
    manifest: Path
    sheet: Path


def init_sessions(
    folder: Path, answers: Answers, *, silent: bool = False, shown: Callable[[Draft], None] | None = None
) -> tuple[list[Made], int]:
    """Write a session.toml for a folder, or one for each object's subfolder.

    Parameters
    ----------
    folder : Path
    answers : Answers
        What the command line says.
    silent : bool
        Nothing is asked; what is not known is assumed, and said in the drafts' notes.
    shown : callable, optional
        Gets each draft before it is written.

    Returns
    -------
    made : list of Made
    questions : int
        How many were asked.

    Raises
    ------
    SessionError
        There is a session.toml, or the folder is one in the DiLiGenT layout; no photographs; answers do not fit.
    """
    if (folder / FILENAMES).is_file():
        raise SessionError(f"{folder}: is a session in the DiLiGenT layout already. Run: rgbn process {folder}")
    found = survey(folder)
    for one in found:
        check_free(one)
    if len(found) > 1:
        say(f"{len(found)} objects: {', '.join(one.folder.name for one in found)}")
    asking, made = Asking(answers, silent), []
    for one in found:
        draft = draft_of(one, asking)
        if shown:
            shown(draft)
        made.append(write_session(draft))
    return made, asking.count


def draft_of(files: FolderFiles, asking: Asking) -> Draft:
    """Return what a folder's files are, with a progress bar for the photographs; it is gone before a question comes."""
    with ExitStack() as open_bar:
        bars: list[Callable[[int, int], None]] = []

        def progress(done: int, total: int) -> None:
            if not bars:
                bars.append(open_bar.enter_context(progress_bar(f"look at {files.folder.name}")))
            bars[0](done, total)
            if done == total:
                open_bar.close()

        return prepare(files, asking, progress)


def write_session(draft: Draft, out: Path | None = None) -> Made:
    """Write session.toml into the folder, and the contact sheet into its output folder."""
    manifest = draft.folder / MANIFEST
    origin = Origin("session", draft.folder, tuple(draft.photographs["flash"]))
    out = out or default_out(origin, draft.name)
    with open_record(out, origin=origin, input_folders=[draft.folder]) as record:
        record.forget([PART])
        with record.part_of(PART):
            write_png(out / SHEET, contact_sheet(draft))
    # Last, and outside of the output folder's record: from here on it is the user's.
    write_text(manifest, signed(session_text(draft)))
    return Made(draft, manifest, out / SHEET)


def _is_as_written(manifest: Path) -> bool:
    """Whether a session.toml is a file of its own that init wrote and nobody changed."""
    if manifest.is_symlink() or not manifest.is_file():
        return False
    return is_unedited(manifest.read_bytes().decode("utf-8", "replace"))


def check_free(files: FolderFiles) -> None:
    """Raise SessionError where session.toml is there already and not as init wrote it, or cannot be written."""
    manifest = files.folder / MANIFEST
    if os.path.lexists(manifest) and not _is_as_written(manifest):
        raise SessionError(
            f"{manifest}: is there already, and is not written over. Correct it by hand, or rename it and run "
            f"rgbn init {files.folder} again."
        )
    if not os.access(files.folder, os.W_OK):
        raise SessionError(f"{files.folder}: cannot be written. Copy the folder to a place of your own.")
