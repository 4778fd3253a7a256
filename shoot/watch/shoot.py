"""A shoot under way: each new photograph judged with all before it, by the rooms that judge the whole session."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.mask.object_mask import find_object
from calibrate.calibrate import lights_of_balls
from calibrate.calibration import Calibration
from calibrate.detection.balls import Ball, find_balls
from calibrate.unknown_focal import with_unknown_focal
from capture.audit.audit import at_a_glance, movement_warnings
from capture.audit.focus import focus_warnings
from capture.audit.part_movement import part_warnings
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import usual_camera
from capture.photographs.kept import KeptStack
from capture.photographs.photograph import SATURATION
from capture.session.globs import frame_names
from capture.session.manifest import SessionCameraTable, SphereTable
from capture.session.session_types import CaptureSession
from capture.survey.small_pictures import frames_of
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from shoot.init.answers import Asking
from shoot.init.prepare import diameters_of, drafted
from shoot.plan.shoot_plan import TOLD_BY, next_flash
from shoot.plan.under_way import under_way
from shoot.watch.taken import Shot, sort_shots
from solve.solve import solve

LOOKED_BACK = 12
"""The newest frames: among them a movement is sought, and a lost focus; what happened before was told before."""
FEWEST = 8
"""Frames from which on a movement is sought, and said what is no frame's own: among fewer, light that moves looks like
it."""
FIRST, BALLS_AGAIN, OBJECT_AGAIN = 4, 3, 2
"""Frames with which balls and object are first looked for; how many times as many there are when they are again."""
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
        self.folder, self._asking = folder, asking
        self._told: set[str] = set()
        self._shots: list[Shot] = []
        self.roles: dict[str, list[Shot]] = {"flash": [], "ambient": []}
        self.left_out: dict[str, str] = {}
        """By digest, what was said of photographs that are no flash frames."""
        self.frames: Frames | None = None
        self.newest: Shot | None = None
        """The flash frame that came last."""
        self._balls: list[Ball] = []
        self._step, self._balls_with, self._object_with = 1, 0, 0
        self._unseen: set[str] = set()
        """Names of frames whose light no ball shows."""
        self._found: Calibration | None = None
        self._mask: NDArray[np.bool_] | None = None
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
        return self._found.lights if self._found else None

    @property
    def balls(self) -> list[SphereTable] | None:
        """The balls as `init` writes them, without diameters; None where none is found."""
        return drafted([ball.sphere for ball in self._balls], self._step) if self._balls else None

    def judge(self, shots: Sequence[Shot]) -> list[str]:
        """Say of the photographs that stand there what is seen at a glance; return what was not said before.

        Did the flash fire, exposure, clipping, the same light twice. `follow` says the rest.
        """
        known, self._shots = {shot.digest for shot in self._shots}, list(shots)
        self.roles, self.left_out = sort_shots(shots, self.folder)
        said = [f"{shot.path.stem}: {self.left_out[shot.digest]}" for shot in shots if shot.digest in self.left_out]
        new = [shot for shot in self.flash if shot.digest not in known]
        self.frames, self.newest = None, new[-1] if new else None
        if not self.flash:
            return self.new(said)
        paths, ambient = tuple(shot.path for shot in self.flash), self.roles["ambient"]
        names, dims = tuple(frame_names(list(paths))), tuple(shot.path for shot in ambient)
        exif, ambient_exif = [shot.exif for shot in self.flash], [shot.exif for shot in ambient]
        dim = np.mean([shot.facts.small for shot in ambient], 0) if ambient else None
        session = CaptureSession(self.folder.name, self.folder, paths, names, tuple(range(len(names))), ambient=dims)
        facts = [shot.facts for shot in self.flash]
        gain, missing, told = at_a_glance(session, exif, ambient_exif, facts, dim)
        self.frames = self._full_size(names, gain)
        return self.new([*said, *(missing if len(names) > 2 else ()), *told])

    def follow(self, frames: Frames, flash: Sequence[Shot], ambient: Sequence[Shot]) -> list[str]:
        """Bring lights and normals up to date, and say the rest of the photographs; see `judge`.

        It takes seconds, and may run in another thread than `judge`: of what that knows it is given a copy, and what it
        returns is to go through `new`. Lights are read from the reduced pictures: `process` reads them from the whole
        ones, and finer.
        """
        small = frames_of([shot.small for shot in flash], [shot.small for shot in ambient])
        small, found = replace(small, names=frames.names, gain=frames.gain), self._found
        self._step = flash[0].small.step
        balls = found.spheres if found else []
        told = self._renew_lights(small, self._camera(small, flash))
        if len(flash) < FEWEST:
            # Of so few, what is no frame's own is noise as often as not.
            told = [text for text in told if named_in(text, frames.names)]
        last = slice(-LOOKED_BACK, None)
        recent, facts = frames.only(last), [shot.facts for shot in flash[last]]
        moved = movement_warnings(recent, facts) if len(facts) >= FEWEST else []
        self._look_at_normals(small)
        return [*told, *focus_warnings(recent, facts), *(moved or part_warnings(recent, balls, self._step))]

    def role_of(self, shot: Shot) -> str:
        """Return a photograph's role: flash, ambient, dark, flat, board, chrome, white, or left out."""
        return next((role for role, shots in self.roles.items() if shot in shots), "left out")

    def light_of(self, shot: Shot) -> dict[str, Any] | None:
        """Return the row of `Lights.facts` of a photograph; None where its light is not known."""
        if self.frames is None or self.lights is None or shot not in self.flash:
            return None
        name = self.frames.names[self.flash.index(shot)]
        return next((row for row in self.lights.facts()["frames"] if row["name"] == name), None)

    def _full_size(self, names: tuple[str, ...], gain: NDArray) -> Frames:
        """Return the frames, read from where each photograph is kept."""
        is_integer = self.flash[0].codes.dtype == np.uint16
        saturation = SATURATION * min(shot.facts.white for shot in self.flash) if is_integer else np.inf
        stack: NDArray = KeptStack([shot.codes for shot in self.flash])  # type: ignore[assignment]
        is_mosaic = any(shot.facts.is_mosaic for shot in self.flash)
        dims = [shot.codes for shot in self.roles["ambient"]]
        dim = next(iter(dims), None)
        if len(dims) > 1:
            mean = np.mean(dims, 0, np.float32)
            dim = (np.round(mean) if is_integer else mean).astype(dims[0].dtype)
        return Frames(names, stack, gain, dim, saturation, is_mosaic)

    def _camera(self, small: Frames, flash: Sequence[Shot]) -> Camera:
        """Return the camera of the small frames as it is known; one as most are where it is not."""
        width, height = self._step * small.width, self._step * small.height
        lens = SessionCameraTable(**self._asking.answers.camera)
        camera, _ = camera_from_lens(lens, [shot.exif for shot in flash], width, height)
        camera = usual_camera(width, height) if camera.is_orthographic else camera
        return camera.scaled(small.width, small.height, 1 / self._step, 1 / self._step)

    def _renew_lights(self, frames: Frames, camera: Camera) -> list[str]:
        """Find the balls, now and then; fit all lights together; return what is suspicious."""
        told: list[str] = []
        if len(frames) >= max(FIRST, BALLS_AGAIN * self._balls_with):
            self._balls_with = len(frames)
            try:
                balls, _, _ = find_balls(frames, camera, [])
                if len(balls) >= len(self._balls):
                    # As `drafted` sorts them.
                    self._balls = sorted(balls, key=lambda ball: (ball.sphere.kind, -ball.sphere.radius_px))
                    known = diameters_of(self.balls or (), self._asking)
                    self._balls = [
                        replace(ball, sphere=replace(ball.sphere, diameter_mm=mm))
                        for ball, mm in zip(self._balls, known, strict=True)
                    ]
            except CalibrationError as error:
                # Those that are known already stay.
                told = [] if self._balls else [str(error)]
            except SceneError as error:
                told = [str(error)]
        while self._balls:
            seen = [i for i, name in enumerate(frames.names) if name not in self._unseen]
            some = frames.only(seen) if len(seen) < len(frames) else frames
            run = partial(lights_of_balls, some, balls=[replace(ball, frames=some) for ball in self._balls])
            try:
                found = with_unknown_focal(run, camera) if camera.source == "assumed" else run(camera)
                self._found = replace(found, camera=found.camera or camera)
                return [*told, *found.warnings]
            except CalibrationError as error:
                told.append(str(error))
                lost = named_in(str(error), some.names)
                # One frame that no ball shows is no reason to know nothing of the others.
                self._unseen.update(lost)
                if not 0 < len(lost) < len(seen):
                    break
        return told

    def _look_at_normals(self, small: Frames) -> None:
        """Solve the object's normals, a few thousand of them, and find the flash that would help them most."""
        found = self._found
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
            if len(some) >= max(FIRST, OBJECT_AGAIN * self._object_with):
                self._object_with = len(some)
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


def named_in(text: str, names: Iterable[str]) -> list[str]:
    """Return the frames that a text names; flash_3 is not named by flash_30."""
    return [name for name in names if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text)]


def warning_key(text: str, names: Sequence[str]) -> str:
    """Return what two warnings share that say the same of the same frames and balls; `names`: frames', longest first.

    Numbers count only in frames' names, which are no measurements, and in a ball's place, by which it is called.
    """
    named = named_in(text, names)
    for name in named:
        text = text.replace(name, "\0")
    places = re.findall(r"at \(-?\d+, -?\d+\) px", text)
    return " ".join([re.sub(r"\d+(\.\d+)?", "#", text), *sorted(named), *places])
