"""The lights of a shoot under way: balls found now and then; with each frame its highlights, and all lights anew."""

from collections.abc import Sequence
from dataclasses import replace

from calibrate.calibrate import lights_of_balls
from calibrate.calibration import Calibration
from calibrate.detection.balls import Ball, find_balls
from calibrate.unknown_focal import with_unknown_focal
from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import usual_camera
from lab.init.answers import Asking
from lab.init.draft import DraftBall
from lab.init.draft_balls import drafted, with_diameters
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames

FIRST, AGAIN = 4, 3
"""Frames with which balls are first looked for; how many times as many there are when they are looked for again."""


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
        self._looked_with, self._step = 0, 1
        self.unseen: set[str] = set()
        """Names of frames whose light no ball shows."""
        self.found: Calibration | None = None
        self.warnings: list[str] = []

    @property
    def balls(self) -> list[DraftBall] | None:
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

    def camera(self, frames: Frames, exif: Sequence[Exif], step: int) -> Camera:
        """Return the camera of the frames as it is known; one as most are where it is not."""
        width, height = step * frames.width, step * frames.height
        camera, _ = camera_from_lens(self._asking.answers.lens, exif, width, height)
        camera = usual_camera(width, height) if camera.is_orthographic else camera
        return camera.scaled(frames.width, frames.height, 1 / step, 1 / step)

    def update(self, frames: Frames, exif: Sequence[Exif], step: int) -> None:
        """Fit the lights of all frames so far; see `find_balls`."""
        if not self._balls:
            return
        self.warnings = []
        seen = [i for i, name in enumerate(frames.names) if name not in self.unseen]
        try:
            self.found = self._lights(frames, self.camera(frames, exif, step), seen)
            self.warnings += self.found.warnings
        except CalibrationError as error:
            self.warnings.append(str(error))
            lost = [name for name in frames.names if name in str(error) and name not in self.unseen]
            if lost and len(lost) < len(seen):
                # One frame that no ball shows is no reason to know nothing of the others.
                self.unseen.update(lost)
                self.update(frames, exif, step)

    def _lights(self, frames: Frames, camera: Camera, seen: list[int]) -> Calibration:
        if len(seen) < len(frames):
            names = tuple(frames.names[i] for i in seen)
            frames = replace(frames, names=names, codes=frames.codes[seen], gain=frames.gain[seen])
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
