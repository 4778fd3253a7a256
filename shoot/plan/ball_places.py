"""How many balls, how large, and where: whole in the picture, far from each other, in nobody's shadow."""

from collections.abc import Sequence

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
COUNTS, FEWEST = (3, 4, 2), 2
"""Of chrome balls, in the order in which they are tried; so few are taken only where no more have room."""
LEAST_PX, GOOD_PX = 20.0, 60.0
"""Radius under which some balls are not found, and from which all are: docs/guide/shoot.md."""
LIGHTS_SHARE, USUAL_LIGHTS_DEG = 0.5, 0.05
"""Of the wanted accuracy, that the lights may take; and what is wanted of the lights without one."""
GAP = 0.3
"""Radii between a ball and the picture's border, or the object."""
PLACES = 24
"""Along each side of the picture that are tried."""
SHADED = 0.02
"""Share of the flashes that the object may hide from a ball."""


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


def best_balls(set_up: SetUp, positions: Array, accuracy_deg: float | None) -> list[Sphere]:
    """Return three chrome balls and a white one, the smallest that are sold and suffice; others where none do.

    `accuracy_deg`: wanted of the normals, of which the lights may take `LIGHTS_SHARE`.

    Raises
    ------
    SceneError
        No ball that would be found has room in the picture.
    """
    wanted = USUAL_LIGHTS_DEG if accuracy_deg is None else LIGHTS_SHARE * accuracy_deg
    best: tuple[float, list[Sphere]] = (np.inf, [])
    for count in COUNTS:
        for diameter in USUAL_MM:
            chrome: list[tuple[Kind, float]] = [("chrome", diameter)] * count
            if set_up.camera.fx * diameter / 2 / -(set_up.table_mm + diameter / 2) < LEAST_PX:
                continue
            try:
                spheres = stand_balls(set_up, positions, [*chrome, ("white", diameter)])
            except SceneError:
                break
            sigma = float(np.median(light_sigmas(set_up, spheres, positions).direction_sigma_deg))
            if sigma <= wanted and count > FEWEST and spheres[0].radius_px >= GOOD_PX:
                return spheres
            best = min(best, (sigma, spheres), key=lambda one: one[0])
    if not best[1]:
        raise SceneError(
            "balls: no usual ball of 20 px in radius or more has room in the picture beside the object. Take a greater "
            "--distance-mm, a longer lens, or say which balls there are: --chrome MM --white MM."
        )
    return best[1]


def light_sigmas(set_up: SetUp, spheres: Sequence[Sphere], positions: Array) -> PredictedLights:
    """Return how well the balls tell flashes at positions (F, 3)."""
    return predict_lights(set_up.camera, spheres, positions, set_up.middle_mm)
