"""Photographs of a recipe and of a dataset: rendered once, then lit, exposed and photographed."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.recipe import Dataset, Recipe
from experiments.scenes import dataset_scene, recipe_scene
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Environment, TwinScene
from twin.engines.engine_choice import Engine
from twin.ground_truth import GroundTruth, ground_truth

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
class VirtualPhotographs:
    """A stack with its truth."""

    frames: Frames
    lights: Lights  # as methods are told them, of mean intensity 1
    camera: Camera
    truth: GroundTruth
    """Its albedo is in the frames' exposure: pixel value under a light of intensity 1 along the normal."""

    @property
    def mask(self) -> NDArray[np.bool_]:
        return self.truth.mask

    @property
    def normals(self) -> Images:
        return self.truth.normals

    @property
    def albedo(self) -> Images:
        return self.truth.albedo


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold rendering and image processing to one thread: neighbours have the other cores.

    And the same cell shall give the same bytes: Dr.Jit's threads add to the samples of one pixel in the order in which
    they come, and float32 sums depend on it. What was set before is set again.
    """
    import cv2
    import drjit

    before = cv2.getNumThreads(), drjit.thread_count()
    cv2.setNumThreads(1)
    drjit.set_thread_count(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before[0])
        drjit.set_thread_count(before[1])


def rendered(scene: TwinScene, engine: Engine, samples: int, *, onward: bool = False) -> Images:
    """Return a scene's linear pictures (F, H, W, 3), or only the light that met more than one surface."""
    from twin.engines.light_layers import render_layers

    film = scene.film()
    layers = render_layers(scene, film, engine, samples)
    shown = layers.onward if onward else layers.frames()
    return film.whole(np.zeros_like(layers.direct) if shown is None else shown)


def by_flash(scene: TwinScene) -> Images:
    """Return a scene's pictures (F, H, W, 3) by the fastest engine that runs here."""
    from twin.engines.variant import SLOW, pick_variant

    # Stock Mitsuba is the only one that runs without LLVM; slow.
    return rendered(scene, "mitsuba" if pick_variant()[0] == SLOW else "many", PATHS)


def by_flash_and_medium(scene: TwinScene, mask: NDArray[np.bool_], paths: int = MEDIUM_PATHS) -> Images:
    """Return pictures (F, H, W, 3) of a scene of one material, with what comes out of its medium if it has one.

    mask (H, W): where the object is seen. paths: a pixel and light, where there is a medium. The solid share of the
    surface is rendered as by `by_flash`. What comes out of the medium is everything by stock Mitsuba, less the solid
    share, smoothed on the object.
    """
    import cv2

    ((name, material),) = scene.materials.items()
    below = getattr(material, "subsurface", None)
    if below is None:
        return by_flash(scene)
    solid = by_flash(replace(scene, materials={name: replace(material, subsurface=None)}))
    solid *= 1 - below.share
    light = -solid
    light += rendered(scene, "mitsuba", paths)
    sigma_px = MEDIUM_BLUR * below.mean_free_path_mm * scene.camera.fx / -scene.lights.reference_point_mm[2]
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), sigma_px)[..., None]
    for image in light:
        smooth = cv2.GaussianBlur(image * mask[..., None], (0, 0), sigma_px)
        image[:] = np.where(mask[..., None], smooth / np.maximum(weight, 1e-6), 0)
    return solid + light


def by_surrounding(scene: TwinScene) -> Images:
    """Return the picture (H, W, 3) of a scene in an even light of radiance 1 from everywhere."""
    from twin.engines.light_layers import standing_light

    film = scene.film()
    lit = replace(scene, environment=Environment(ambient=(1.0, 1.0, 1.0)))
    light = standing_light(lit, film)
    assert light is not None
    return film.whole(light)


def _exposure(samples: NDArray) -> np.float32:
    """Return the factor that makes `BRIGHTEST_SHARE` of samples (..., 3) at most `BRIGHTEST`; never above 1."""
    bright = float(np.quantile(samples.max(-1), BRIGHTEST_SHARE))
    return np.float32(min(1.0, BRIGHTEST / bright)) if bright > 0 else np.float32(1.0)


def photograph(recipe: Recipe) -> VirtualPhotographs:
    """Return a recipe's photographs; raise RenderError where they cannot be rendered here.

    Photons: a pixel of value v holds v / noise^2 of them on the mean, so that the standard deviation is noise at v = 1.
    The true maps' shadows are of all lights, whichever were taken.
    """
    images, scene, truth = _render(recipe.scene)
    lights = scene.lights
    generator = np.random.default_rng([recipe.seed, recipe.images])
    if recipe.images:
        taken = np.sort(generator.choice(len(images), recipe.images, replace=False))
        images, lights = images[taken], lights.only(taken)
    if recipe.ambient:
        images = images + np.float32(recipe.ambient) * _ambient(recipe.scene)
    exposure = _exposure(images[:, truth.mask])
    images = images * exposure
    if recipe.noise:
        photons = 1 / recipe.noise**2
        # What comes out of a medium is a difference of two renderings: below zero by their noise, here and there.
        images = generator.poisson(np.maximum(images, 0).astype(np.float64) * photons) / photons
    frames = Frames.from_linear(lights.names, images)
    return VirtualPhotographs(
        frames, _told(lights, recipe), scene.camera, replace(truth, albedo=truth.albedo * exposure)
    )


def _told(lights: Lights, recipe: Recipe) -> Lights:
    """Return distant lights as a recipe's methods are told them: each turned about an axis of its own, each off by a
    factor; one draw of chance has the same axes and numbers at all strengths.
    """
    # Another stream than the photons', which begins with the seed too.
    generator = np.random.default_rng([recipe.seed, len(lights), 4711])
    across, factors = generator.standard_normal((len(lights), 3)), generator.standard_normal((len(lights), 1))
    if recipe.directions_off_deg:
        across -= np.sum(across * lights.directions, 1, keepdims=True) * lights.directions
        # Two numbers across the direction: their sum of squares is 2 on the mean.
        angle = np.radians(recipe.directions_off_deg) / np.sqrt(2) * np.linalg.norm(across, axis=1, keepdims=True)
        lights = replace(lights, directions=np.cos(angle) * lights.directions + np.sin(angle) * unit(across))
    if recipe.intensities_off:
        lights = replace(lights, intensities=lights.intensities * np.exp(recipe.intensities_off * factors)).normalised()
    return lights


# Two, for the one after the other of cells that share a scene; more would be of no use, and each takes 25 MB.
@lru_cache(maxsize=2)
def _render(recipe: Recipe) -> tuple[Images, TwinScene, GroundTruth]:
    scene = recipe_scene(recipe)
    truth = ground_truth(scene)
    return by_flash_and_medium(scene, truth.mask), scene, truth


@lru_cache(maxsize=2)
def _ambient(recipe: Recipe) -> Images:
    return by_surrounding(recipe_scene(recipe))


def photograph_dataset(dataset: Dataset) -> VirtualPhotographs:
    """Return a dataset's photographs, named 001, 002 ...; raise RenderError where they cannot be rendered here."""
    scene = dataset_scene(dataset)
    if dataset.near_mm or dataset.group:
        images, lights, truth = by_flash(scene), scene.lights, ground_truth(scene)
        exposure = _exposure(images[images.max(-1) > 0])
        frames = Frames.from_linear(lights.names, images * exposure)
        albedo = truth.albedo * exposure
    else:
        found = photograph(dataset.recipe)
        frames, lights, truth, albedo = found.frames, found.lights, found.truth, found.albedo
        if len(lights) < len(scene.lights):
            truth = ground_truth(replace(scene, lights=lights, radii_mm=np.zeros(len(lights))))
    names = tuple(f"{number:03d}" for number in range(1, len(frames) + 1))
    frames = _developed(frames, names, dataset)
    return VirtualPhotographs(frames, replace(lights, names=names), scene.camera, replace(truth, albedo=albedo))


def _developed(frames: Frames, names: tuple[str, ...], dataset: Dataset) -> Frames:
    """Return the frames as the dataset's camera sees them; as they are without one."""
    sensor = dataset.sensor
    if sensor is None:
        return replace(frames, names=names)
    from twin.camera.virtual_camera import expose
    from twin.camera.virtual_photograph import developed

    seeds = [[dataset.recipe.seed, i, 2] for i in range(len(frames))]
    images = [
        developed(expose(frames.frame(i), sensor, np.random.default_rng(seed)), sensor) for i, seed in enumerate(seeds)
    ]
    return Frames.from_linear(names, np.stack(images))
