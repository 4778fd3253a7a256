"""A shoot under way: each new photograph judged with all before it, by the rooms that judge the whole session."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.mask.object_mask import find_object
from capture.audit.audit import blown_warnings, movement_warnings
from capture.audit.camera_settings import exposure_by_room, exposure_gains, gaps_in_numbering, mixed_settings
from capture.audit.focus import focus_warnings
from capture.audit.missing_flashes import doubles, misfires
from capture.audit.part_movement import part_warnings, parts_of
from capture.photographs.kept import KeptStack
from capture.photographs.photograph import SATURATION
from capture.session.globs import frame_names
from capture.session.session_types import CaptureSession
from capture.survey.small_pictures import frames_of
from scene.errors import CaptureError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from shoot.init.answers import Asking
from shoot.plan.shoot_plan import next_flash
from shoot.plan.under_way import under_way
from shoot.watch.lights_so_far import LightsSoFar
from shoot.watch.taken import Shot, mean_codes, sort_shots
from solve.solve import solve

LOOKED_BACK = 12
"""The newest frames: among them a movement is sought, and a lost focus; what happened before was told before."""
FEWEST = 8
"""Frames from which on a movement is sought, and said what is no frame's own: among fewer, light that moves looks like
it."""
TOLD_BY = 3
"""Flashes that tell a normal."""
FIRST, AGAIN = 4, 2
"""Frames with which the object is first looked for; how many times as many there are when it is looked for again."""
PIXELS = 4000
"""Of the object whose normals are looked at, at most, evenly over the picture."""


class Shoot:
    """The photographs taken so far and what is known by them.

    Parameters
    ----------
    folder : Path
    asking : Asking
        What `init` is told of camera and balls; silent.
    """

    def __init__(self, folder: Path, asking: Asking) -> None:
        self.folder = folder
        self._told: set[str] = set()
        self._shots: list[Shot] = []
        self.roles: dict[str, list[Shot]] = {"flash": [], "ambient": []}
        self.left_out: dict[str, str] = {}
        """By digest, what was said of photographs that are no flash frames."""
        self.lights_so_far = LightsSoFar(asking)
        self.frames: Frames | None = None
        self.newest: Shot | None = None
        """The flash frame that came last."""
        self._mask, self._looked_with = None, 0
        self.next_flash: dict[str, Any] | None = None
        self.sigma_deg: NDArray[np.float64] | None = None
        """(h, w), of each normal along one tangent axis, noise and the lights' own; NaN off the object."""
        self.why = "balls are looked for from the 4th flash frame on"
        """Why nothing is known of lights or normals."""

    @property
    def flash(self) -> list[Shot]:
        """The flash frames, in the session's order."""
        return self.roles["flash"]

    @property
    def lights(self) -> Lights | None:
        """The lights so far."""
        found = self.lights_so_far.found
        return found.lights if found else None

    def judge(self, shots: Sequence[Shot]) -> list[str]:
        """Say of the photographs that stand there what is seen at a glance; return what was not said before.

        Did the flash fire, exposure, clipping, the same light twice, the numbering. `follow` says the rest.
        """
        known, self._shots = {shot.digest for shot in self._shots}, list(shots)
        self.roles, self.left_out = sort_shots(shots, self.folder)
        said = [f"{shot.path.stem}: {self.left_out[shot.digest]}" for shot in shots if shot.digest in self.left_out]
        new = [shot for shot in self.flash if shot.digest not in known]
        self.frames, self.newest = None, new[-1] if new else None
        if not self.flash:
            return self.new(said)
        names, dim = tuple(frame_names([shot.path for shot in self.flash])), self._ambient_small()
        exif, ambient = [shot.exif for shot in self.flash], self.roles["ambient"]
        facts = [shot.facts for shot in self.flash]
        gain, _ = exposure_gains(exif, [shot.exif for shot in ambient])
        pictures = np.stack([fact.small * factor for fact, factor in zip(facts, gain, strict=True)])
        by_room, told = exposure_by_room(names, pictures, dim)
        self.frames = self._full_size(names, gain * by_room)
        light = pictures * by_room[:, None, None] - (0 if dim is None else dim)
        paths = tuple(shot.path for shot in self.flash)
        dims = tuple(shot.path for shot in ambient)
        session = CaptureSession(self.folder.name, self.folder, paths, names, tuple(range(len(names))), ambient=dims)
        said += [*told, *mixed_settings(session, exif, [shot.exif for shot in ambient]), *gaps_in_numbering(session)]
        if len(names) > 2:
            try:
                said += misfires(names, light, dim)
            except CaptureError as error:
                said += str(error).splitlines()
        return self.new([*said, *doubles(names, facts, light), *blown_warnings(names, facts)])

    def follow(self, frames: Frames, flash: Sequence[Shot], ambient: Sequence[Shot]) -> list[str]:
        """Bring lights and normals up to date, and say the rest of the photographs; see `judge`.

        It takes seconds, and may run in another thread than `judge`: of what that knows it is given a copy, and what it
        returns is to go through `new`. Lights are read from the reduced pictures: `process` reads them from the whole
        ones, and finer.
        """
        small = frames_of([shot.small for shot in flash], [shot.small for shot in ambient])
        small, step = replace(small, names=frames.names, gain=frames.gain), flash[0].small.step
        found = self.lights_so_far.found
        parts = parts_of(found.spheres, found.camera, step) if found and found.camera else []
        told = self.lights_so_far.renew(small, [shot.exif for shot in flash], step)
        if len(flash) < FEWEST:
            # Of so few, what is no frame's own is noise as often as not.
            told = [text for text in told if any(name in text for name in frames.names)]
        last = slice(-LOOKED_BACK, None)
        recent, facts = frames.only(last), [shot.facts for shot in flash[last]]
        moved = movement_warnings(recent, facts) if len(facts) >= FEWEST else []
        self._look_at_normals(small)
        return [*told, *focus_warnings(recent, facts), *(moved or part_warnings(recent, parts))]

    def role_of(self, shot: Shot) -> str:
        """Return a photograph's role: flash, ambient, dark, flat, board, chrome, white, or left out."""
        return next((role for role, shots in self.roles.items() if shot in shots), "left out")

    def light_of(self, shot: Shot) -> dict[str, Any] | None:
        """Return the row of `Lights.facts` of a photograph; None where its light is not known."""
        if self.frames is None or self.lights is None or shot not in self.flash:
            return None
        name = self.frames.names[self.flash.index(shot)]
        return next((row for row in self.lights.facts()["frames"] if row["name"] == name), None)

    def _ambient_small(self) -> NDArray | None:
        ambient = [shot.facts.small for shot in self.roles["ambient"]]
        return np.mean(ambient, 0) if ambient else None

    def _full_size(self, names: tuple[str, ...], gain: NDArray) -> Frames:
        """Return the frames, read from where each photograph is kept."""
        is_integer = self.flash[0].codes.dtype == np.uint16
        saturation = SATURATION * min(shot.facts.white for shot in self.flash) if is_integer else np.inf
        stack: NDArray = KeptStack([shot.codes for shot in self.flash])  # type: ignore[assignment]
        is_mosaic = any(shot.facts.is_mosaic for shot in self.flash)
        return Frames(names, stack, gain, mean_codes(self.roles["ambient"]), saturation, is_mosaic)

    def _look_at_normals(self, small: Frames) -> None:
        """Solve the object's normals, a few thousand of them, and find the flash that would help them most."""
        found = self.lights_so_far.found
        if found is None or found.camera is None:
            return
        some = small.only([i for i, name in enumerate(small.names) if name in found.lights.names])
        if len(some) < TOLD_BY:
            # Photographs were taken out of the folder.
            self.sigma_deg, self.why = None, f"{len(some)} flash frames are left, {TOLD_BY} tell a normal"
            return
        # Lights that could not be renewed have some of photographs that are gone.
        lights = found.lights.only([found.lights.names.index(name) for name in some.names])
        try:
            if len(some) >= max(FIRST, AGAIN * self._looked_with):
                self._looked_with = len(some)
                self._mask = find_object(some, found.camera, found.spheres).mask
            if self._mask is None:
                return
            step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(self._mask) / PIXELS))))
            thin, view, mask = some.every(step), found.camera.every(step), self._mask[::step, ::step]
            estimate = solve("iterative", thin, lights, view, mask)
            so_far = under_way(thin, view, lights, found.spheres, estimate, count=PIXELS)
            # The balls count in the pixels that were not thinned out.
            self.next_flash, sigma = next_flash(so_far, found.camera, lights)
        except SceneError as error:
            self.why = str(error)
            return
        self.sigma_deg = np.full(mask.shape, np.nan)
        self.sigma_deg[so_far.places[:, 1], so_far.places[:, 0]] = sigma

    def new(self, warnings: Iterable[str]) -> list[str]:
        """Return the warnings that were not given before: each once, also where its numbers change with every frame."""
        marks = sorted((shot.path.stem for shot in self._shots), key=len, reverse=True)
        found = []
        for text in warnings:
            key = warning_key(text, marks)
            if key not in self._told:
                self._told.add(key)
                found.append(text)
        return found


def warning_key(text: str, names: Sequence[str]) -> str:
    """Return what two warnings share that say the same of the same frames and balls; `names`: frames', longest first.

    Numbers count only in frames' names, which are no measurements, and in a ball's place, by which it is called.
    """
    named = [name for name in names if name in text]
    for name in named:
        text = text.replace(name, "\0")
    places = re.findall(r"at \(-?\d+, -?\d+\) px", text)
    return " ".join([re.sub(r"\d+(\.\d+)?", "#", text), *sorted(named), *places])
