"""A folder in the DiLiGenT layout as a session: 16-bit linear pictures, lights given, no `session.toml`."""

from pathlib import Path

from capture.session.globs import frame_names, kind_of
from capture.session.session import Session, faults_error
from scene.errors import SessionError
from scene.reading import text_of


def load_diligent(folder: Path) -> Session:
    """Return the session of a folder in the layout of the DiLiGenT benchmark [Shi2019].

    Raises
    ------
    SessionError
        Every file that is missing, and tables of another length than the list of frames.
    """
    faults: list[str] = []
    flash: list[Path] = []
    needed = ("filenames.txt", "light_directions.txt", "light_intensities.txt")
    faults += [
        f"{name}: missing. A DiLiGenT layout needs {', '.join(needed)}."
        for name in needed
        if not (folder / name).is_file()
    ]
    if (folder / "filenames.txt").is_file():
        names = [line.strip() for line in text_of(folder / "filenames.txt", error=SessionError).splitlines()]
        flash = [folder / name for name in names if name]
        faults += [f"filenames.txt: names {path.name}, which is not there." for path in flash if not path.is_file()]
        faults += [
            f"filenames.txt: {path.name} is no photograph that can be read." for path in flash if kind_of(path) is None
        ]
        if not flash:
            faults.append("filenames.txt: names no file.")
    for name in needed[1:]:
        if (folder / name).is_file():
            rows = [line for line in text_of(folder / name, error=SessionError).splitlines() if line.strip()]
            if len(rows) != len(flash):
                faults.append(f"{name}: has {len(rows)} rows, filenames.txt {len(flash)}. One row a frame.")
    if faults:
        raise faults_error(folder, faults)
    truth = [path for path in (folder / "Normal_gt.mat", folder / "normal.txt") if path.is_file()]
    return Session(
        name=folder.name,
        folder=folder,
        flash=tuple(flash),
        names=tuple(frame_names(flash)),
        kept=tuple(range(len(flash))),
        lights_file=folder / "light_directions.txt",
        mask=folder / "mask.png" if (folder / "mask.png").is_file() else None,
        normals=truth[0] if truth else None,
        layout="diligent",
        photographed=len(flash),
    )
