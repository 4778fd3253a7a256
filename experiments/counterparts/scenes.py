"""The virtual lab: a white object amid balls on a table, under flashes held by hand; and the object alone."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.counterparts.four_experiments import Setup
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Material
from twin.description.object_mesh import ObjectMesh, built_in

Array = NDArray[np.float64]

CAMERA = Camera(320, 240, 480.0, 480.0, 161.3, 117.6)
CENTRE_MM = np.array([0.0, 0.0, -900.0])
TABLE_MM = -1015.0
SPHERE_MM = 100.0
CARD_MM = (110.0, 85.0)
"""Width of a half, and half of its height."""
REFLECTANCE = 0.8
FLASH_MM, FLASH_RADIUS_MM = 900.0, 25.0
CAP_DEG = 60.0
HAND_DEG, HAND_DISTANCE, HAND_INTENSITY = 3.0, 0.05, 0.03
"""Standard deviations of a hand: of each tangent angle, of the distance, of the flash's energy."""

BALLS = (
    ("chrome", 50.0, (-225.0, 150.0, -960.0)),
    ("chrome", 50.0, (225.0, -150.0, -955.0)),
    ("white", 45.0, (-222.0, -152.0, -965.0)),
)
"""kind, radius in mm, centre in mm."""
MATERIALS: dict[str, Material] = {
    "object": Diffuse((REFLECTANCE, REFLECTANCE, REFLECTANCE)),
    "white": Diffuse((REFLECTANCE, REFLECTANCE, REFLECTANCE)),
    "chrome": Conductor("none", 0.0),
    "table": Diffuse((0.2, 0.2, 0.2)),
}


def object_scene(setup: Setup) -> TwinScene:
    """Return the object alone under the flashes as the recipe has them, points, each at its place."""
    lights = _placed(_nominal(setup), np.full(setup.frames, FLASH_MM), np.ones(setup.frames))
    return TwinScene(CAMERA, _objects(setup), MATERIALS, lights, sampling=_sampling(setup), name=f"{setup.shape}")


def lab_scene(setup: Setup) -> TwinScene:
    """Return the table with object and balls under flashes held by hand: small discs, near their places, uneven."""
    generator = np.random.default_rng([setup.seed, 1])
    directions = _nominal(setup)
    aside = np.radians(HAND_DEG) * generator.standard_normal(directions.shape)
    directions = unit(directions + aside - np.sum(aside * directions, 1, keepdims=True) * directions)
    distances = FLASH_MM * (1 + HAND_DISTANCE * generator.standard_normal(setup.frames))
    energy = 1 + HAND_INTENSITY * generator.standard_normal(setup.frames)
    lights = _placed(directions, distances, energy * (FLASH_MM / distances) ** 2)
    table = TwinObject("table", built_in("square"), "table", _at(3000.0, (0.0, 0.0, TABLE_MM)))
    balls = tuple(
        TwinObject(f"ball {number}", built_in("sphere"), kind, _at(radius, center))
        for number, (kind, radius, center) in enumerate(BALLS)
    )
    radii = np.full(setup.frames, FLASH_RADIUS_MM)
    everything = (*_objects(setup), *balls, table)
    return replace(object_scene(setup), objects=everything, lights=lights, radii_mm=radii)


def _nominal(setup: Setup) -> Array:
    """Return (F, 3), the flashes' directions as the recipe has them."""
    turn = np.arange(setup.frames)
    if setup.ring_deg is None:
        # Evenly over the cap: equal areas, each turned on by the golden angle.
        z = 1 - (1 - np.cos(np.radians(CAP_DEG))) * (turn + 0.5) / setup.frames
        azimuth = turn * np.pi * (3 - np.sqrt(5))
    else:
        z = np.full(setup.frames, np.cos(np.radians(setup.ring_deg)))
        azimuth = 2 * np.pi * (turn + 0.25) / setup.frames
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], 1)


def _placed(directions: Array, distances: Array, intensities: Array) -> Lights:
    names = tuple(f"flash_{number:03d}" for number in range(len(directions)))
    shown = np.repeat(intensities[:, None], 3, 1)
    return Lights(names, directions, shown, CENTRE_MM + distances[:, None] * directions, CENTRE_MM)


def _objects(setup: Setup) -> tuple[TwinObject, ...]:
    if setup.shape == "sphere":
        return (TwinObject("sphere", built_in("sphere"), "object", _at(SPHERE_MM, CENTRE_MM)),)
    tilt = np.radians((180 - setup.fold_deg) / 2)
    wide, high = CARD_MM
    halves = []
    for name, side in (("left half", -1.0), ("right half", 1.0)):
        edge = np.array([side * wide * np.cos(tilt), 0.0, wide * np.sin(tilt)])
        up = np.array([0.0, high, 0.0])
        corners = np.array([-up, edge - up, edge + up, up])
        # The crease lies behind the middle, so that what is folded stays before the table.
        corners[:, 2] -= wide * np.sin(tilt) / 2
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        halves.append(
            TwinObject(name, ObjectMesh(corners, faces if side > 0 else faces[:, ::-1]), "object", _at(1.0, CENTRE_MM))
        )
    return tuple(halves)


def _at(scale: float, center) -> Array:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = center
    return matrix


def _sampling(setup: Setup) -> Sampling:
    """A convex body sends nothing to itself; between white halves light goes on until it no longer counts."""
    return Sampling(max_depth=2 if setup.shape == "sphere" else 12)
