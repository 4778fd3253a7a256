"""A session folder, `session.toml` or the DiLiGenT layout, read with all its faults; nothing is decoded."""

import tomllib
from pathlib import Path

from capture.session.globs import frame_names, kind_of
from capture.session.session_types import Session
from formats.diligent_layout import DIRECTIONS, FILENAMES, MASK, read_tables
from scene.errors import SessionError
from scene.reading import reading, told

LONGEST = 1 << 20
"""Bytes of a session.toml."""


def load_session(path: Path) -> Session:
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
            raise SessionError(f"{path}: there is no such session. Give the folder that holds session.toml.")
        if path.is_file():
            return _load_toml(path)
        if (path / "session.toml").is_file():
            return _load_toml(path / "session.toml")
        if (path / FILENAMES).is_file() or (path / DIRECTIONS).is_file():
            return _load_diligent(path)
    raise SessionError(
        f"{path}: holds neither session.toml nor a DiLiGenT layout (filenames.txt, light_directions.txt, ...). To have "
        "session.toml written from the photographs, run:\n"
        f"  rgbn init {path}"
    )


def _load_toml(path: Path) -> Session:
    from capture.session.manifest_faults import parse
    from capture.session.resolve import Resolver

    with reading(path, "is not TOML in UTF-8", SessionError, do="Correct that line."):
        if path.stat().st_size > LONGEST:
            raise ValueError(f"{path.stat().st_size} bytes; a session takes some hundreds, {LONGEST} are the most")
        data = tomllib.loads(path.read_text("utf-8-sig"))
    with reading(path, "cannot be followed", SessionError, do="Correct it, or the files that it names."):
        manifest, faults = parse(data)
        session = Resolver(path.parent, faults).session(manifest) if manifest else None
    if faults or session is None:
        raise SessionError(told(path, faults))
    return session


def _load_diligent(folder: Path) -> Session:
    """Return the session of a folder in the DiLiGenT layout: 16-bit linear pictures, lights given."""
    found = read_tables(folder)
    flash = [folder / name for name in found.listed]
    faults = found.faults + [
        f"{FILENAMES}: {path.name} is no photograph that can be read." for path in flash if kind_of(path) is None
    ]
    if faults:
        raise SessionError(told(folder, faults))
    return Session(
        name=folder.name,
        folder=folder,
        flash=tuple(flash),
        names=tuple(frame_names(flash)),
        kept=tuple(range(len(flash))),
        lights_file=folder / DIRECTIONS,
        mask=folder / MASK if (folder / MASK).is_file() else None,
        normals=folder / found.normals_name if found.normals_name else None,
        layout="diligent",
        photographed=len(flash),
    )
