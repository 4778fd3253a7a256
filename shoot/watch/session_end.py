"""The end of a shoot: an ordinary session.toml, by `init`'s code, and an output folder whose frames are decoded."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from capture.session.manifest import SphereTable
from capture.survey.folder_files import FEWEST, files_below, sorted_files
from lab.progress import say
from lab.session_place import MANIFEST
from scene.current import file_digest
from scene.errors import SessionError
from scene.files import write_json
from scene.light_text import FILENAMES
from scene.reading import json_of
from scene.record import Record
from shoot.init.answers import Asking
from shoot.init.draft import Draft
from shoot.init.prepare import begun, completed, encoding_of
from shoot.watch.shots import Shot, Sorted

WRITTEN = "manifest.json"
"""In the watch's own folder: the digest of the session.toml that it wrote last."""


def check_folder(folder: Path, record: Record | None = None) -> None:
    """Raise SessionError where a folder cannot be watched; `record`: of the output folder, which knows our own files.

    A session.toml that an earlier watch wrote, and that nobody has changed since, is written anew.
    """
    if not folder.is_dir():
        lacks = "is no folder" if folder.exists() else "there is no such folder"
        raise SessionError(f"{folder}: {lacks}. Give the folder that the camera's program writes into.")
    if (folder / FILENAMES).is_file():
        raise SessionError(f"{folder}: is a session in the DiLiGenT layout already. Run: rgbn process {folder}")
    manifest = folder / MANIFEST
    if record is None or not os.path.lexists(manifest):
        return
    ours = record.scratch("watch") / WRITTEN
    if not ours.is_file() or json_of(ours).get("digest") != file_digest(manifest):
        raise SessionError(
            f"{manifest}: is there already, and a watch would write over it in the end. Watch a new folder; or rename "
            f"{MANIFEST} and start again: what was shot is taken too."
        )


def draft_of_shoot(
    folder: Path, sorted_: Sorted, asking: Asking, balls: list[SphereTable] | None, notes: Sequence[str]
) -> Draft:
    """Return what a shoot is, as `init` would have found it.

    Raises
    ------
    SessionError
        Too few photographs show the flash.
    """
    flash, ambient = _there(sorted_.flash), _there(sorted_.ambient)
    lost = len(sorted_.flash) + len(sorted_.ambient) - len(flash) - len(ambient)
    if len(flash) < FEWEST:
        raise SessionError(
            f"{folder}: {len(flash)} photographs show the flash; a session needs {FEWEST} or more, and none was "
            "written. Shoot more, and run the same command again: what was taken is kept."
        )
    told = [f"{lost} photographs were taken, and are not in the folder any more; they are left out."] if lost else []
    linear, _ = encoding_of(flash[0].path, asking)
    roles = {role: [shot.path for shot in _there(shots)] for role, shots in sorted_.others.items()}
    photographs = {"flash": [shot.path for shot in flash], "ambient": [shot.path for shot in ambient], **roles}
    small, unlit = [shot.small for shot in flash], [shot.small for shot in ambient]
    draft = begun(folder, photographs, small, unlit, linear=linear, notes=(*notes, *told))
    files = sorted_files(files_below(folder), folder)
    try:
        return completed(draft, files, asking, balls)
    except SessionError as error:
        # The shoot is over: a diameter that does not fit is put right in session.toml.
        say(f"warning: {error}", always=True)
        said = asking.answers
        plain = Asking(replace(said, chrome=(), white=()), silent=True)
        return completed(draft.noting(str(error)), files, plain, balls)


def note_manifest(record: Record, manifest: Path) -> None:
    """Note the session.toml that was written, so that the next watch may write it anew."""
    write_json(record.scratch("watch") / WRITTEN, {"digest": file_digest(manifest)})


def _there(shots: Sequence[Shot]) -> list[Shot]:
    return [shot for shot in shots if shot.path.is_file()]


def left_out(sorted_: Sorted, shots: Sequence[Shot]) -> list[str]:
    """Say which photographs are no part of the session, and why."""
    frames = {shot.digest for shot in (*sorted_.flash, *sorted_.ambient)}
    return [f"{shot.name}: {sorted_.told[shot.digest]}" for shot in shots
            if shot.digest in sorted_.told and shot.digest not in frames]  # fmt: skip
