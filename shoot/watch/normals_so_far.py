"""How well the object's normals are known by the flashes so far, and which flash would help most."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from scene.spheres import Sphere
from shoot.plan.flash_places import Reach
from shoot.plan.shoot_plan import plan_shoot
from shoot.plan.under_way import under_way

Array = NDArray[np.float64]
FIRST, AGAIN = 4, 2
"""Frames with which the object is first looked for; how many times as many there are when it is looked for again."""
PIXELS = 4000
"""Of the object that are looked at, at most, evenly over the picture."""


@dataclass(frozen=True)
class NextFlash:
    """Where the next flash helps most.

    Parameters
    ----------
    zenith_deg, azimuth_deg, distance_mm
        As `Lights.facts` tells them; distance None of distant lights.
    sigma_deg, before_deg : float
        The object's median sigma with it, and now.
    """

    zenith_deg: float
    azimuth_deg: float
    distance_mm: float | None
    sigma_deg: float
    before_deg: float


@dataclass(frozen=True)
class Known:
    """What is known of the normals.

    Parameters
    ----------
    sigma_deg : (h, w) float64
        Standard deviation of each normal along one tangent axis, noise and the lights' own sigma; NaN off the object.
    next_flash : NextFlash
    """

    sigma_deg: Array
    next_flash: NextFlash

    @property
    def median_deg(self) -> float:
        return float(np.nanmedian(self.sigma_deg))

    def share_under(self, wanted_deg: float) -> float:
        """Return the share of the object whose sigma is that small."""
        inside = np.isfinite(self.sigma_deg)
        return float(np.mean(self.sigma_deg[inside] < wanted_deg)) if inside.any() else 0.0


class NormalsSoFar:
    """The object, found once and again, and its normals' sigma."""

    def __init__(self) -> None:
        self.mask: NDArray[np.bool_] | None = None
        """The object's (h, w); None before it is found."""
        self._looked_with = 0
        self.why = "waits for lights"
        """Why nothing is known; empty where it is."""

    def is_due(self, count: int) -> bool:
        """Whether the object is to be looked for, with so many frames."""
        return count >= max(FIRST, AGAIN * self._looked_with)

    def find_object(self, frames: Frames, camera: Camera, spheres: Sequence[Sphere]) -> None:
        """Look for the object in frames that are reduced, with their camera and balls."""
        from align.mask.object_mask import find_object

        self._looked_with = len(frames)
        try:
            self.mask = find_object(frames, camera, list(spheres)).mask
        except SceneError as error:
            self.why = str(error)

    def update(self, frames: Frames, camera: Camera, lights: Lights, spheres: Sequence[Sphere]) -> Known | None:
        """Return what is known now; None, and `why`, where it cannot be said yet.

        The normals are those that `iterative` finds; they stand for the object in the plan of one flash more.
        """
        from solve.solve import solve

        if self.mask is None:
            return None
        step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(self.mask) / PIXELS))))
        some, view, mask = frames.every(step), camera.every(step), self.mask[::step, ::step]
        try:
            estimate = solve("iterative", some, lights, view, mask)
        except SceneError as error:
            self.why = str(error)
            return None
        found = under_way(some, view, lights, list(spheres), estimate, count=PIXELS)
        if found is None:
            self.why = "no part of the object is lit by three flashes"
            return None
        # The balls count in the pixels that were not thinned out.
        pixels = replace(found.pixels, set_up=replace(found.pixels.set_up, camera=camera))
        reach, wanted = found.within(Reach()), len(lights) + 1
        try:
            plan = plan_shoot(pixels, spheres, reach, wanted, so_far=found, look_ahead=0)
        except SceneError as error:
            self.why = str(error)
            return None
        self.why = ""
        now, then = plan.predicted[-2:]
        assert now is not None
        assert then is not None
        sigma = np.full(mask.shape, np.nan)
        sigma[found.places[:, 1], found.places[:, 0]] = now.sigma_deg
        # As the lights so far are told.
        here = pixels.set_up.middle_mm if lights.positions_mm is None else lights.reference_point_mm
        away = plan.positions_mm[-1] - here
        x, y, z = unit(away)
        return Known(
            sigma,
            NextFlash(
                float(np.degrees(np.arctan2(np.hypot(x, y), z))),
                float(np.degrees(np.arctan2(y, x)) % 360),
                None if lights.positions_mm is None else float(np.linalg.norm(away)),
                float(np.median(then.sigma_deg)),
                float(np.median(now.sigma_deg)),
            ),
        )
