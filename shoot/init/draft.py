"""A session.toml that is not written yet: the document itself, and what was seen of the folder that speaks for it.

In words: its commented text, what was found, what is missing and assumed.
"""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.session.globs import expand
from capture.session.manifest import TABLES, Manifest, SessionCameraTable, SphereTable
from capture.session.manifest_file import table_of
from formats.toml_documents import toml_text
from scene.camera import Camera
from scene.current import fingerprint
from scene.frames import Frames
from scene.length_units import UNITS_MM, Unit
from scene.reading import shortened
from scene.spheres import KINDS
from shoot.init.answers import Asking

FOCAL = ("fx", "focal_mm", "sensor_mm", "pixel_um", "crop_factor", "model")
LIKELY_UNITS: tuple[Unit, ...] = ("mm", "cm", "m", "inch")
FACTOR = 1.5
"""By which the object's size in the picture may differ from the scan's: parts are hidden, or were not scanned."""
SIGNED = "# As rgbn wrote it: "
"""What stands before the fingerprint of all that is above: a file in which nothing was changed is written anew."""
BESIDE = ("frames", "spheres", "object.scan_unit")
"""Keys beside which stands what was found; beside others, what they are for."""


def unit_by_size(diagonal: float, size_mm: float | None) -> Unit | None:
    """Return the unit under which a scan is as large as the object looks; None where none or two are.

    A picture shows two of the scan's three sides, so the scan's diagonal is 1 to 1.2 times the picture's.
    """
    if size_mm is None:
        return None
    off = {unit: abs(float(np.log(UNITS_MM[unit] * diagonal / (1.1 * size_mm)))) for unit in LIKELY_UNITS}
    first, second = sorted(LIKELY_UNITS, key=lambda unit: off[unit])[:2]
    return first if off[first] < np.log(FACTOR) < off[second] else None


@dataclass(frozen=True, eq=False)
class Draft:
    """A session's document before it is written, and what was seen of its folder.

    Parameters
    ----------
    manifest : Manifest
        Each ball of the frames with its circle.
    width, height : int
        Of the photographs, pixels.
    small, step : Frames, int
        The flash frames, reduced: pixels of a photograph in one of theirs, along a side.
    exif : tuple of Exif
        The flash frames'.
    scan_told : str
        The scan's size and unit, and how that is known.
    notes : tuple of str
        What was assumed and what was left out as the folder was looked at: a sentence each.
    """

    manifest: Manifest
    folder: Path
    width: int
    height: int
    small: Frames
    step: int
    exif: tuple[Exif, ...] = ()
    scan_told: str = ""
    notes: tuple[str, ...] = ()

    def noting(self, *notes: str) -> "Draft":
        """Return the draft with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def saying(self, table: str, **keys: Any) -> "Draft":
        """Return the draft with other keys in a table of its manifest; None takes a key away.

        Raises SessionError: a value that session.toml may not have.
        """
        was = getattr(self.manifest, table)
        data = (was.model_dump(exclude_unset=True) if was else {}) | keys
        data = {key: value for key, value in data.items() if value is not None}
        new = table_of(table, data) if data or table in ("frames", "object") else None
        return replace(self, manifest=self.manifest.model_copy(update={table: new}))

    def with_balls(self, balls: Sequence[SphereTable]) -> "Draft":
        """Return the draft with other balls."""
        return replace(self, manifest=self.manifest.model_copy(update={"spheres": list(balls)}))

    @cached_property
    def photographs(self) -> dict[str, list[Path]]:
        """The photographs by what they are used for."""
        frames, camera = self.manifest.frames, self.manifest.camera
        globs = {role: getattr(frames, role) for role in ("flash", "ambient", "dark", "flat")}
        globs["board"] = camera and (camera.charuco or camera.chessboard)
        return {role: expand(patterns, self.folder)[0] for role, patterns in globs.items() if patterns}

    @cached_property
    def camera(self) -> tuple[Camera | None, str]:
        """The photographs' camera, None where it is not known yet, and how its focal length is known.

        Raises SessionError: the lens is known in a part that does not tell the camera.
        """
        table = self.manifest.camera
        if table and table.board:
            kind = "chessboard" if table.chessboard else "ChArUco board"
            across = " x ".join(map(str, table.board.squares))
            return None, f"{len(self.photographs['board'])} shots of a {kind} of {across} squares"
        lens = table.model_dump(include=set(FOCAL), exclude_none=True) if table else {}
        camera, told = camera_from_lens(SessionCameraTable(**lens), self.exif, self.width, self.height)
        if camera.is_orthographic:
            return None, "not known: no EXIF, no board. It is sought by the balls; or give focal_mm and sensor_mm."
        words = told[0].removeprefix("camera: ").partition(". ")[0] if told else f"focal length {camera.fx:.0f} px"
        return camera, words

    @property
    def written(self) -> Manifest:
        """What session.toml is to say: without the circles that are found again.

        Of balls of several diameters it is known which has which: all of that kind have their circles.
        """
        balls = self.manifest.spheres
        mixed = {kind for kind in KINDS if len({one.diameter_mm for one in balls if one.kind == kind}) > 1}
        bare = {"center_px": None, "radius_px": None}
        spheres = [one if one.kind in mixed else one.model_copy(update=bare) for one in balls]
        written = self.with_balls(spheres).manifest
        if not spheres:
            # An empty list would say that no ball is to be looked for.
            written.model_fields_set.discard("spheres")
        return written

    def with_unit(self, vertices: NDArray, across_px: float | None, asking: Asking) -> "Draft":
        """Return the draft with its scan's unit: as it is said now, else as the picture tells, else as it was said.

        `vertices` (V, 3), of the file; `across_px`: the object's diagonal in the picture, None where it was not found.
        """
        balls = self.manifest.spheres
        scales = [one.diameter_mm / (2 * one.radius_px) for one in balls if one.diameter_mm and one.radius_px]
        looks_mm = across_px * float(np.median(scales)) if scales and across_px else None
        sides = np.ptp(vertices, axis=0)
        likely = unit_by_size(float(np.linalg.norm(sides)), looks_mm)
        unit: Unit = asking.answers.unit or likely or asking.said("unit") or "unknown"
        size = " x ".join(f"{UNITS_MM[unit] * side:.4g}" for side in sides)
        told = f"{len(vertices):,} vertices, {size} {'of its unit' if unit == 'unknown' else 'mm'}; unit {unit}"
        notes = ["the scan's unit is not known: give it (--unit), or a ball's diameter."] * (unit == "unknown")
        if likely == unit:
            told += f": the object looks {looks_mm:.0f} mm large"
        elif likely:
            notes.append(
                f"the scan is {told}, but the object looks {looks_mm:.0f} mm large in the picture, as with unit "
                f"{likely}. Check the unit, and the balls' diameters."
            )
        return replace(self, scan_told=told).saying("object", scan_unit=unit).noting(*notes)


def session_text(draft: Draft) -> str:
    """Return the text of session.toml, with what is assumed or missing above its tables."""
    head = [f"# Written by rgbn init on {date.today().isoformat()}. Correct what is wrong; rgbn only reads it."]
    for told in (f"camera: {draft.camera[1]}", *notes_of(draft)):
        # Names of files are as long as they like.
        head += textwrap.wrap(shortened(told, 1000), 112, initial_indent="# - ", subsequent_indent="#   ")
    tables, comments = _tables(draft.written), {}
    for table, keys in tables.items():
        for key in keys if isinstance(keys, dict) else ():
            said = TABLES[table].model_fields[key].description or ""
            comments[f"{table}.{key}"] = said.split(". ")[0].rstrip(".")
    comments |= {path: text for path, text in facts_of(draft) if path.startswith(BESIDE)}
    return "\n".join([*head, toml_text(tables, comments)])


def signed(text: str) -> str:
    """Return the text of a session.toml with the line by which `is_unedited` knows it."""
    return f"{text}\n{SIGNED}{fingerprint(text)[:12]}\n"


def is_unedited(text: str) -> bool:
    """Whether nobody changed what `signed` returned."""
    above, mark, _ = text.rpartition(f"\n{SIGNED}")
    return bool(mark) and text == signed(above)


def _tables(manifest: Manifest) -> dict[str, Any]:
    """Return the document as it is written: what was said, a glob alone without brackets."""

    def told(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: told(part) for key, part in value.items()}
        if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
            return value[0]
        return [told(part) for part in value] if isinstance(value, list) else value

    tables = told(manifest.model_dump(exclude_unset=True, exclude_none=True))
    return {key: value for key, value in tables.items() if value != {}}


def facts_of(draft: Draft) -> Iterator[tuple[str, str]]:
    """Yield what was found and how it is known, each with the key of session.toml that says it."""
    manifest = draft.manifest
    for role, files in draft.photographs.items():
        shown = files[0].name if len(files) == 1 else f"{files[0].name} to {files[-1].name}"
        size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
        yield f"camera.{role}" if role == "board" else f"frames.{role}", f"{len(files)}: {shown}{size}"
    yield "camera", draft.camera[1]
    for number, ball in enumerate(manifest.spheres):
        known = f"{ball.diameter_mm:.4g} mm" if ball.diameter_mm else "diameter_mm not known"
        place = "in its own photographs, in the flash frames' order"
        if ball.center_px:
            place = "found at ({:.0f}, {:.0f}) px, radius {:.0f} px".format(*ball.center_px, ball.radius_px)
        yield f"spheres[{number}]", f"{ball.kind}, {known}; {place}"
    for table, key in (("lights", "file"), ("object", "mask"), ("object", "scan"), ("object", "normals")):
        if name := getattr(getattr(manifest, table), key, None):
            yield f"{table}.{key}", name
    if manifest.object.scan:
        yield "object.scan_unit", draft.scan_told


def notes_of(draft: Draft) -> Iterator[str]:
    """Yield what a person is to know, a sentence each: what may still be told, what is done without it, and `notes`."""
    manifest, known = draft.manifest, draft.manifest.object
    balls = manifest.spheres
    if not manifest.lights and not balls:
        yield (
            "there is no ball and no light file: there are no lights, and only ldr, entropy and tv can solve. Mark the "
            "balls in the picture, in rgbn studio; or add [[spheres]] with center_px and radius_px."
        )
    for kind in KINDS:
        own = [ball for ball in balls if ball.kind == kind]
        if balls and not manifest.lights and not own:
            yield f"no {kind} ball" + ("; so lights have no positions." if kind == "chrome" else ".")
        if any(ball.diameter_mm is None for ball in own):
            told = f"{kind} ball{'s' * (len(own) > 1)}"
            yield f"the diameter of the {told} is not known: lights get directions, but no positions."
    if manifest.lights:
        yield f"lights are read from {manifest.lights.file}; balls are not needed."
    if not manifest.frames.ambient:
        yield "there is no ambient frame (flash off, same exposure): the room must have been dark."
    if manifest.frames.linear is False:
        suffix = draft.photographs["flash"][0].suffix
        yield f"{suffix} values are taken as sRGB-encoded, as cameras write them; else say --linear."
    if not known.scan and not known.normals:
        yield "there is no scan: no ground truth, no twin."
    yield from draft.notes
