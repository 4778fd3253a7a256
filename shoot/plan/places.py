"""Where flashes can be, and where balls stand."""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.light_layouts import cap, ring
from scene.spheres import Kind, Sphere
from shoot.plan.plan_options import FEWEST, PlanOptions
from shoot.plan.set_up import SetUp

Array = NDArray[np.float64]
CANDIDATES, MOST_TRIED = 60, 100_000
"""Places of the flash, and directions of a cap among which they are sought: a band too thin for that is a ring."""
NEAREST_SIZES, NEAREST_MM = 5.0, 700.0
"""How far the flash is by default: so many object sizes, and so many millimetres."""
IN_VIEW = 0.05
"""Share of the picture around it that a flash stays out of, too."""
USUAL_MM = 20.0
"""Diameter of small bearing balls that are sold."""
LEAST_PX, GOOD_PX = 20.0, 60.0
"""Radius under which some balls are not found, and from which all are: docs/guide/shopping-list.md."""
GAP = 0.3
"""Radii between a ball and the picture's border."""


def places_in_reach(options: PlanOptions, middle: Array, size_mm: float, count: int = CANDIDATES) -> Array:
    """Return about `count` places (C, 3), mm, evenly over the reach of the flash around the object's middle.

    Raises SceneError: too few places are in reach.
    """
    start_deg, end_deg = options.from_deg, options.to_deg
    if start_deg > end_deg:
        raise SceneError(f"--from-deg {start_deg:g}, --to-deg {end_deg:g}: expected the first not to be larger.")
    inner, outer = np.cos(np.radians([start_deg, end_deg]))
    if (inner - outer) * MOST_TRIED <= count * (1 - outer):
        directions = ring(count, end_deg)
    else:
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

    Raises SceneError: none is left.
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


def corner_balls(set_up: SetUp, diameter_mm: float | None) -> list[Sphere]:
    """Return three chrome balls and a white one on the table, in the picture's corners; None: large enough.

    Raises SceneError: there is no room for them.
    """
    camera, away = set_up.camera, -set_up.table_mm
    diameter = diameter_mm or max(USUAL_MM, float(np.ceil(2 * GOOD_PX * away / (camera.fx + GOOD_PX))))
    depth = diameter / 2 - away
    if depth >= 0:
        raise SceneError(
            f"balls: one of {diameter:g} mm, on the table {away:.4g} mm from the camera, would reach it. Take smaller "
            "balls, or a greater --distance-mm."
        )
    radius = -camera.fx * diameter / 2 / depth
    inset, far = (1 + GAP) * radius, np.array([camera.width, camera.height]) - 1
    if 2 * inset >= far.min():
        raise SceneError(
            f"balls: no room in the picture for four of {diameter:g} mm. Take smaller ones, or a greater --distance-mm."
        )
    corners = np.array([(0, 1), (1, 0), (1, 1), (0, 0)]) * (far - 2 * inset) + inset
    kinds: tuple[Kind, ...] = ("chrome", "chrome", "chrome", "white")
    return [Sphere(kind, corner, radius, diameter) for kind, corner in zip(kinds, corners, strict=True)]
