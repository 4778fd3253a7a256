"""A recipe's photographs: rendered once for all cells that share a scene, then lit, exposed and photographed."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.sweeps.recipe import Recipe
from experiments.sweeps.recipe_scene import DISTANCE_MM, MEAN_FREE_PATH_MM, stage
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights

Images = NDArray[np.float32]

PATHS = 64
"""A pixel, of light that goes from surface to surface."""
MEDIUM_PATHS = 9
"""A pixel and light, where there is a medium: each costs a hundred times as much."""
MEDIUM_BLUR = 0.45
"""Standard deviation, in mean free paths, of the smoothing of what comes out of a medium: less than it itself does."""
BRIGHTEST, BRIGHTEST_SHARE = 0.9, 0.995
"""The exposure: so many of the object's samples are at most so bright, as a photographer would have it."""


@dataclass(frozen=True)
class Photographs:
    """A stack with its truth.

    Parameters
    ----------
    frames : Frames
    lights : Lights
        As they are, of mean intensity 1.
    camera : Camera
    mask : (H, W) bool
    normals : (H, W, 3) float32
        True, NaN outside the mask.
    albedo : (H, W, 3) float32
        True, in the frames' exposure: pixel value under a light of intensity 1 along the normal.
    """

    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    normals: Images
    albedo: Images


@dataclass(frozen=True)
class _Rendered:
    images: Images
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    normals: Images
    albedo: Images


def photograph(recipe: Recipe) -> Photographs:
    """Return a recipe's photographs.

    Raises
    ------
    RenderError
        The scene cannot be rendered here.

    Notes
    -----
    Photons: a pixel of value v holds v / noise^2 of them on the mean, so that the standard deviation is noise at v = 1.
    """
    rendered = _render(recipe.scene)
    images, lights, mask = rendered.images, rendered.lights, rendered.mask
    generator = np.random.default_rng([recipe.seed, recipe.images])
    if recipe.images:
        taken = np.sort(generator.choice(len(images), recipe.images, replace=False))
        images, lights = images[taken], _some(lights, taken)
    if recipe.ambient:
        images = images + np.float32(recipe.ambient) * _ambient(recipe.scene)
    bright = float(np.quantile(images[:, mask].max(-1), BRIGHTEST_SHARE))
    exposure = np.float32(min(1.0, BRIGHTEST / bright)) if bright > 0 else np.float32(1.0)
    images = images * exposure
    if recipe.noise:
        photons = 1 / recipe.noise**2
        images = generator.poisson(images.astype(np.float64) * photons) / photons
    frames = Frames.from_linear(lights.names, images)
    return Photographs(frames, lights, rendered.camera, mask, rendered.normals, rendered.albedo * exposure)


def _some(lights: Lights, taken: NDArray[np.intp]) -> Lights:
    names = tuple(lights.names[i] for i in taken)
    return Lights(
        names, lights.directions[taken], lights.intensities[taken], reference_point_mm=lights.reference_point_mm
    )


# Two, for the one after the other of cells that share a scene; more would be of no use, and each takes 25 MB.
@lru_cache(maxsize=2)
def _render(recipe: Recipe) -> _Rendered:
    from twin.engines.engine_choice import Choice
    from twin.engines.layers import render_layers
    from twin.engines.variant import FAST, pick_variant
    from twin.ground_truth import ground_truth

    scene = stage(recipe)
    truth = ground_truth(scene)
    film = scene.film()
    images = np.zeros((len(scene.lights), recipe.side, recipe.side, 3), np.float32)
    material = scene.materials[recipe.material]
    below = getattr(material, "subsurface", None)
    if below is not None:
        scene = replace(scene, materials={recipe.material: replace(material, subsurface=None)})
    engine = "many" if recipe.depth > 2 else "direct"
    if pick_variant()[0] != FAST:
        # The only one that runs without LLVM; slow.
        engine = "mitsuba"
    choice = Choice(engine, scene.sampling.error, PATHS, "the recipe's")
    images[:, film.rows, film.columns] = render_layers(scene, film, choice).frames()
    if below is not None:
        images *= 1 - below.share
        images += _medium_light(recipe, images, truth.mask)
    return _Rendered(images, scene.lights, scene.camera, truth.mask, truth.normals, truth.albedo)


def _medium_light(recipe: Recipe, solid: Images, mask: NDArray[np.bool_]) -> Images:
    """Return what comes out of the medium: everything by stock Mitsuba, less the solid share, smoothed on the object.

    Parameters
    ----------
    recipe : Recipe
    solid : (N, H, W, 3) float32
        What the solid share of the surface reflects.
    mask : (H, W) bool
    """
    import cv2

    from twin.engines.engine_choice import Choice
    from twin.engines.layers import render_layers

    scene = stage(recipe)
    film = scene.film()
    choice = Choice("mitsuba", scene.sampling.error, MEDIUM_PATHS, "only it renders media")
    light = -solid
    light[:, film.rows, film.columns] += render_layers(scene, film, choice).frames()
    sigma_px = MEDIUM_BLUR * MEAN_FREE_PATH_MM * scene.camera.fx / DISTANCE_MM
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), sigma_px)[..., None]
    for image in light:
        smooth = cv2.GaussianBlur(image * mask[..., None], (0, 0), sigma_px)
        image[:] = np.where(mask[..., None], smooth / np.maximum(weight, 1e-6), 0)
    return light


@lru_cache(maxsize=2)
def _ambient(recipe: Recipe) -> Images:
    """Return (H, W, 3), the light of an even surrounding of radiance 1."""
    from twin.engines.engine_choice import Choice
    from twin.engines.layers import render_layers

    scene = stage(recipe, ambient=True)
    # One flash will do, and even that is not used.
    scene = replace(scene, lights=_some(scene.lights, np.array([0])), radii_mm=np.zeros(1))
    film = scene.film()
    standing = render_layers(scene, film, Choice("direct", 1.0, 1, "only what stands is used")).standing
    assert standing is not None
    image = np.zeros((recipe.side, recipe.side, 3), np.float32)
    image[film.rows, film.columns] = standing
    return image
