"""A session folder, `session.toml` or the DiLiGenT layout, read with all its faults; nothing is decoded."""

import difflib
from dataclasses import replace
from glob import escape
from pathlib import Path

from capture.session.manifest import Manifest
from capture.session.manifest_file import parse, toml_tables
from capture.session.resolve import Resolver
from capture.session.session_types import CaptureSession
from formats.diligent_layout import MASK, NORMALS
from scene.errors import SessionError
from scene.light_text import DIRECTIONS, FILENAMES, names_in
from scene.reading import listed, reading, told

MANIFEST = "session.toml"


def load_session(path: Path) -> CaptureSession:
    """Read a session.

    Parameters
    ----------
    path : Path
        The folder, or the .toml file in it.

    Raises
    ------
    SessionError
        Every fault at once, each with its key path and what to do about it.
    """
    with reading(path, "is no session that can be read", SessionError, do="Give the folder that holds session.toml."):
        path = Path(path).resolve()
        str(path).encode()
        if not path.exists():
            near = difflib.get_close_matches(path.name, _names(path.parent), n=1)
            meant = f"Did you mean {path.parent / near[0]}?" if near else f"Give the folder that holds {MANIFEST}."
            raise SessionError(f"{path}: there is no such session. {meant}")
        if path.is_file():
            if path.suffix.lower() != ".toml":
                raise SessionError(f"{path}: is no {MANIFEST}. Give the folder that holds one.")
            return _load_toml(path)
        if (path / MANIFEST).is_file():
            return _load_toml(path / MANIFEST)
        if (path / FILENAMES).is_file() or (path / DIRECTIONS).is_file():
            return _load_diligent(path)
        raise SessionError(f"{path}: {_no_session(path)}")


def _no_session(folder: Path) -> str:
    """Say what a folder lacks to be a session, and what may have been meant."""
    lacks = f"holds neither {MANIFEST} nor a DiLiGenT layout (filenames.txt, light_directions.txt, ...)."
    for name in _names(folder):
        # Editors add .txt, and systems hide it.
        if name.lower() in (MANIFEST, f"{MANIFEST}.txt") and (folder / name).is_file():
            return f"{lacks} Rename {name} to {MANIFEST}."
    below = [name for name in _names(folder) if (folder / name / MANIFEST).is_file()]
    near = [folder / name for name in below] or [place for place in folder.parents[:1] if (place / MANIFEST).is_file()]
    if near:
        return f"{lacks} Did you mean {listed(near, 3)}?"
    return f"{lacks} To have {MANIFEST} written from the photographs, run:\n  rgbn init {folder}"


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


def _load_toml(path: Path) -> CaptureSession:
    data = toml_tables(path)
    with reading(path, "cannot be followed", SessionError, do="Correct it, or the files that it names."):
        return _resolved(path, path.parent, *parse(data))


def _load_diligent(folder: Path) -> CaptureSession:
    """Return the session of a folder in the DiLiGenT layout: 16-bit linear pictures, lights given."""
    names = names_in(folder / FILENAMES, SessionError)
    if not names:
        raise SessionError(f"{folder / FILENAMES}: names no photograph. List them there, one a line.")
    frames = {"flash": [escape(name) for name in names], "linear": True}
    normals = next((name for name in NORMALS if (folder / name).is_file()), None)
    known = {"mask": MASK if (folder / MASK).is_file() else None, "normals": normals}
    manifest = parse({"frames": frames, "lights": {"file": DIRECTIONS}, "object": known})
    try:
        return replace(_resolved(folder, folder, *manifest), layout="diligent")
    except SessionError as error:
        raise SessionError(str(error).replace("frames.flash", FILENAMES).replace("lights.file", DIRECTIONS)) from None


def _resolved(place: Path, folder: Path, manifest: Manifest | None, faults: list[str]) -> CaptureSession:
    """Return the session that a manifest in a folder describes; SessionError for all that is wrong with it."""
    session = Resolver(folder, faults).session(manifest) if manifest else None
    if faults or session is None:
        raise SessionError(told(place, faults))
    return session
