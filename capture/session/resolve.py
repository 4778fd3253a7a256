"""From the manifest's strings to files that exist, and to plain values that fit together."""

import difflib
import glob
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from capture.session.globs import expand, frame_names, kind_of, slashed
from capture.session.resolve_camera import resolve_camera
from capture.session.session_types import Encoding, Session, SphereSpec
from formats.light_files.light_formats import SUFFIXES as LIGHTS_SUFFIXES
from formats.meshes.scan_files import SUFFIXES as SCAN_SUFFIXES
from formats.normal_maps import SUFFIXES as NORMALS_SUFFIXES
from scene.reading import listed, shortened

if TYPE_CHECKING:
    from capture.session.manifest import FramesTable, Manifest, ObjectTable, SphereTable


class Resolver:
    """Turns the manifest's strings into paths that exist; collects what is wrong instead of stopping."""

    def __init__(self, folder: Path, faults: list[str]) -> None:
        self.folder = folder
        self.faults = faults

    def fault(self, key: str, text: str) -> None:
        self.faults.append(f"{key}: {text}")

    def session(self, manifest: "Manifest") -> Session | None:
        """Return the session that is meant; None where there are faults."""
        frames, known = manifest.frames, manifest.object
        self.check_name(manifest.name)
        flash = self.photographs("frames.flash", frames.flash)
        others = {
            key: tuple(self.photographs(f"frames.{key}", getattr(frames, key) or [], like=flash))
            for key in ("ambient", "dark", "flat")
        }
        for key, files in others.items():
            for file in (file for file in files if file in flash):
                text = f'{file.name} is also among frames.flash. Narrow frames.flash, as in "flash_*.dng".'
                self.fault(f"frames.{key}", text)
        kept, names = self.kept(flash, frames.skip), frame_names(flash)
        if known.picks and not known.scan:
            text = 'picks are points of a scan, and there is none. Add scan = "...", or drop it.'
            self.fault("object.picks", text)
        lights = manifest.lights and self.file("lights.file", manifest.lights.file, LIGHTS_SUFFIXES)
        session = Session(
            name=manifest.name or self.folder.name,
            folder=self.folder,
            flash=tuple(flash[i] for i in kept),
            names=tuple(names[i] for i in kept),
            kept=tuple(kept),
            ambient=others["ambient"],
            dark=others["dark"],
            flat=others["flat"],
            encoding=self.encoding(frames, flash),
            encoding_stated=frames.linear is not None or frames.gamma is not None,
            half=frames.half,
            skip=tuple(frames.skip),
            camera=resolve_camera(self, manifest.camera),
            spheres=tuple(self.sphere(f"spheres[{i}]", entry, flash, kept) for i, entry in enumerate(manifest.spheres)),
            no_spheres="spheres" in manifest.model_fields_set and not manifest.spheres,
            lights_file=lights or None,
            mask=self.file("object.mask", known.mask),
            box=tuple(known.box) if known.box else None,
            scan=self.file("object.scan", known.scan, SCAN_SUFFIXES),
            scan_unit=self.scan_unit(known),
            scan_ball_diameter_mm=known.scan_ball_diameter_mm,
            normals=self.file("object.normals", known.normals, NORMALS_SUFFIXES),
            picks=self.file("object.picks", known.picks),
            photographed=len(flash),
        )
        return None if self.faults else session

    def check_name(self, name: str | None) -> None:
        """A name that is a path would put the output folder, which is called after it, anywhere."""
        if name is not None and (
            not name.strip(" .") or len(name) > 100 or not name.isprintable() or set(name) & set("/\\:")
        ):
            self.fault(
                "name",
                f'found "{shortened(name)}". It becomes a folder\'s name: give a short word without / \\ : that is not '
                "only dots.",
            )

    @staticmethod
    def scan_unit(known: "ObjectTable") -> str:
        """Return the unit that is written; else the metres that GLB's standard asks for, else millimetres."""
        if "scan_unit" in known.model_fields_set or not (known.scan or "").lower().endswith(".glb"):
            return known.scan_unit
        return "m"

    def file(self, key: str, name: str | None, suffixes: tuple[str, ...] = ()) -> Path | None:
        if name is None:
            return None
        path = self.folder / name
        if not path.is_file():
            self.fault(key, f"there is no file {path}. {self.instead(name, path, suffixes)}")
        elif suffixes and path.suffix.lower() not in suffixes:
            text = f"{path.name} cannot be read, its kind is unknown. Give one of {', '.join(suffixes)}."
            self.fault(key, text)
        return path

    def instead(self, name: str, path: Path, suffixes: tuple[str, ...]) -> str:
        """Say which file may have been meant by one that is not there."""
        if slashed(name) != name:
            return f'Write / between folders, also on Windows: "{slashed(name)}".'
        place = path if path.is_dir() else path.parent
        names = [other.name for other in sorted(place.iterdir()) if other.is_file()] if place.is_dir() else []
        fitting = [other for other in names if Path(other).suffix.lower() in suffixes]
        if path.is_dir():
            return f"It is a folder. Give a file{f', as {name}/{fitting[0]}' if fitting else ''}."
        near = _meant(path.name, names)
        if near:
            return near
        elsewhere = [other for other in self.folder.glob(f"*/{glob.escape(path.name)}") if other.is_file()]
        if elsewhere:
            return f"Did you mean {elsewhere[0].relative_to(self.folder).as_posix()}?"
        if not place.is_dir():
            return f"The folder {place} does not exist. Correct the name."
        return f"Correct the name{f': {listed(fitting)} is there' if fitting else ''}."

    def photographs(self, key: str, patterns: list[str], *, like: list[Path] | None = None) -> list[Path]:
        """Return the files of one key: all of one kind, the kind of `like`."""
        files, faults = expand(patterns, self.folder)
        self.faults += [f"{key}: {fault}" for fault in faults]
        kinds: dict[str | None, list[Path]] = {}
        for file in files:
            kinds.setdefault(kind_of(file), []).append(file)
        for file in kinds.pop(None, []):
            self.fault(key, f"{file.name} is no photograph that can be read. Narrow the glob.")
        if len(kinds) > 1:
            counts = " and ".join(f"{len(found)} {found[0].suffix}" for found in kinds.values())
            self.fault(key, f"matches {counts} files. Name files of one kind, the RAW ones if there are any.")
        elif kinds and like and next(iter(kinds)) != kind_of(like[0]):
            self.fault(
                key,
                f"{files[0].name} is of another kind than the flash frames ({like[0].name}). Their values cannot be "
                "compared: give files of the same kind.",
            )
        return files

    def kept(self, flash: list[Path], skip: list[str]) -> list[int]:
        """Return the places of the flash frames that are not skipped."""
        names, dropped = frame_names(flash), set()
        for entry in skip if flash else ():
            found = [i for i, path in enumerate(flash) if entry in (names[i], path.stem, path.name)]
            dropped.update(found)
            if not found:
                do = _meant(entry, names) or "Drop it from the list."
                self.fault("frames.skip", f'"{entry}" is none of the {len(flash)} flash frames. {do}')
        if flash and len(dropped) == len(flash):
            self.fault("frames.skip", f"leaves none of the {len(flash)} flash frames.")
        return [i for i in range(len(flash)) if i not in dropped]

    def encoding(self, frames: "FramesTable", flash: list[Path]) -> Encoding:
        if frames.linear is True and frames.gamma not in (None, 1.0):
            self.fault("frames.gamma", f"found {frames.gamma} beside linear = true. Keep one of them.")
        coded = frames.linear is False or frames.gamma not in (None, 1.0)
        if coded and flash and kind_of(flash[0]) in ("raw", "exr"):
            key = "frames.gamma" if frames.gamma else "frames.linear"
            self.fault(key, f"{flash[0].suffix} files are linear by themselves. Drop the key.")
        if flash and flash[0].suffix.lower() in (".jpg", ".jpeg") and frames.linear is None and frames.gamma is None:
            # Taken as linear by default they would cost some ten degrees; nearly all of them are not.
            self.fault(
                "frames.linear",
                f"missing, and {flash[0].name} is a JPEG. Write linear = false (as cameras write them: sRGB), "
                "gamma = 2.2, or linear = true if they really are.",
            )
        if frames.gamma is not None:
            return "linear" if frames.gamma == 1.0 else frames.gamma
        return "srgb" if frames.linear is False else "linear"

    def sphere(self, key: str, table: "SphereTable", flash: list[Path], kept: list[int]) -> SphereSpec:
        if (table.center_px is None) != (table.radius_px is None):
            absent = "center_px" if table.center_px is None else "radius_px"
            self.fault(f"{key}.{absent}", "missing. center_px and radius_px go together.")
        files = [] if table.frames is None else self.photographs(f"{key}.frames", table.frames, like=flash)
        if files and len(files) != len(flash):
            self.fault(
                f"{key}.frames",
                f"matches {len(files)} files, frames.flash {len(flash)}. A ball that was shot apart needs one frame "
                "for each flash frame, in the same order.",
            )
            files = []
        center = None if table.center_px is None else (table.center_px[0], table.center_px[1])
        mask, own = self.file(f"{key}.mask", table.mask), tuple(files[i] for i in kept) if files else ()
        return SphereSpec(table.kind, table.diameter_mm, center, table.radius_px, mask, own)


def _meant(name: str, names: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(names), n=1)
    return f"Did you mean {near[0]}?" if near else ""
