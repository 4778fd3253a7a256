"""The lights of a shoot under way: balls found now and then, all lights fitted together each time."""

from collections.abc import Sequence
from dataclasses import replace

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

    @property
    def balls(self) -> list[SphereTable] | None:
        """The balls as `init` writes them, without diameters; None where none is found."""
        return drafted([ball.sphere for ball in self._balls], self._step) if self._balls else None

    def renew(self, frames: Frames, exif: Sequence[Exif], step: int) -> list[str]:
        """Find the balls, now and then; fit all lights; return what is suspicious.

        A pixel of `frames` is `step` of the photographs' wide.
        """
        self._step, camera, told = step, self._camera(frames, exif, step), []
        if len(frames) >= max(FIRST, AGAIN * self._looked_with):
            self._looked_with = len(frames)
            try:
                found, _, _ = find_balls(frames, camera, [])
                if len(found) >= len(self._balls):
                    self._balls, told = self._with_diameters(found)
            except CalibrationError as error:
                # Those that are known already stay.
                told = [] if self._balls else [str(error)]
        while self._balls:
            seen = [i for i, name in enumerate(frames.names) if name not in self.unseen]
            try:
                self.found = self._lights(frames, camera, seen)
                return [*told, *self.found.warnings]
            except CalibrationError as error:
                told.append(str(error))
                lost = [frames.names[i] for i in seen if frames.names[i] in str(error)]
                # One frame that no ball shows is no reason to know nothing of the others.
                self.unseen.update(lost)
                if not 0 < len(lost) < len(seen):
                    break
        return told

    def _camera(self, frames: Frames, exif: Sequence[Exif], step: int) -> Camera:
        """Return the camera of the frames as it is known; one as most are where it is not."""
        width, height = step * frames.width, step * frames.height
        camera, _ = camera_from_lens(self._asking.answers.lens, exif, width, height)
        camera = usual_camera(width, height) if camera.is_orthographic else camera
        return camera.scaled(frames.width, frames.height, 1 / step, 1 / step)

    def _lights(self, frames: Frames, camera: Camera, seen: list[int]) -> Calibration:
        frames = frames.only(seen) if len(seen) < len(frames) else frames
        balls = [replace(ball, frames=frames) for ball in self._balls]

        def run(camera: Camera) -> Calibration:
            return lights_of_balls(frames, camera, balls)

        found = with_unknown_focal(run, camera) if camera.source == "assumed" else run(camera)
        return replace(found, camera=found.camera or camera)

    def _with_diameters(self, balls: Sequence[Ball]) -> tuple[list[Ball], list[str]]:
        ordered = sorted(balls, key=lambda ball: (ball.sphere.kind, -ball.sphere.radius_px))
        try:
            known = with_diameters(drafted([ball.sphere for ball in ordered], self._step), self._asking)
        except SceneError as error:
            return ordered, [str(error)]
        # `with_diameters` sorts by kind, and keeps the order within one, as this does.
        pairs = zip(ordered, known, strict=True)
        return [replace(a, sphere=replace(a.sphere, diameter_mm=b.diameter_mm)) for a, b in pairs], []
