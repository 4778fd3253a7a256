"""A folder in the DiLiGenT layout as a session: 16-bit linear pictures, lights given, no `session.toml`."""

from pathlib import Path

from capture.session.globs import frame_names, kind_of
from capture.session.session import Session, faults_error
from formats.diligent_layout import DIRECTIONS, FILENAMES, MASK, read_tables


def load_diligent(folder: Path) -> Session:
    """Return the session of a folder in the layout of the DiLiGenT benchmark [Shi2019].

    Raises
    ------
    SessionError
        Every file that is missing or cannot be read, and tables of another length than the list of frames.
    """
    found = read_tables(folder)
    flash = [folder / name for name in found.listed]
    faults = found.faults + [
        f"{FILENAMES}: {path.name} is no photograph that can be read." for path in flash if kind_of(path) is None
    ]
    if faults:
        raise faults_error(folder, faults)
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
