"""What is photographed, as the twin's scenes: a recipe's object, a dataset's, and the virtual lab's table."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.recipe import Dataset, Recipe, Setup
from experiments.shapes import SHAPES
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Material, RoughPlastic, Texture, seed_materials
from twin.description.object_mesh import ObjectMesh, built_in

Array = NDArray[np.float64]

RADIUS_MM, DISTANCE_MM = 100.0, 1500.0
"""Of a recipe's object."""
MEAN_FREE_PATH_MM = 2 * RADIUS_MM / 50
"""Of the materials with a medium: a fair wax."""
FILLS = 0.88
"""Share of the picture's width that a shape's diameter takes, at its middle's distance."""
PATCHES = 24
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))

POWER_SPREAD = 0.08
DISTANCES = (0.7, 1.3)
"""Of a dataset's hand-held flashes: standard deviation of the power; range of the distances over their mean."""
GROUP = (("pear", (-62.0, 6.0, 0.0)), ("blob", (2.0, -28.0, 30.0)), ("knot", (58.0, 22.0, -10.0)))
"""Who stands where, mm from the middle."""
GROUP_RADIUS_MM = 42.0
GROUP_MATERIALS: dict[str, tuple[Material, Material, Material]] = {
    "matte": (Diffuse((0.7, 0.55, 0.2)), Diffuse((0.6, 0.6, 0.6)), Diffuse((0.25, 0.45, 0.7))),
    "plastic": (
        RoughPlastic((0.6, 0.5, 0.1), 0.1), RoughPlastic((0.5, 0.5, 0.5), 0.2), RoughPlastic((0.1, 0.3, 0.6), 0.4)
    ),
    "metal": (Conductor("Au", 0.4), Conductor("Al", 0.3), Conductor("Cu", 0.5)),
    "mixed": (Diffuse((0.7, 0.6, 0.4)), RoughPlastic((0.5, 0.1, 0.1), 0.15), Conductor("Cu", 0.4)),
}  # fmt: skip
"""Of pear, blob and knot."""

CAMERA = Camera(320, 240, 480.0, 480.0, 161.3, 117.6)
"""Of the virtual lab, as all that follows."""
CENTRE_MM = np.array([0.0, 0.0, -900.0])
TABLE_MM = -1015.0
SPHERE_MM = 100.0
CARD_MM = (110.0, 85.0)
"""Width of a half, and half of its height."""
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
LAB_ERROR = 0.005
"""Relative root-mean-square error that its renderings aim at."""
WHITE, TABLE = Diffuse((0.8, 0.8, 0.8)), Diffuse((0.2, 0.2, 0.2))
LAB_MATERIALS: dict[str, Material] = {
    "object": WHITE, "white": WHITE, "chrome": Conductor("none", 0.0), "table": TABLE
}  # fmt: skip


def recipe_scene(recipe: Recipe) -> TwinScene:
    """Return the scene of a recipe, noiseless and without ambient light."""
    focal, middle = FILLS * recipe.side / 2 * DISTANCE_MM / RADIUS_MM, (recipe.side - 1) / 2
    place, directions = _at(RADIUS_MM, (0.0, 0.0, -DISTANCE_MM)), _directions_of(recipe)
    names = tuple(f"flash_{i:02d}" for i in range(recipe.count))
    return TwinScene(
        Camera(recipe.side, recipe.side, focal, focal, middle, middle, source="sweep"),
        (TwinObject(recipe.shape, SHAPES[recipe.shape](recipe.relief), recipe.material, place),),
        {recipe.material: _material(recipe)},
        Lights(names, directions, np.ones((recipe.count, 3)), reference_point_mm=np.array([0, 0, -DISTANCE_MM])),
        sampling=Sampling("many" if recipe.depth > 2 else "direct", max_depth=recipe.depth),
        name=recipe.shape,
    )


def _material(recipe: Recipe) -> Material:
    # Patches of colours, the same in every sweep.
    patches = np.random.default_rng(7).uniform(0.15, 0.85, (PATCHES, 2 * PATCHES, 3)).astype(np.float32)
    found = seed_materials(
        Texture(patches),
        reflectance=(recipe.reflectance, recipe.reflectance, recipe.reflectance),
        roughness=recipe.roughness,
        mean_free_path_mm=MEAN_FREE_PATH_MM,
    )[recipe.material]
    return replace(found, specularity=recipe.specularity) if isinstance(found, RoughPlastic) else found


def _directions_of(recipe: Recipe) -> Array:
    return (ring if recipe.lights == "ring" else cap)(recipe.count, recipe.polar_deg)


def cap(count: int, half_angle_deg: float) -> Array:
    """Return unit vectors (N, 3) evenly over a cap about z: equal areas, each turned on by the golden angle."""
    number = np.arange(count)
    z = 1 - (1 - np.cos(np.radians(half_angle_deg))) * (number + 0.5) / count
    return _directions(z, GOLDEN_ANGLE * number)


def ring(count: int, polar_deg: float, first: float = 0.0) -> Array:
    """Return unit vectors (N, 3) evenly on a ring about z; the first so many steps from x toward y."""
    azimuth = 2 * np.pi * (np.arange(count) + first) / count
    return _directions(np.full(count, np.cos(np.radians(polar_deg))), azimuth)


def _directions(z: Array, azimuth: Array) -> Array:
    """Return unit vectors (N, 3) of z and azimuth, radians from x toward y."""
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)


def _near(names: Sequence[str], directions: Array, distances_mm: Array, power: Array, middle: Array) -> Lights:
    """Return lights (N) at their distances from a middle (3,)."""
    places = middle + distances_mm[:, None] * directions
    return Lights(tuple(names), directions, np.repeat(power[:, None], 3, 1), places, middle)


def _at(scale: float, middle: ArrayLike) -> Array:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = middle
    return matrix


def dataset_scene(dataset: Dataset) -> TwinScene:
    """Return the scene of a dataset: its recipe's, with near lights or several objects where it has them."""
    scene = recipe_scene(dataset.recipe.scene)
    if dataset.group:
        names = [name for name, _ in GROUP]
        places = [_at(GROUP_RADIUS_MM, (x, y, z - DISTANCE_MM)) for _, (x, y, z) in GROUP]
        scene = replace(
            scene,
            objects=tuple(
                TwinObject(name, SHAPES[name](1.0), name, place) for name, place in zip(names, places, strict=True)
            ),
            materials=dict(zip(names, GROUP_MATERIALS[dataset.group], strict=True)),
            name=dataset.name,
        )
    if not dataset.near_mm:
        return scene
    recipe, lights = dataset.recipe, scene.lights
    count, directions = recipe.count, lights.directions
    away, power = np.full(count, dataset.near_mm), np.ones(count)
    if dataset.hand_held:
        # Another stream than the photons', which begins with the seed too.
        generator = np.random.default_rng([recipe.seed, count, 1])
        z = generator.uniform(np.cos(np.radians(recipe.polar_deg)), 1, count)
        directions = _directions(z, generator.uniform(0, 2 * np.pi, count))
        away = dataset.near_mm * generator.uniform(*DISTANCES, count)
        power = (1 + POWER_SPREAD * generator.standard_normal(count)) * (dataset.near_mm / away) ** 2
    near = _near(lights.names, directions, away, power, lights.reference_point_mm)
    return replace(scene, lights=near.normalised(), radii_mm=np.zeros(count))


def object_scene(setup: Setup) -> TwinScene:
    """Return the lab's object alone under the flashes as the setup has them, points, each at its place."""
    lights = _flashes(_nominal(setup), np.full(setup.frames, FLASH_MM), np.ones(setup.frames))
    # A convex body sends nothing to itself; between white halves light goes on until it no longer counts.
    sampling = Sampling(max_depth=2 if setup.shape == "sphere" else 12, error=LAB_ERROR)
    return TwinScene(CAMERA, _objects(setup), LAB_MATERIALS, lights, sampling=sampling, name=f"{setup.shape}")


def lab_scene(setup: Setup) -> TwinScene:
    """Return the table with object and balls under flashes held by hand: small discs, near their places, uneven."""
    generator = np.random.default_rng([setup.seed, 1])
    directions = _nominal(setup)
    aside = np.radians(HAND_DEG) * generator.standard_normal(directions.shape)
    directions = unit(directions + aside - np.sum(aside * directions, 1, keepdims=True) * directions)
    distances = FLASH_MM * (1 + HAND_DISTANCE * generator.standard_normal(setup.frames))
    energy = 1 + HAND_INTENSITY * generator.standard_normal(setup.frames)
    lights = _flashes(directions, distances, energy * (FLASH_MM / distances) ** 2)
    table = TwinObject("table", built_in("square"), "table", _at(3000.0, (0.0, 0.0, TABLE_MM)))
    balls = tuple(
        TwinObject(f"ball {number}", built_in("sphere"), kind, _at(radius, center))
        for number, (kind, radius, center) in enumerate(BALLS)
    )
    radii = np.full(setup.frames, FLASH_RADIUS_MM)
    return replace(object_scene(setup), objects=(*_objects(setup), *balls, table), lights=lights, radii_mm=radii)


def _nominal(setup: Setup) -> Array:
    """Return (F, 3), the flashes' directions as the setup has them."""
    if setup.ring_deg is None:
        return cap(setup.frames, CAP_DEG)
    return ring(setup.frames, setup.ring_deg, 0.25)


def _flashes(directions: Array, distances: Array, power: Array) -> Lights:
    return _near([f"flash_{i:03d}" for i in range(len(directions))], directions, distances, power, CENTRE_MM)


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
        faces = np.array([[0, 1, 2], [0, 2, 3]])[:, :: int(side)]
        halves.append(TwinObject(name, ObjectMesh(corners, faces), "object", _at(1.0, CENTRE_MM)))
    return tuple(halves)
