"""Which session and which output folder a path means: an output folder remembers its session in session.json."""

import os
from contextlib import suppress
from pathlib import Path

from capture.session.session import load_session
from capture.session.session_types import CaptureSession
from lab.progress import say
from scene.errors import SceneError, SessionError
from scene.files import write_json
from scene.light_text import DIRECTIONS, FILENAMES
from scene.origin import Origin
from scene.output_folder import own_folder
from scene.reading import json_of, reading
from scene.record import Record

SESSION = "session.json"
"""Of an output folder: `session`, where its session lies, and `relative`, the same from the output folder."""
MANIFEST = "session.toml"


def session_and_out(path: Path, out: Path | None = None) -> tuple[Path, Path]:
    """Return where the session lies and which the output folder is.

    Parameters
    ----------
    path : Path
        A session's folder, its session.toml, or an output folder: then its own session.
    out : Path or None
        Output folder as it was given. Default: that of `path`, or `default_out`.

    Returns
    -------
    session, out : Path
        The first absolute.

    Raises
    ------
    SceneError
        The session cannot be read or is no longer where the output folder says; `path` and `out` are two output
        folders.
    """
    if not is_output(path):
        if out is None:
            session = load_session(path)
            out = default_out(origin_of(session, path), session.name)
        return path.resolve(), out
    if out is not None and out.resolve() != path.resolve():
        raise SceneError(
            f"--out {out}: {path} is an output folder itself, and what is made goes there. Leave --out away; or give "
            "the session in its place to write elsewhere."
        )
    return session_of(path), path


def origin_of(session: "CaptureSession", path: Path) -> "Origin":
    """Return what a session's output folder is made from; `path` as `session_and_out` has it."""
    return Origin("session", (path.parent if path.name == MANIFEST else path).resolve(), session.flash)


def default_out(origin: "Origin", name: str, folder: Path | None = None) -> Path:
    """Return out/NAME here; beside the session's folder for a session that is worked on from inside of it.

    Where that belongs to another session, it is NAME-2 and so on, with a line that says so. `folder` takes the place of
    `out`.
    """
    if folder is None:
        own = origin.place.parent if origin.place.is_file() else origin.place
        folder = (own.parent if Path.cwd().resolve().is_relative_to(own) else Path()) / "out"
    usual = folder / name
    out = own_folder(usual, origin)
    if out != usual:
        say(f"{usual} belongs to another session; the results of {origin.place} go to {out}")
    return out


def is_output(path: Path) -> bool:
    """Whether a folder is the output of a verb on a session; a rendered twin is a session of its own."""
    return not (path / MANIFEST).is_file() and (
        (path / SESSION).is_file() or (path / "frames" / "frames.json").is_file()
    )


def is_session(path: Path) -> bool:
    """Whether a path is a session's: its .toml, or a folder with session.toml or in the DiLiGenT layout."""
    return path.is_file() or any((path / name).is_file() for name in (MANIFEST, FILENAMES, DIRECTIONS))


def session_of(folder: Path) -> Path:
    """Return where the session of an output folder lies: as seen from the folder, else where it lay.

    Raises SessionError: the folder does not name its session, or that is at neither place.
    """
    cure = f"Give the session and this folder: rgbn VERB SESSION --out {folder}."
    if not (folder / SESSION).is_file():
        raise SessionError(f"{folder}: does not say which session it was made from (no {SESSION}). {cure}")
    said = json_of(folder / SESSION, error=SessionError, do=cure)
    with reading(folder / SESSION, "does not name a session", SessionError, do=cure):
        places = [(folder.resolve() / said["relative"]).resolve(), Path(said["session"])]
        found = [place for place in places if is_session(place)]
    if not found:
        looked = " nor at ".join(dict.fromkeys(map(str, places)))
        raise SessionError(f"{folder}: its session is no longer where it was: not at {looked}. {cure}")
    return found[0]


def note_session(record: "Record", session: Path) -> None:
    """Write session.json into an output folder that is held, unless it says the same already."""
    place = session.parent if session.name == MANIFEST else session
    told = {"session": str(place), "relative": os.path.relpath(place, record.folder)}
    path = record.folder / SESSION
    with suppress(SceneError):
        if path.is_file() and json_of(path) == told:
            return
    write_json(path, told)
