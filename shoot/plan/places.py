"""Where flashes can be, and where balls stand: whole in the picture, far from each other, in nobody's shadow."""

from collections.abc import Sequence

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
USUAL_MM = (20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0)
"""Diameters of bearing balls that are sold."""
LEAST_PX, GOOD_PX = 20.0, 60.0
"""Radius under which some balls are not found, and from which all are: docs/guide/shopping-list.md."""
GAP = 0.3
"""Radii between a ball and the picture's border, or the object."""
ALONG_SIDE = 24
"""Places along each side of the picture that are tried."""
SHADED = 0.02
"""Share of the flashes that the object may hide from a ball."""


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


def stand_balls(set_up: SetUp, positions: Array, kinds: Sequence[tuple[Kind, float]]) -> list[Sphere]:
    """Return balls of kinds and diameters, mm, on the table around the object.

    The first stands where it is farthest from the object, each other one farthest from those before; no place in the
    object's shadow from one of the flashes at `positions` (F, 3), if there are others.

    Raises SceneError: there is no room in the picture.
    """
    camera = set_up.camera
    outline, shape = camera.project(set_up.mesh.vertices), np.array([camera.width, camera.height])
    low, high = np.nanmin(outline, 0), np.nanmax(outline, 0)
    stood: list[Sphere] = []
    for kind, diameter in kinds:
        depth = set_up.table_mm + diameter / 2
        if depth >= 0:
            raise SceneError(
                f"balls: one of {diameter:g} mm, on the table {-set_up.table_mm:.4g} mm from the camera, would reach "
                "it. Take smaller balls, or a greater --distance-mm."
            )
        radius = -camera.fx * diameter / 2 / depth
        places = _border(shape, (1 + GAP) * radius)
        # Distance to the object's box in the picture, and to the balls that stand.
        free = np.hypot(*np.maximum(np.maximum(low - places, places - high), 0).T) > (1 + GAP) * radius
        for other in stood:
            free &= np.hypot(*(places - other.center_px).T) > (1 + GAP) * (radius + other.radius_px)
        if not free.any():
            raise SceneError(
                f"balls: no room in the picture for {len(kinds)} balls beside the object, one of them of "
                f"{diameter:g} mm. Take smaller balls, or a greater --distance-mm."
            )
        places = places[free]
        toward = (positions - camera.points_at_depth(places, depth)[:, None]).reshape(-1, 3)
        far = np.linalg.norm(toward, axis=1)
        from_ball = np.repeat(camera.points_at_depth(places, depth), len(positions), 0)
        shaded = set_up.caster.blocked(from_ball, toward / far[:, None], far).reshape(len(places), -1).mean(1)
        sunny = shaded <= max(SHADED, float(shaded.min()))
        others = np.array([other.center_px for other in stood] or [(low + high) / 2])
        away = np.linalg.norm((places[:, None] - others) / shape, axis=-1).min(1)
        stood.append(Sphere(kind, places[int(np.where(sunny, away, -1).argmax())], radius, diameter))
    return stood


def _border(shape: Array, inset: float) -> Array:
    """Return places (N, 2) along the border of a picture of this width and height, so far inside."""
    if 2 * inset >= shape.min():
        return np.zeros((0, 2))
    step = np.linspace(0, 1, ALONG_SIDE)
    edge, side = np.stack(np.meshgrid([0.0, 1.0], step), -1).reshape(-1, 2), inset - 0.5
    return side + np.concatenate([edge, edge[:, ::-1]]) * (shape - 2 * inset)


def usual_balls(set_up: SetUp) -> list[tuple[Kind, float]]:
    """Return three chrome balls and a white one, of the least diameter that is sold and surely found."""
    # Up to half of the way to the camera; `stand_balls` says where none fits.
    there = [mm for mm in USUAL_MM if mm < -set_up.table_mm] or USUAL_MM[:1]
    good = (mm for mm in there if -set_up.camera.fx * mm / 2 / (set_up.table_mm + mm / 2) >= GOOD_PX)
    diameter = next(good, there[-1])
    kinds: tuple[Kind, ...] = ("chrome", "chrome", "chrome", "white")
    return [(kind, diameter) for kind in kinds]
