"""A recipe as the twin's scene: shape, material, lights and camera."""

import numpy as np
from numpy.typing import NDArray

from experiments.sweeps.recipe import Recipe
from experiments.sweeps.shapes import SHAPES
from scene.camera import Camera
from scene.lights import Lights
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.materials import Material, RoughPlastic, Texture, seed_materials

RADIUS_MM, DISTANCE_MM = 100.0, 1500.0
MEAN_FREE_PATH_MM = 2 * RADIUS_MM / 50
"""Of the materials with a medium: a fair wax."""
FILLS = 0.88
"""Share of the picture's width that a shape's diameter takes, at its middle's distance."""
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
PATCHES = 24


def stage(recipe: Recipe, *, ambient: bool = False) -> TwinScene:
    """Return the scene of a recipe.

    Parameters
    ----------
    recipe : Recipe
    ambient : bool
        With light of radiance 1 from everywhere.
    """
    mesh = SHAPES[recipe.shape](recipe.relief)
    place = np.diag([RADIUS_MM, RADIUS_MM, RADIUS_MM, 1.0])
    place[2, 3] = -DISTANCE_MM
    focal = FILLS * recipe.side / 2 * DISTANCE_MM / RADIUS_MM
    middle = (recipe.side - 1) / 2
    return TwinScene(
        Camera(recipe.side, recipe.side, focal, focal, middle, middle, source="sweep"),
        (TwinObject(recipe.shape, mesh, recipe.material, place),),
        {recipe.material: _material(recipe)},
        _lights(recipe),
        environment=Environment(ambient=(1.0, 1.0, 1.0)) if ambient else Environment(),
        sampling=Sampling("many" if recipe.depth > 2 else "direct", max_depth=recipe.depth),
        name=recipe.shape,
    )


def _material(recipe: Recipe) -> Material:
    gray = (recipe.reflectance, recipe.reflectance, recipe.reflectance)
    found = seed_materials(
        _texture(), reflectance=gray, roughness=recipe.roughness, mean_free_path_mm=MEAN_FREE_PATH_MM
    )[recipe.material]
    if isinstance(found, RoughPlastic):
        return RoughPlastic(
            found.reflectance, recipe.roughness, recipe.specularity, found.index, subsurface=found.subsurface
        )
    return found


def _texture() -> Texture:
    """Return patches of colours, the same in every sweep."""
    return Texture(np.random.default_rng(7).uniform(0.15, 0.85, (PATCHES, 2 * PATCHES, 3)).astype(np.float32))


def _lights(recipe: Recipe) -> Lights:
    number, polar = np.arange(recipe.count), np.radians(recipe.polar_deg)
    if recipe.lights == "ring":
        z, azimuth = np.full(recipe.count, np.cos(polar)), 2 * np.pi * number / recipe.count
    else:
        # Each has the same share of the cap's area.
        z, azimuth = 1 - (1 - np.cos(polar)) * (number + 0.5) / recipe.count, GOLDEN_ANGLE * number
    directions = directions_of(z, azimuth)
    names = tuple(f"flash_{i:02d}" for i in number)
    return Lights(names, directions, np.ones((recipe.count, 3)), reference_point_mm=np.array([0, 0, -DISTANCE_MM]))


def directions_of(z: NDArray[np.float64], azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit vectors (N, 3) of z and azimuth, radians from x toward y."""
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
