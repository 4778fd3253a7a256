"""A session folder: what was photographed, and which file is what.

`session.toml` (DESIGN.md, "The session folder"), or a folder in the DiLiGenT layout. Nothing is decoded here.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scene.camera import Camera
from scene.errors import SessionError
from scene.reading import reading, shortened

LONGEST = 1 << 20
"""Bytes of a session.toml."""
MOST_FAULTS = 100
"""That are told at once."""


@dataclass(frozen=True)
class Charuco:
    """Photographs of a ChArUco board, to calibrate the camera from."""

    files: tuple[Path, ...]
    squares: tuple[int, int]
    square_mm: float
    marker_mm: float
    dictionary: str


@dataclass(frozen=True)
class SphereSpec:
    """One `[[spheres]]` entry, resolved. `frames`: the ball's own photographs, one for each of `Session.flash`."""

    kind: Literal["chrome", "white"]
    diameter_mm: float | None = None
    center_px: tuple[float, float] | None = None
    radius_px: float | None = None
    mask: Path | None = None
    frames: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Session:
    """What a session folder says; every path absolute and there.

    Parameters
    ----------
    flash : tuple of Path
        One light per frame, those under `frames.skip` left out.
    names : tuple of str
        The flash frames' names, unique.
    kept : tuple of int
        Place of each flash frame among all that `frames.flash` matches: a lights file counts those of the
        skipped frames too.
    encoding : "linear", "srgb" or float
        How 8 and 16-bit files are coded; a number is a gamma.
    encoding_stated : bool
        False: nothing was said, and linear is assumed.
    half : bool
        2 x 2 superpixels.
    camera : Camera, Charuco or None
    lights_file : Path or None
        Known lights instead of balls. DiLiGenT: light_directions.txt, its intensities beside it.
    mask, scan, normals : Path or None
        The object's mask, its laser scan, its ground truth that is already registered.
    picks : Path or None
        Points of the scan whose pixels are known: a start for its registration.
    scan_ball_diameter_mm : float or None
        Of a calibration ball that was scanned beside the object.
    layout : "toml" or "diligent"
    photographed : int
        How many files `frames.flash` matches, those of skipped frames included.
    """

    name: str
    folder: Path
    flash: tuple[Path, ...]
    names: tuple[str, ...]
    kept: tuple[int, ...]
    ambient: tuple[Path, ...] = ()
    dark: tuple[Path, ...] = ()
    flat: tuple[Path, ...] = ()
    encoding: Literal["linear", "srgb"] | float = "linear"
    encoding_stated: bool = True
    half: bool = False
    skip: tuple[str, ...] = ()
    camera: Camera | Charuco | None = None
    spheres: tuple[SphereSpec, ...] = ()
    lights_file: Path | None = None
    mask: Path | None = None
    scan: Path | None = None
    scan_unit: str = "mm"
    scan_ball_diameter_mm: float | None = None
    normals: Path | None = None
    picks: Path | None = None
    layout: Literal["toml", "diligent"] = "toml"
    photographed: int = 0


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
        if (path / "filenames.txt").is_file() or (path / "light_directions.txt").is_file():
            from capture.session.diligent_session import load_diligent

            return load_diligent(path)
    raise SessionError(
        f"{path}: holds neither session.toml nor a DiLiGenT layout (filenames.txt, light_directions.txt, ...). "
        'Write session.toml; the least is two lines: [frames] and flash = "raw/flash_*.dng".'
    )


def _load_toml(path: Path) -> Session:
    from capture.session.manifest import parse
    from capture.session.resolve import Resolver

    with reading(path, "is not TOML in UTF-8", SessionError, do="Correct that line."):
        if path.stat().st_size > LONGEST:
            raise ValueError(f"{path.stat().st_size} bytes; a session takes some hundreds, {LONGEST} are the most")
        data = tomllib.loads(path.read_text("utf-8-sig"))
    with reading(path, "cannot be followed", SessionError, do="Correct it, or the files that it names."):
        manifest, faults = parse(data)
        session = Resolver(path.parent, faults).session(manifest) if manifest else None
    if faults or session is None:
        raise faults_error(path, faults)
    return session


def faults_error(path: Path, faults: list[str]) -> SessionError:
    """Return one error that tells all faults of a file or folder."""
    if len(faults) == 1:
        return SessionError(f"{path}: {shortened(faults[0], 600)}")
    told = [shortened(fault, 600) for fault in faults[:MOST_FAULTS]]
    more = [f"and {len(faults) - MOST_FAULTS} more"] if len(faults) > MOST_FAULTS else []
    return SessionError(f"{path}: {len(faults)} faults.\n" + "\n".join(f"  {fault}" for fault in (*told, *more)))
