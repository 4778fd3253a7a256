"""A session folder: what was photographed, and which file is what.

`session.toml` (DESIGN.md, "The session folder"), or a folder in the DiLiGenT layout. Nothing is decoded here.
"""

import difflib
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from capture.globs import expand, frame_names, kind_of
from scene.camera import Camera
from scene.errors import SessionError

if TYPE_CHECKING:
    from capture.manifest import CameraTable, FramesTable, Manifest, SphereTable


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
    layout : "toml" or "diligent"
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
    normals: Path | None = None
    layout: Literal["toml", "diligent"] = "toml"


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
    path = Path(path).resolve()
    if not path.exists():
        raise SessionError(f"{path}: there is no such session. Give the folder that holds session.toml.")
    if path.is_file():
        return _load_toml(path)
    if (path / "session.toml").is_file():
        return _load_toml(path / "session.toml")
    if (path / "filenames.txt").is_file() or (path / "light_directions.txt").is_file():
        return _load_diligent(path)
    raise SessionError(
        f"{path}: holds neither session.toml nor a DiLiGenT layout (filenames.txt, light_directions.txt, ...). "
        'Write session.toml; the least is two lines: [frames] and flash = "raw/flash_*.dng".'
    )


def _load_toml(path: Path) -> Session:
    from capture.manifest import parse

    try:
        data = tomllib.loads(path.read_text("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SessionError(f"{path}: is not TOML in UTF-8: {error}. Correct that line.") from error
    except OSError as error:
        raise SessionError(f"{path}: cannot be read ({error.strerror}).") from error
    manifest, faults = parse(data)
    session = _Resolver(path.parent, faults).session(manifest) if manifest else None
    if faults or session is None:
        raise _error(path, faults)
    return session


def _error(path: Path, faults: list[str]) -> SessionError:
    if len(faults) == 1:
        return SessionError(f"{path}: {faults[0]}")
    return SessionError(f"{path}: {len(faults)} faults.\n" + "\n".join(f"  {fault}" for fault in faults))


class _Resolver:
    """Turns the manifest's strings into paths that exist; collects what is wrong instead of stopping."""

    def __init__(self, folder: Path, faults: list[str]) -> None:
        self.folder = folder
        self.faults = faults

    def session(self, manifest: "Manifest") -> Session | None:
        frames, known = manifest.frames, manifest.object
        flash = self.photographs("frames.flash", frames.flash)
        others = {
            key: self.photographs(f"frames.{key}", getattr(frames, key) or [], like=flash)
            for key in ("ambient", "dark", "flat")
        }
        for key, files in others.items():
            for file in files:
                if file in flash:
                    self.faults.append(
                        f"frames.{key}: {file.name} is also among frames.flash. Narrow frames.flash, "
                        'as in "flash_*.dng".'
                    )
        kept = self.kept(flash, frames.skip)
        lights = manifest.lights and self.file(
            "lights.file", manifest.lights.file, (".lp", ".txt", ".json", ".dome", ".mat")
        )
        session = Session(
            name=manifest.name or self.folder.name,
            folder=self.folder,
            flash=tuple(flash[i] for i in kept),
            names=tuple(frame_names(flash)[i] for i in kept),
            kept=tuple(kept),
            ambient=tuple(others["ambient"]),
            dark=tuple(others["dark"]),
            flat=tuple(others["flat"]),
            encoding=self.encoding(frames, flash),
            encoding_stated=frames.linear is not None or frames.gamma is not None,
            half=frames.half,
            skip=tuple(frames.skip),
            camera=self.camera(manifest.camera),
            spheres=tuple(self.sphere(f"spheres[{i}]", entry, flash, kept) for i, entry in enumerate(manifest.spheres)),
            lights_file=lights or None,
            mask=self.file("object.mask", known.mask),
            scan=self.file("object.scan", known.scan),
            scan_unit=known.scan_unit,
            normals=self.file("object.normals", known.normals),
        )
        return None if self.faults else session

    def file(self, key: str, name: str | None, suffixes: tuple[str, ...] = ()) -> Path | None:
        if name is None:
            return None
        path = self.folder / name
        if not path.is_file():
            near = path.parent.is_dir() and difflib.get_close_matches(
                path.name, [other.name for other in path.parent.iterdir()], n=1
            )
            self.faults.append(
                f"{key}: there is no file {path}. " + (f"Did you mean {near[0]}?" if near else "Correct the name.")
            )
        elif suffixes and path.suffix.lower() not in suffixes:
            self.faults.append(f"{key}: found {path.name}; known are {', '.join(suffixes)}.")
        return path

    def photographs(self, key: str, patterns: list[str], *, like: list[Path] | None = None) -> list[Path]:
        """Return the files of one key: all of one kind, the kind of `like`."""
        files, faults = expand(patterns, self.folder)
        self.faults += [f"{key}: {fault}" for fault in faults]
        kinds: dict[str | None, list[Path]] = {}
        for file in files:
            kinds.setdefault(kind_of(file), []).append(file)
        for file in kinds.pop(None, []):
            self.faults.append(f"{key}: {file.name} is no photograph that can be read. Narrow the glob.")
        if len(kinds) > 1:
            counts = " and ".join(f"{len(found)} {found[0].suffix}" for found in kinds.values())
            self.faults.append(f"{key}: matches {counts} files. Name files of one kind, the RAW ones if there are any.")
        elif kinds and like:
            kind = next(iter(kinds))
            if kind != kind_of(like[0]):
                self.faults.append(
                    f"{key}: {files[0].name} is of another kind than the flash frames ({like[0].name}). "
                    "Their values cannot be compared: give files of the same kind."
                )
        return files

    def kept(self, flash: list[Path], skip: list[str]) -> list[int]:
        if not flash:
            return []
        names = frame_names(flash)
        dropped = set()
        for entry in skip:
            found = [i for i, path in enumerate(flash) if entry in (names[i], path.stem, path.name)]
            dropped.update(found)
            if not found:
                near = difflib.get_close_matches(entry, names, n=1)
                self.faults.append(
                    f'frames.skip: "{entry}" is none of the {len(flash)} flash frames. '
                    + (f"Did you mean {near[0]}?" if near else "Drop it from the list.")
                )
        if len(dropped) == len(flash):
            self.faults.append(f"frames.skip: leaves none of the {len(flash)} flash frames.")
        return [i for i in range(len(flash)) if i not in dropped]

    def encoding(self, frames: "FramesTable", flash: list[Path]) -> Literal["linear", "srgb"] | float:
        if frames.linear is True and frames.gamma not in (None, 1.0):
            self.faults.append(f"frames.gamma: found {frames.gamma} beside linear = true. Keep one of them.")
        coded = frames.linear is False or frames.gamma not in (None, 1.0)
        if coded and flash and kind_of(flash[0]) in ("raw", "exr"):
            key = "frames.gamma" if frames.gamma else "frames.linear"
            self.faults.append(f"{key}: {flash[0].suffix} files are linear by themselves. Drop the key.")
        if frames.gamma is not None:
            return "linear" if frames.gamma == 1.0 else frames.gamma
        return "srgb" if frames.linear is False else "linear"

    def camera(self, table: "CameraTable | None") -> Camera | Charuco | None:
        if table is None:
            return None
        numbers = ("width", "height", "fx", "fy", "cx", "cy")
        given = [name for name in numbers if getattr(table, name) is not None]
        if table.charuco is not None or table.board is not None:
            return self.charuco(table, given)
        if len(given) < len(numbers):
            missing = [name for name in numbers if name not in given]
            self.faults.append(
                f"camera: incomplete, without {', '.join(missing)}. Give all of {', '.join(numbers)}, "
                "or charuco and board, or drop [camera]: it is then read from EXIF."
            )
            return None
        width, height, fx, fy, cx, cy = (getattr(table, name) for name in numbers)
        if not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
            self.faults.append(
                f"camera.cx, camera.cy: found {cx}, {cy}, outside of the image of {width} x {height} px. "
                "They are pixels from the centre of the upper left pixel."
            )
        return Camera(width, height, fx, fy, cx, cy, tuple(table.distortion or [0.0] * 5))

    def charuco(self, table: "CameraTable", given: list[str]) -> Charuco | None:
        if given or table.distortion is not None:
            self.faults.append(
                f"camera: found {', '.join(given) or 'distortion'} beside charuco. The board's shots give the whole "
                "camera: keep one of them."
            )
        if table.charuco is None or table.board is None:
            absent = "charuco" if table.charuco is None else "board"
            self.faults.append(
                f'camera.{absent}: missing. Give charuco = "charuco/*.dng" and board = {{ squares = [11, 8], '
                'square_mm = 15, marker_mm = 11, dictionary = "DICT_4X4_100" }.'
            )
            return None
        files = self.photographs("camera.charuco", table.charuco)
        board = table.board
        if board.marker_mm >= board.square_mm:
            self.faults.append(
                f"camera.board: marker_mm {board.marker_mm} must be less than square_mm {board.square_mm}."
            )
        return Charuco(
            tuple(files), (board.squares[0], board.squares[1]), board.square_mm, board.marker_mm, board.dictionary
        )

    def sphere(self, key: str, table: "SphereTable", flash: list[Path], kept: list[int]) -> SphereSpec:
        if (table.center_px is None) != (table.radius_px is None):
            absent = "center_px" if table.center_px is None else "radius_px"
            self.faults.append(f"{key}.{absent}: missing. center_px and radius_px go together.")
        files: list[Path] = []
        if table.frames is not None:
            files = self.photographs(f"{key}.frames", table.frames, like=flash)
            if files and len(files) != len(flash):
                self.faults.append(
                    f"{key}.frames: matches {len(files)} files, frames.flash {len(flash)}. A ball that was shot apart "
                    "needs one frame for each flash frame, in the same order."
                )
                files = []
        return SphereSpec(
            table.kind,
            table.diameter_mm,
            None if table.center_px is None else (table.center_px[0], table.center_px[1]),
            table.radius_px,
            self.file(f"{key}.mask", table.mask),
            tuple(files[i] for i in kept) if files else (),
        )


def _load_diligent(folder: Path) -> Session:
    """Read a folder in the layout of the DiLiGenT benchmark [Shi2019]: 16-bit linear files, lights given."""
    faults: list[str] = []
    flash: list[Path] = []
    needed = ("filenames.txt", "light_directions.txt", "light_intensities.txt")
    faults += [
        f"{name}: missing. A DiLiGenT layout needs {', '.join(needed)}."
        for name in needed
        if not (folder / name).is_file()
    ]
    if (folder / "filenames.txt").is_file():
        names = [line.strip() for line in (folder / "filenames.txt").read_text("utf-8-sig").splitlines()]
        flash = [folder / name for name in names if name]
        faults += [f"filenames.txt: names {path.name}, which is not there." for path in flash if not path.is_file()]
        faults += [
            f"filenames.txt: {path.name} is no photograph that can be read." for path in flash if kind_of(path) is None
        ]
        if not flash:
            faults.append("filenames.txt: names no file.")
    for name in needed[1:]:
        if (folder / name).is_file():
            rows = [line for line in (folder / name).read_text("utf-8-sig").splitlines() if line.strip()]
            if len(rows) != len(flash):
                faults.append(f"{name}: has {len(rows)} rows, filenames.txt {len(flash)}. One row a frame.")
    if faults:
        raise _error(folder, faults)
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
    )
