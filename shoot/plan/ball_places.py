"""How many balls, how large, and where: whole in the picture, far from each other, in nobody's shadow."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import PredictedLights, predict_lights
from scene.camera import Camera
from scene.errors import SceneError
from scene.spheres import Kind, Sphere
from shoot.plan.set_up import SetUp

Array = NDArray[np.float64]
USUAL_MM = (20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0)
"""Diameters of bearing balls that are sold."""
COUNTS = (2, 3, 4)
LEAST_PX = 20.0
"""Radius under which some balls are not found: docs/guide/shoot.md."""
GAP = 0.3
"""Radii between a ball and the picture's border, or the object."""
PLACES = 24
"""Along each side of the picture that are tried."""
SHADED = 0.02
"""Share of the flashes that the object may hide from a ball."""


@dataclass(frozen=True)
class BallChoice:
    """A set of balls and what it gives."""

    count: int  # chrome
    diameter_mm: float
    radius_px: float
    direction_sigma_deg: float  # median flash
    spheres: list[Sphere]


def stand_balls(set_up: SetUp, positions: Array, kinds: Sequence[tuple[Kind, float]]) -> list[Sphere]:
    """Return balls of kinds and diameters, mm, on the table around the object.

    The first stands where it is farthest from the object, each other one farthest from those before; no place in the
    object's shadow from one of the flashes at `positions` (F, 3), if there are others.

    Raises
    ------
    SceneError
        There is no room in the picture.
    """
    camera = set_up.camera
    outline = camera.project(set_up.mesh.vertices)
    low, high = np.nanmin(outline, 0), np.nanmax(outline, 0)
    stood: list[Sphere] = []
    for kind, diameter in kinds:
        depth = set_up.table_mm + diameter / 2
        radius = -camera.fx * diameter / 2 / depth
        places = _border(camera, (1 + GAP) * radius)
        # Distance to the object's box in the picture, and to the balls that stand.
        beside = np.maximum(np.maximum(low - places, places - high), 0)
        free = np.hypot(*beside.T) > (1 + GAP) * radius
        for other in stood:
            free &= np.hypot(*(places - other.center_px).T) > (1 + GAP) * (radius + other.radius_px)
        if not free.any():
            raise SceneError(
                f"balls: no room in the picture for {len(kinds)} balls beside the object, one of them of "
                f"{diameter:g} mm. Take smaller balls, or a greater --distance-mm."
            )
        places = places[free]
        centers = camera.points_at_depth(places, depth)
        shaded = shaded_shares(set_up, centers, positions)
        sunny = shaded <= max(SHADED, float(shaded.min()))
        away = np.hypot(*((places - (low + high) / 2) / [camera.width, camera.height]).T)
        for other in stood:
            gap = np.hypot(*((places - other.center_px) / [camera.width, camera.height]).T)
            away = gap if other is stood[0] else np.minimum(away, gap)
        best = int(np.where(sunny, away, -1).argmax())
        stood.append(Sphere(kind, places[best], radius, diameter))
    return stood


def shaded_shares(set_up: SetUp, centers: Array, positions: Array) -> Array:
    """Return (K,) the share of flashes at positions (F, 3) that the object hides from points (K, 3)."""
    toward = (positions - centers[:, None]).reshape(-1, 3)
    far = np.linalg.norm(toward, axis=1)
    hidden = set_up.caster.blocked(np.repeat(centers, len(positions), 0), toward / far[:, None], far)
    return hidden.reshape(len(centers), -1).mean(1)


def _border(camera: Camera, inset: float) -> Array:
    """Return places (N, 2) along the picture's border, so far inside."""
    if 2 * inset >= min(camera.width, camera.height):
        return np.zeros((0, 2))
    low, (right, bottom) = inset - 0.5, np.array([camera.width, camera.height]) - inset - 0.5
    step = np.linspace(0, 1, PLACES)
    across, down = low + (right - low) * step, low + (bottom - low) * step
    sides = [(across, np.full(PLACES, low)), (across, np.full(PLACES, bottom))]
    sides += [(np.full(PLACES, low), down), (np.full(PLACES, right), down)]
    return np.concatenate([np.stack(side, -1) for side in sides])


def ball_choices(set_up: SetUp, positions: Array) -> list[BallChoice]:
    """Return what sets of chrome balls and one white ball give, fewest and smallest first; those that fit in."""
    found = []
    for count in COUNTS:
        for diameter in USUAL_MM:
            radius = set_up.camera.fx * diameter / 2 / -(set_up.table_mm + diameter / 2)
            if radius < LEAST_PX:
                continue
            chrome: list[tuple[Kind, float]] = [("chrome", diameter)] * count
            try:
                spheres = stand_balls(set_up, positions, [*chrome, ("white", diameter)])
            except SceneError:
                break
            sigma = light_sigmas(set_up, spheres, positions).direction_sigma_deg
            found.append(BallChoice(count, diameter, float(radius), float(np.median(sigma)), spheres))
    return found


def light_sigmas(set_up: SetUp, spheres: Sequence[Sphere], positions: Array) -> PredictedLights:
    """Return how well the balls tell flashes at positions (F, 3)."""
    return predict_lights(set_up.camera, spheres, positions, set_up.middle_mm)
