"""What is wrong with the frames so far: the audit of a capture, part by part, as far as it is known by now."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.audit.audit import blown_warnings, movement_warnings
from capture.audit.camera_settings import exposure_by_room, exposure_gains, gaps_in_numbering, mixed_settings
from capture.audit.focus import focus_warnings
from capture.audit.frame_facts import reduced
from capture.audit.missing_flashes import doubles, misfires
from capture.audit.part_movement import Part, part_warnings
from capture.photographs.kept import KeptStack
from capture.photographs.photograph import SATURATION
from capture.session.globs import frame_names
from capture.session.session_types import Session
from scene.errors import CaptureError
from scene.frames import Frames
from shoot.watch.shots import Shot, mean_codes

LOOKED_BACK = 12
"""The newest frames: among them a movement is sought, and a lost focus; what happened before was told before."""

FEWEST = 8
"""Frames from which on a movement is sought: among fewer, light that moves looks like it."""


class FramesSoFar:
    """The flash frames of a shoot as `Frames`, and what speaks against them.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ambient: tuple[tuple[str, ...], NDArray | None, NDArray | None] = ((), None, None)

    def frames(self, flash: list[Shot], ambient: list[Shot]) -> tuple[Frames, list[str]]:
        """Return the frames, full size, read from where each photograph is kept; and what their exposures say."""
        digests = tuple(shot.digest for shot in ambient)
        if digests != self._ambient[0]:
            mean = mean_codes(ambient)
            self._ambient = (digests, mean, None if mean is None else reduced(mean))
        _, codes, small = self._ambient
        names = tuple(frame_names([shot.path for shot in flash]))
        gain, _ = exposure_gains([shot.exif for shot in flash], [shot.exif for shot in ambient])
        pictures = np.stack([shot.facts.small * factor for shot, factor in zip(flash, gain, strict=True)])
        by_room, told = exposure_by_room(names, pictures, small)
        is_integer = flash[0].codes.dtype == np.uint16
        saturation = SATURATION * min(shot.facts.white for shot in flash) if is_integer else np.inf
        is_mosaic = any(shot.facts.is_mosaic for shot in flash)
        stack: NDArray = KeptStack([shot.codes for shot in flash])  # type: ignore[assignment]
        return Frames(names, stack, gain * by_room, codes, saturation, is_mosaic), told

    def warnings(self, frames: Frames, flash: list[Shot], ambient: list[Shot]) -> list[str]:
        """Return what the audit says of the frames so far by their reduced pictures and their settings."""
        facts = [shot.facts for shot in flash]
        light = np.stack([fact.small * factor for fact, factor in zip(facts, frames.gain, strict=True)])
        dim = self._ambient[2]
        if dim is not None:
            light -= dim
        session = Session(
            self.folder.name,
            self.folder,
            tuple(shot.path for shot in flash),
            frames.names,
            tuple(range(len(flash))),
            ambient=tuple(shot.path for shot in ambient),
        )
        exif = [shot.exif for shot in flash]
        told = mixed_settings(session, exif, [shot.exif for shot in ambient])
        told += gaps_in_numbering(session)
        if len(flash) > 2:
            try:
                told += misfires(frames.names, light, dim)
            except CaptureError as error:
                told += str(error).splitlines()
        told += doubles(frames.names, facts, light)
        told += blown_warnings(frames.names, facts)
        return told

    @staticmethod
    def late_warnings(frames: Frames, flash: list[Shot], parts: list[Part]) -> list[str]:
        """Return what takes a second to find in the newest frames: a lost focus, a movement of all, or of `parts`."""
        last = slice(-LOOKED_BACK, None)
        recent, facts = frames.only(last), [shot.facts for shot in flash[last]]
        moved = movement_warnings(recent, facts) if len(facts) >= FEWEST else []
        return [*focus_warnings(recent, facts), *(moved or part_warnings(recent, parts))]


class Told:
    """Warnings that were given already: each is told once, also where its numbers change with every frame."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def new(self, warnings: Iterable[str], names: Iterable[str] = ()) -> list[str]:
        """Return the warnings that were not given before; `names`: the frames', whose numbers are no measurements."""
        marks = sorted(names, key=len, reverse=True)
        found = []
        for text in warnings:
            key = self._key(text, marks)
            if key not in self._known:
                self._known.add(key)
                found.append(text)
        return found

    @staticmethod
    def _key(text: str, marks: list[str]) -> str:
        named = [name for name in marks if name in text]
        for name in named:
            text = text.replace(name, "\0")
        # A ball is called by its place.
        places = re.findall(r"at \(-?\d+, -?\d+\) px", text)
        return " ".join([re.sub(r"\d+(\.\d+)?", "#", text), *sorted(named), *places])
