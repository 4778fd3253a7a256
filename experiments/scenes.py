"""What is photographed, as the twin's scenes: a recipe's object, or a dataset's."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.recipe import Dataset, Recipe
from experiments.shapes import SHAPES
from scene.camera import Camera
from scene.light_layouts import cap, directions_of, ring
from scene.lights import Lights
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Material, RoughPlastic, Texture, seed_materials

Array = NDArray[np.float64]

RADIUS_MM, DISTANCE_MM = 100.0, 1500.0
"""Of a recipe's object."""
MEAN_FREE_PATH_MM = 2 * RADIUS_MM / 50
"""Of the materials with a medium: a fair wax."""
FILLS = 0.88
"""Share of the picture's width that a shape's diameter takes, at its middle's distance."""
PATCHES = 24

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


def recipe_scene(recipe: Recipe) -> TwinScene:
    """Return the scene of a recipe, noiseless and without ambient light."""
    focal, middle = FILLS * recipe.side / 2 * DISTANCE_MM / RADIUS_MM, (recipe.side - 1) / 2
    place, directions = placed(RADIUS_MM, (0.0, 0.0, -DISTANCE_MM)), _directions_of(recipe)
    names = tuple(f"flash_{i:02d}" for i in range(recipe.count))
    return TwinScene(
        Camera(recipe.side, recipe.side, focal, focal, middle, middle, source="sweep"),
        (TwinObject(recipe.shape, SHAPES[recipe.shape](recipe.relief), recipe.material, place),),
        {recipe.material: _material(recipe)},
        Lights(names, directions, np.ones((recipe.count, 3)), reference_point_mm=np.array([0, 0, -DISTANCE_MM])),
        sampling=Sampling("many", max_depth=recipe.depth),
        name=recipe.shape,
    )


def _material(recipe: Recipe) -> Material:
    found = seed_materials(
        patches(),
        reflectance=(recipe.reflectance, recipe.reflectance, recipe.reflectance),
        roughness=recipe.roughness,
        mean_free_path_mm=MEAN_FREE_PATH_MM,
    )[recipe.material]
    if not isinstance(found, RoughPlastic):
        return found
    return replace(found, specularity=recipe.specularity, distribution=recipe.distribution)


def patches() -> Texture:
    """Return the patches of colours that textured objects wear: the same in every sweep."""
    return Texture(np.random.default_rng(7).uniform(0.15, 0.85, (PATCHES, 2 * PATCHES, 3)).astype(np.float32))


def _directions_of(recipe: Recipe) -> Array:
    return (ring if recipe.lights == "ring" else cap)(recipe.count, recipe.polar_deg)


def near_lights(names: Sequence[str], directions: Array, distances_mm: Array, power: Array, middle: Array) -> Lights:
    """Return lights (N) at their distances from a middle (3,)."""
    places = middle + distances_mm[:, None] * directions
    return Lights(tuple(names), directions, np.repeat(power[:, None], 3, 1), places, middle)


def placed(scale: float, middle: ArrayLike) -> Array:
    """Return the matrix (4, 4) that scales about the origin and then moves it to a middle (3,)."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = middle
    return matrix


def dataset_scene(dataset: Dataset) -> TwinScene:
    """Return the scene of a dataset: its recipe's, with near lights or several objects where it has them."""
    scene = recipe_scene(dataset.recipe.scene)
    if dataset.group:
        names = [name for name, _ in GROUP]
        places = [placed(GROUP_RADIUS_MM, (x, y, z - DISTANCE_MM)) for _, (x, y, z) in GROUP]
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
        directions = directions_of(z, generator.uniform(0, 2 * np.pi, count))
        away = dataset.near_mm * generator.uniform(*DISTANCES, count)
        power = (1 + POWER_SPREAD * generator.standard_normal(count)) * (dataset.near_mm / away) ** 2
    near = near_lights(lights.names, directions, away, power, lights.reference_point_mm)
    return replace(scene, lights=near.normalised(), radii_mm=np.zeros(count))
