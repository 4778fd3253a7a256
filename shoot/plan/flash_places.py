"""Where the flash can be: a dome, a ring, or wherever a hand reaches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.light_layouts import cap, ring
from shoot.plan.plan_options import FEWEST, Layout

Array = NDArray[np.float64]
CANDIDATES = 60
SECONDS: dict[str, float] = {"dome": 3.0, "ring": 10.0, "free": 20.0}
"""For one photograph: lamps that are switched; a lamp moved along a rail; a flash carried by hand, with recharging."""
SET_UP_MINUTES: dict[str, float] = {"dome": 5.0, "ring": 10.0, "free": 15.0}
"""Before the first flash: balls, focus, exposure, ambient photographs."""
NEAREST_SIZES, NEAREST_MM = 5.0, 700.0
"""How far the flash is by default: so many object sizes, and so many millimetres."""
IN_VIEW = 0.05
"""Share of the picture around it that a flash stays out of, too."""


def out_of_view(camera: Camera, positions: Array) -> Array:
    """Return the positions (F, 3) that do not stand in the picture, between camera and object.

    An orthographic camera is one of which nothing is known: it tells nothing of its sides.

    Raises
    ------
    SceneError
        None is left.
    """
    if camera.is_orthographic:
        return positions
    with np.errstate(invalid="ignore"):
        place = camera.project(positions) / [camera.width, camera.height]
    outside = positions[~np.all((place > -IN_VIEW) & (place < 1 + IN_VIEW), axis=1)]
    if not len(outside):
        raise SceneError(
            f"flashes: all {len(positions)} places in reach stand in the picture. Take a greater distance "
            "(--flash-mm), or larger angles (--from-deg, --to-deg)."
        )
    return outside


@dataclass(frozen=True)
class Reach:
    """Where the flash can be.

    Parameters
    ----------
    layout : {"dome", "ring", "free"}
        Lamps evenly over a cap; on one ring; a flash carried by hand.
    from_deg, to_deg : float
        Degrees from the camera's axis, as seen from the object's middle. A ring lies at `to_deg`.
    distance_mm : float or None
        From the object's middle; None: 5 object sizes, and 700 mm at least.
    azimuths_deg : (float, float)
        From where to where around the axis, 0 right, 90 up, as the camera sees it.
    """

    layout: Layout = "free"
    from_deg: float = 12.0
    to_deg: float = 60.0
    distance_mm: float | None = None
    azimuths_deg: tuple[float, float] = (0.0, 360.0)

    def check(self) -> None:
        """Raise SceneError for what no flash can do."""
        if not 0 <= self.from_deg < self.to_deg < 90:
            raise SceneError(
                f"--from-deg {self.from_deg:g}, --to-deg {self.to_deg:g}: expected 0 <= from < to < 90, degrees from "
                "the camera's axis."
            )
        if self.distance_mm is not None and not self.distance_mm > 0:
            raise SceneError(f"--flash-mm {self.distance_mm:g}: expected a distance above 0.")

    def positions(self, middle: Array, size_mm: float, count: int = CANDIDATES) -> Array:
        """Return about `count` places (C, 3), mm, evenly over the reach."""
        self.check()
        distance = self.distance_mm or max(NEAREST_SIZES * size_mm, NEAREST_MM)
        if self.layout == "ring":
            directions = ring(count, self.to_deg)
        else:
            share = np.cos(np.radians(self.from_deg)) - np.cos(np.radians(self.to_deg))
            directions = cap(round(count * (1 - np.cos(np.radians(self.to_deg))) / share), self.to_deg)
            directions = directions[directions[:, 2] <= np.cos(np.radians(self.from_deg))]
        azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0])) % 360
        start, end = self.azimuths_deg
        directions = directions[(azimuth - start) % 360 <= (end - start if end > start else end - start + 360)]
        if len(directions) < FEWEST:
            raise SceneError(
                f"--azimuths-deg {start:g} {end:g}: {len(directions)} places are in reach, {FEWEST} are needed at "
                "least. Normals need flashes from several sides."
            )
        return middle + distance * directions

    def minutes(self, flashes: int) -> float:
        """Return how long the shoot takes."""
        return SET_UP_MINUTES[self.layout] + flashes * SECONDS[self.layout] / 60
