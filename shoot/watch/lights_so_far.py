"""The lights of a shoot under way: balls found now and then; with each frame its highlights, and all lights anew."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibrate import lights_of_balls
from calibrate.calibration import Calibration
from calibrate.detection.balls import Ball, find_balls
from calibrate.unknown_focal import with_unknown_focal
from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import usual_camera
from capture.session.manifest import SphereTable
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames
from shoot.init.answers import Asking
from shoot.init.draft_balls import drafted, with_diameters

FIRST, AGAIN = 4, 3
"""Frames with which balls are first looked for; how many times as many there are when they are looked for again."""
NEWEST, REFIT = 8, 1.25
"""Frames that are fitted with each new one; how many times as many there are when all are fitted together again."""


class LightsSoFar:
    """What the balls say of the lights so far.

    Parameters
    ----------
    asking : Asking
        Silent: diameters and camera, as `init` is told them.
    """

    def __init__(self, asking: Asking) -> None:
        self._asking = asking
        self._balls: list[Ball] = []
        self._looked_with, self._fitted_with, self._step = 0, 0, 1
        self.unseen: set[str] = set()
        """Names of frames whose light no ball shows."""
        self.found: Calibration | None = None
        self.warnings: list[str] = []

    @property
    def balls(self) -> list[SphereTable] | None:
        """The balls as `init` writes them, without diameters; None where none is found."""
        return drafted([ball.sphere for ball in self._balls], self._step) if self._balls else None

    def is_due(self, count: int) -> bool:
        """Whether balls are to be looked for, with so many frames: it takes seconds."""
        return count >= max(FIRST, AGAIN * self._looked_with)

    def find_balls(self, frames: Frames, exif: Sequence[Exif], step: int) -> None:
        """Look for the balls; those that are known already stay where fewer are found.

        A pixel of `frames` is `step` of the photographs' wide.
        """
        self._looked_with, self._step = len(frames), step
        try:
            found, _, _ = find_balls(frames, self.camera(frames, exif, step), [])
        except CalibrationError as error:
            self.warnings = [] if self._balls else [str(error)]
            return
        if len(found) >= len(self._balls):
            self._balls = self._with_diameters(found)
            self.fit_all()

    def camera(self, frames: Frames, exif: Sequence[Exif], step: int) -> Camera:
        """Return the camera of the frames as it is known; one as most are where it is not."""
        width, height = step * frames.width, step * frames.height
        camera, _ = camera_from_lens(self._asking.answers.lens, exif, width, height)
        camera = usual_camera(width, height) if camera.is_orthographic else camera
        return camera.scaled(frames.width, frames.height, 1 / step, 1 / step)

    def update(self, frames: Frames, exif: Sequence[Exif], step: int) -> None:
        """Fit the lights of all frames now and then, of the newest between; see `find_balls`."""
        if not self._balls:
            return
        self.warnings = []
        seen = [i for i, name in enumerate(frames.names) if name not in self.unseen]
        try:
            found = self._with_newest(frames, seen)
            if found is None:
                found, self._fitted_with = self._lights(frames, self.camera(frames, exif, step), seen), len(seen)
            self.found = found
            self.warnings += found.warnings
        except CalibrationError as error:
            self.warnings.append(str(error))
            lost = [name for name in frames.names if name in str(error) and name not in self.unseen]
            if lost and len(lost) < len(seen):
                # One frame that no ball shows is no reason to know nothing of the others.
                self.unseen.update(lost)
                self.update(frames, exif, step)

    def fit_all(self) -> None:
        """Fit all frames together next: one has become another photograph."""
        self._fitted_with = 0

    def _with_newest(self, frames: Frames, seen: list[int]) -> Calibration | None:
        """Return the lights so far with those of the newest frames; None where all are to be fitted together."""
        if self.found is None or self.found.camera is None or len(seen) >= REFIT * self._fitted_with:
            return None
        try:
            newest = self._lights(frames, self.found.camera, seen[-NEWEST:])
        except CalibrationError:
            # So few may all lie in one plane, or show too little by themselves.
            return None
        return joined(self.found, newest, [frames.names[i] for i in seen])

    def _lights(self, frames: Frames, camera: Camera, seen: list[int]) -> Calibration:
        if len(seen) < len(frames):
            frames = frames.only(seen)
        balls = [replace(ball, frames=frames) for ball in self._balls]

        def run(camera: Camera) -> Calibration:
            return lights_of_balls(frames, camera, balls)

        found = with_unknown_focal(run, camera) if camera.source == "assumed" else run(camera)
        return replace(found, camera=found.camera or camera)

    def _with_diameters(self, balls: Sequence[Ball]) -> list[Ball]:
        ordered = sorted(balls, key=lambda ball: (ball.sphere.kind, -ball.sphere.radius_px))
        try:
            known = with_diameters(drafted([ball.sphere for ball in ordered], self._step), self._asking)
        except SceneError as error:
            self.warnings = [str(error)]
            return ordered
        # `with_diameters` sorts by kind, and keeps the order within one, as this does.
        return [
            replace(ball, sphere=replace(ball.sphere, diameter_mm=one.diameter_mm))
            for ball, one in zip(ordered, known, strict=True)
        ]


def joined(before: Calibration, newest: Calibration, names: Sequence[str]) -> Calibration | None:
    """Return `newest` with the lights of the other frames of `names` as they were before.

    None where that cannot be: a frame is in neither, none is in both, or one has near lights, the other distant ones.
    """
    old, new = before.lights, newest.lights
    both = [name for name in old.names if name in new.names]
    if not both or old.model != new.model or not set(names) <= {*old.names, *new.names}:
        return None
    # Intensities are relative to the mean of the frames that were fitted together.
    scale = np.mean([old.intensities[old.names.index(n)] / new.intensities[new.names.index(n)] for n in both], 0)
    new = replace(new, intensities=scale * new.intensities)
    place = {name: (lights, i) for lights in (old, new) for i, name in enumerate(lights.names)}
    rows = [place[name] for name in names]

    def of(field: str) -> NDArray[np.float64]:
        return np.stack([getattr(lights, field)[i] for lights, i in rows])

    lights = replace(
        new,
        names=tuple(names),
        directions=of("directions"),
        intensities=of("intensities"),
        positions_mm=None if new.positions_mm is None else of("positions_mm"),
        direction_sigma_deg=of("direction_sigma_deg"),
        intensity_sigma=of("intensity_sigma"),
        flags=tuple(lights.flags[i] for lights, i in rows),
    )
    return replace(newest, lights=lights.normalised())
