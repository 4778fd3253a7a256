"""Scenes by seed, with known truth: an object, its material, its lights and what calibration gets wrong of them."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from experiments.photographs import Photographs, photograph_dataset
from experiments.recipe import Dataset, Recipe
from experiments.scenes import dataset_scene
from scene.lights import Lights
from scene.normals import unit
from scene.spheres import WHITE_BALL_ALBEDO
from twin.camera.virtual_camera import NO_FILTER, Sensor
from twin.ground_truth import ground_truth

SHAPES = {"pear": (1, 1), "blob": (1, 1), "knot": (1, 1), "cone": (0.3, 1.0), "bowl": (0.2, 0.8), "waves": (0.4, 1.2),
          "ridges": (0.5, 1.5)}  # fmt: skip
"""Least and greatest relief."""
MATERIALS = ("diffuse", "diffuse_texture", "specular", "specular_texture")
COUNTS = (8, 12, 16, 24, 48)
SIDE = 220


class TrustScene(NamedTuple):
    """Photographs, and the lights as a calibration has them: their errors are as large as their sigmas say."""

    name: str
    photographs: Photographs
    lights: Lights


def trust_scene(seed: int, side: int = SIDE) -> TrustScene:
    """Return the scene of a seed: every choice is drawn from it."""
    draw = np.random.default_rng([seed, 21])
    shape = str(draw.choice(list(SHAPES)))
    recipe = Recipe(
        shape=shape, relief=float(draw.uniform(*SHAPES[shape])), material=str(draw.choice(MATERIALS)),
        reflectance=float(draw.uniform(0.25, 0.85)), roughness=float(np.exp(draw.uniform(np.log(0.05), np.log(0.5)))),
        specularity=float(draw.uniform(0.3, 1.0)), count=int(draw.choice(COUNTS)),
        polar_deg=float(draw.uniform(35, 70)), depth=6, side=side, seed=seed,
    )  # fmt: skip
    is_near = bool(draw.random() < 0.5)
    sensor = Sensor(cfa=NO_FILTER, iso=float(draw.choice([100, 400, 1600])))
    name = f"{seed}: {shape}, {recipe.material}, {recipe.count} {'near' if is_near else 'distant'} lights"
    near = float(draw.uniform(600, 1500)) if is_near else 0.0
    dataset = Dataset(name, "trust", name, recipe, near_mm=near, hand_held=is_near, sensor=sensor)
    found = photograph_dataset(dataset)
    # What a white ball beside the object would show.
    before = ground_truth(dataset_scene(dataset)).albedo
    exposure = float(np.nanmedian(found.albedo / before))
    white = np.full(3, exposure * WHITE_BALL_ALBEDO)
    return TrustScene(name, found, replace(calibrated(found.lights, draw), white_value=white))


def calibrated(lights: Lights, draw: np.random.Generator) -> Lights:
    """Return lights with the errors of a calibration, and their sigmas."""
    angle, share = float(draw.uniform(0.1, 1.0)), float(draw.uniform(0.003, 0.02))
    aside = np.radians(angle) * draw.standard_normal(lights.directions.shape)
    directions = unit(
        lights.directions + aside - np.sum(aside * lights.directions, 1, keepdims=True) * lights.directions
    )
    intensities = lights.intensities * (1 + share * draw.standard_normal((len(lights), 1)))
    positions = lights.positions_mm
    if positions is not None:
        away = np.linalg.norm(positions - lights.reference_point_mm, axis=1, keepdims=True)
        positions = lights.reference_point_mm + directions * away * (1 + 0.01 * draw.standard_normal(away.shape))
    many = np.ones(len(lights))
    return replace(
        lights, directions=directions, intensities=intensities, positions_mm=positions,
        direction_sigma_deg=angle * many, intensity_sigma=share * many,
    ).normalised()  # fmt: skip
