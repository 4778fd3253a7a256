"""From the manifest's strings to files that exist, and to plain values that fit together."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from capture.session.globs import expand, frame_names, kind_of, meant, near_name
from capture.session.manifest import FramesTable, Manifest, SessionCameraTable, SphereTable
from capture.session.session_types import CaptureSession, Encoding, SphereSpec
from formats.light_files.light_formats import SUFFIXES as LIGHTS_SUFFIXES
from formats.meshes.scan_files import SUFFIXES as SCAN_SUFFIXES
from formats.normal_maps import SUFFIXES as NORMALS_SUFFIXES
from scene.camera import Camera
from scene.reading import shortened

SENSOR = ("sensor_mm", "pixel_um", "crop_factor", "model")
BOARD = ("charuco", "chessboard", "board")
LENSES = 0.2, 1000.0
"""Focal lengths of lenses, in the picture's side."""
FEWEST_SQUARES = 4
"""Of a chessboard, each way."""


class Resolver:
    """Turns the manifest's strings into paths that exist; collects what is wrong instead of stopping."""

    def __init__(self, folder: Path, faults: list[str]) -> None:
        self.folder = folder
        self.faults = faults

    def session(self, manifest: Manifest) -> CaptureSession | None:
        """Return the session that is meant; None where there are faults."""
        frames, known = manifest.frames, manifest.object
        self._check_name(manifest.name)
        flash = self._photographs("frames.flash", frames.flash)
        ambient, dark, flat = (self._without_flash(key, frames, flash) for key in ("ambient", "dark", "flat"))
        kept, names = self._kept(flash, frames.skip), frame_names(flash)
        if known.picks and not known.scan:
            text = 'picks are points of a scan, and there is none. Add scan = "...", or drop it.'
            self._fault("object.picks", text)
        if known.box and not (known.box[0] < known.box[2] and known.box[1] < known.box[3]):
            self._fault(
                "object.box", f"found {known.box}; expected left, top, right, bottom: left < right, top < bottom."
            )
        # The metres that GLB's standard asks for.
        in_metres = (known.scan or "").lower().endswith(".glb") and "scan_unit" not in known.model_fields_set
        lights = manifest.lights and self._file("lights.file", manifest.lights.file, LIGHTS_SUFFIXES)
        session = CaptureSession(
            name=manifest.name or self.folder.name,
            folder=self.folder,
            flash=tuple(flash[i] for i in kept),
            names=tuple(names[i] for i in kept),
            kept=tuple(kept),
            ambient=ambient,
            dark=dark,
            flat=flat,
            chart=self._file("frames.chart", frames.chart, tuple({path.suffix.lower() for path in flash})),
            encoding=self._encoding(frames, flash),
            encoding_stated=frames.linear is not None or frames.gamma is not None,
            half=frames.half,
            skip=tuple(frames.skip),
            camera=self._camera(manifest.camera) if manifest.camera else None,
            board_shots=self._board(manifest.camera) if manifest.camera else (),
            spheres=tuple(self._ball(f"spheres[{i}]", ball, flash, kept) for i, ball in enumerate(manifest.spheres)),
            no_spheres="spheres" in manifest.model_fields_set and not manifest.spheres,
            lights_file=lights or None,
            mask=self._file("object.mask", known.mask),
            box=tuple(known.box) if known.box else None,
            scan=self._file("object.scan", known.scan, SCAN_SUFFIXES),
            scan_unit="m" if in_metres else known.scan_unit,
            scan_ball_diameter_mm=known.scan_ball_diameter_mm,
            normals=self._file("object.normals", known.normals, NORMALS_SUFFIXES),
            picks=self._file("object.picks", known.picks),
            tolerance_deg=known.tolerance_deg,
            series=(manifest.series.factor, manifest.series.value) if manifest.series else None,
            photographed=len(flash),
        )
        return None if self.faults else session

    def _fault(self, key: str, text: str) -> None:
        self.faults.append(f"{key}: {text}")

    def _check_name(self, name: str | None) -> None:
        """A name that is a path would put the output folder, which is called after it, anywhere."""
        if name is not None and (
            not name.strip(" .") or len(name) > 100 or not name.isprintable() or set(name) & set("/\\:")
        ):
            self._fault(
                "name",
                f'found "{shortened(name)}". It becomes a folder\'s name: give a short word without / \\ : that is not '
                "only dots.",
            )

    def _file(self, key: str, name: str | None, suffixes: tuple[str, ...] = ()) -> Path | None:
        if name is None:
            return None
        path = self.folder / name
        if not path.is_file():
            do = meant(name, self.folder, lambda one: not suffixes or one.suffix.lower() in suffixes)
            self._fault(key, f"there is no file {path}. {do}")
        elif suffixes and path.suffix.lower() not in suffixes:
            text = f"{path.name} cannot be read, its kind is unknown. Give one of {', '.join(suffixes)}."
            self._fault(key, text)
        return path

    def _photographs(self, key: str, patterns: list[str], *, like: list[Path] | None = None) -> list[Path]:
        """Return the files of one key: all of one kind, the kind of `like`."""
        files, faults = expand(patterns, self.folder)
        self.faults += [f"{key}: {fault}" for fault in faults]
        kinds: dict[str | None, list[Path]] = {}
        for file in files:
            kinds.setdefault(kind_of(file), []).append(file)
        for file in kinds.pop(None, []):
            self._fault(key, f"{file.name} is no photograph that can be read. Narrow the glob.")
        if len(kinds) > 1:
            counts = " and ".join(f"{len(found)} {found[0].suffix}" for found in kinds.values())
            self._fault(key, f"matches {counts} files. Name files of one kind, the RAW ones if there are any.")
        elif kinds and like and next(iter(kinds)) != kind_of(like[0]):
            self._fault(
                key,
                f"{files[0].name} is of another kind than the flash frames ({like[0].name}). Their values cannot be "
                "compared: give files of the same kind.",
            )
        return files

    def _without_flash(self, key: str, frames: FramesTable, flash: list[Path]) -> tuple[Path, ...]:
        """Return the photographs of a key of [frames]: of the flash frames' kind, and none of them."""
        files = self._photographs(f"frames.{key}", getattr(frames, key) or [], like=flash)
        for file in (file for file in files if file in flash):
            text = f'{file.name} is also among frames.flash. Narrow frames.flash, as in "flash_*.dng".'
            self._fault(f"frames.{key}", text)
        return tuple(files)

    def _kept(self, flash: list[Path], skip: list[str]) -> list[int]:
        """Return the places of the flash frames that are not skipped."""
        names, dropped = frame_names(flash), set()
        for entry in skip if flash else ():
            found = [i for i, path in enumerate(flash) if entry in (names[i], path.stem, path.name)]
            dropped.update(found)
            if not found:
                do = near_name(entry, names) or "Drop it from the list."
                self._fault("frames.skip", f'"{entry}" is none of the {len(flash)} flash frames. {do}')
        if flash and len(dropped) == len(flash):
            self._fault("frames.skip", f"leaves none of the {len(flash)} flash frames.")
        return [i for i in range(len(flash)) if i not in dropped]

    def _encoding(self, frames: FramesTable, flash: list[Path]) -> Encoding:
        if frames.linear is True and frames.gamma not in (None, 1.0):
            self._fault("frames.gamma", f"found {frames.gamma} beside linear = true. Keep one of them.")
        coded = frames.linear is False or frames.gamma not in (None, 1.0)
        if coded and flash and kind_of(flash[0]) in ("raw", "exr"):
            key = "frames.gamma" if frames.gamma else "frames.linear"
            self._fault(key, f"{flash[0].suffix} files are linear by themselves. Drop the key.")
        if flash and flash[0].suffix.lower() in (".jpg", ".jpeg") and frames.linear is None and frames.gamma is None:
            # Taken as linear by default they would cost some ten degrees; nearly all of them are not.
            self._fault(
                "frames.linear",
                f"missing, and {flash[0].name} is a JPEG. Write linear = false (as cameras write them: sRGB), "
                "gamma = 2.2, or linear = true if they really are.",
            )
        if frames.gamma is not None:
            return "linear" if frames.gamma == 1.0 else frames.gamma
        return "srgb" if frames.linear is False else "linear"

    def _ball(self, key: str, table: SphereTable, flash: list[Path], kept: list[int]) -> SphereSpec:
        self._check_together(key, table, "center_px", "radius_px")
        files = [] if table.frames is None else self._photographs(f"{key}.frames", table.frames, like=flash)
        if files and len(files) != len(flash):
            self._fault(
                f"{key}.frames",
                f"matches {len(files)} files, frames.flash {len(flash)}. A ball that was shot apart needs one frame "
                "for each flash frame, in the same order.",
            )
            files = []
        center = None if table.center_px is None else (table.center_px[0], table.center_px[1])
        mask, own = self._file(f"{key}.mask", table.mask), tuple(files[i] for i in kept) if files else ()
        if table.reflectance is not None and table.kind != "white":
            self._fault(f"{key}.reflectance", "found with a mirror. It is of white balls: drop it.")
        return SphereSpec(table.kind, table.diameter_mm, center, table.radius_px, mask, own, table.reflectance)

    def _check_together(self, key: str, table: SessionCameraTable | SphereTable, first: str, second: str) -> bool:
        """Return whether both of two keys are given; one alone is a fault."""
        absent = [name for name in (first, second) if getattr(table, name) is None]
        if len(absent) == 1:
            self._fault(f"{key}.{absent[0]}", f"missing. {first} and {second} go together: give both, or none.")
        return not absent

    def _camera(self, table: SessionCameraTable) -> Camera | SessionCameraTable | None:
        """Return what [camera] says: all of it, or a part; None where it says nothing, or contradicts itself."""
        given = _given(table)
        if set(BOARD) & set(given):
            return table
        sized, centred = (self._check_together("camera", table, *pair) for pair in (("width", "height"), ("cx", "cy")))
        self._check_focal(given)
        if not given:
            return None
        width, height, cx, cy = table.width or 0, table.height or 0, table.cx or 0.0, table.cy or 0.0
        if sized and centred and not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
            self._fault(
                "camera.cx, camera.cy",
                f"found {cx}, {cy}, outside of the image of {width} x {height} px. They are pixels from the centre of "
                "the upper left pixel; or are width and height those of another picture?",
            )
        distortion = tuple(table.distortion or [0.0] * 5)
        if not (sized and centred and table.fx):
            return table
        for key, focal, side in (("fx", table.fx, width), ("fy", table.fy or table.fx, height)):
            if not LENSES[0] <= focal / side <= LENSES[1]:
                self._fault(
                    f"camera.{key}",
                    f"found {focal:g} px for a picture of {side:g} px; lenses have 0.2 to 1000 times the picture. Give "
                    "the focal length in pixels, or focal_mm and sensor_mm.",
                )
                return None
        camera = Camera(width, height, table.fx, table.fy or table.fx, cx, cy, distortion)
        corners = [[u, v] for u in (0, camera.width - 1) for v in (0, camera.height - 1)]
        moved = np.abs(camera.project(replace(camera, distortion=(0.0,) * 5).rays(corners)[1]) - corners).max()
        if not moved <= max(camera.width, camera.height):
            self._fault(
                "camera.distortion",
                f"found {list(distortion)}, which moves a corner of the picture by {moved:.3g} px, beyond its size. "
                "Give OpenCV's k1 k2 p1 p2 k3.",
            )
        return camera

    def _check_focal(self, given: list[str]) -> None:
        """The focal length is said once, and a part of it is said wholly."""
        sensors = [name for name in SENSOR if name in given]
        if "fx" in given and (others := [name for name in ("focal_mm", *SENSOR) if name in given]):
            text = f"found fx beside {', '.join(others)}. Both tell the focal length: keep one of them."
            self._fault("camera", text)
        elif "fy" in given and "fx" not in given:
            self._fault("camera.fx", "missing. Where there is fy, give fx; where they are the same, fx alone.")
        if len(sensors) > 1:
            self._fault("camera", f"found {', '.join(sensors)}. Each tells the size of the sensor: keep one of them.")

    def _board(self, table: SessionCameraTable) -> tuple[Path, ...]:
        """Return the shots of the board that is to tell the camera, if one is."""
        others = [name for name in _given(table) if name not in BOARD]
        if len(others) == len(_given(table)):
            return ()
        if others:
            text = f"found {', '.join(others)} beside a board. Its shots give the whole camera: keep one of them."
            self._fault("camera.board", text)
        if table.charuco is not None and table.chessboard is not None:
            self._fault("camera.chessboard", "found beside charuco. Give the shots of one board.")
        plain, board = table.chessboard is not None, table.board
        shots, key = (table.chessboard, "camera.chessboard") if plain else (table.charuco, "camera.charuco")
        if shots is None or board is None:
            self._fault(
                key if shots is None else "camera.board",
                'missing. Give charuco = "charuco/*.dng" and board = { squares = [11, 8], square_mm = 15, '
                'marker_mm = 11, dictionary = "DICT_4X4_100" }, or chessboard = "board/*.dng" and board = '
                "{ squares = [11, 8] }.",
            )
            return ()
        files = tuple(self._photographs(key, shots))
        if plain and min(board.squares) < FEWEST_SQUARES:
            self._fault("camera.board.squares", f"found {board.squares}; a chessboard needs 4 or more each way.")
        text = "missing. A ChArUco board has it; a plain one is given as chessboard."
        for name in ("marker_mm", "dictionary"):
            if (getattr(board, name) is not None) == plain:
                text = "found beside chessboard, which has no markers. Drop it, or write charuco." if plain else text
                self._fault(f"camera.board.{name}", text)
        if board.marker_mm is not None and board.marker_mm >= board.square_mm:
            self._fault("camera.board", f"marker_mm {board.marker_mm} must be less than square_mm {board.square_mm}.")
        return files


def _given(table: SessionCameraTable) -> list[str]:
    return [name for name in type(table).model_fields if getattr(table, name) is not None]
