"""The lights of a shoot under way, fitted from where they stood: balls found now and then, the newest lights anew."""

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

    @property
    def balls(self) -> list[SphereTable] | None:
        """The balls as `init` writes them, without diameters; None where none is found."""
        return drafted([ball.sphere for ball in self._balls], self._step) if self._balls else None

    def fit_all(self) -> None:
        """Fit all frames together next: a photograph is gone, or has become another."""
        self._fitted_with = 0

    def renew(self, frames: Frames, exif: Sequence[Exif], step: int) -> list[str]:
        """Find the balls, now and then; fit all lights now and then, the newest between; return what is suspicious.

        A pixel of `frames` is `step` of the photographs' wide.
        """
        self._step, camera, told = step, self._camera(frames, exif, step), []
        if len(frames) >= max(FIRST, AGAIN * self._looked_with):
            self._looked_with = len(frames)
            try:
                found, _, _ = find_balls(frames, camera, [])
                if len(found) >= len(self._balls):
                    self._balls, told = self._with_diameters(found)
                    self.fit_all()
            except CalibrationError as error:
                # Those that are known already stay.
                told = [] if self._balls else [str(error)]
        while self._balls:
            seen = [i for i, name in enumerate(frames.names) if name not in self.unseen]
            try:
                joint = self._with_newest(frames, seen)
                if joint is None:
                    joint, self._fitted_with = self._lights(frames, camera, seen), len(seen)
                self.found = joint
                return [*told, *joint.warnings]
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

    per_frame = ["directions", "intensities", "direction_sigma_deg", "intensity_sigma"]
    per_frame += [] if new.positions_mm is None else ["positions_mm"]
    flags = tuple(lights.flags[i] for lights, i in rows)
    lights = replace(new, names=tuple(names), flags=flags, **{field: of(field) for field in per_frame})
    return replace(newest, lights=lights.normalised())
