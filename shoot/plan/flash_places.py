"""Where the flash can be: a dome, a ring, or wherever a hand reaches."""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.light_layouts import cap, ring
from shoot.plan.plan_options import FEWEST, Layout, PlanOptions

Array = NDArray[np.float64]
CANDIDATES = 60
SECONDS: dict[Layout, float] = {"dome": 3.0, "ring": 10.0, "free": 20.0}
"""For one photograph: lamps that are switched; a lamp moved along a rail; a flash carried by hand, with recharging."""
SET_UP_MINUTES: dict[Layout, float] = {"dome": 5.0, "ring": 10.0, "free": 15.0}
"""Before the first flash: balls, focus, exposure, ambient photographs."""
NEAREST_SIZES, NEAREST_MM = 5.0, 700.0
"""How far the flash is by default: so many object sizes, and so many millimetres."""
IN_VIEW = 0.05
"""Share of the picture around it that a flash stays out of, too."""


def places_in_reach(options: PlanOptions, middle: Array, size_mm: float, count: int = CANDIDATES) -> Array:
    """Return about `count` places (C, 3), mm, evenly over the reach of the flash around the object's middle.

    Raises
    ------
    SceneError
        Too few places are in reach.
    """
    start_deg, end_deg = options.from_deg, options.to_deg
    if not start_deg < end_deg:
        raise SceneError(f"--from-deg {start_deg:g}, --to-deg {end_deg:g}: expected the first to be smaller.")
    if options.layout == "ring":
        directions = ring(count, end_deg)
    else:
        inner, outer = np.cos(np.radians([start_deg, end_deg]))
        directions = cap(round(count * (1 - outer) / (inner - outer)), end_deg)
        directions = directions[directions[:, 2] <= inner]
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0])) % 360
    start, end = options.azimuths_deg
    directions = directions[(azimuth - start) % 360 <= (end - start if end > start else end - start + 360)]
    if len(directions) < FEWEST:
        raise SceneError(
            f"--azimuths-deg {start:g} {end:g}: {len(directions)} places are in reach, {FEWEST} are needed at least. "
            "Normals need flashes from several sides."
        )
    return middle + (options.flash_mm or max(NEAREST_SIZES * size_mm, NEAREST_MM)) * directions


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


def minutes(layout: Layout, flashes: int) -> float:
    """Return how long the shoot takes."""
    return SET_UP_MINUTES[layout] + flashes * SECONDS[layout] / 60
