"""A dataset's photographs and true maps: the sweeps' where they have them, else a scene of its own."""

from dataclasses import dataclass, replace

import numpy as np

from experiments.datasets.catalogue import Dataset
from experiments.sweeps.photographs import BRIGHTEST, BRIGHTEST_SHARE, PATHS, photograph
from experiments.sweeps.recipe_scene import DISTANCE_MM, directions_of, stage
from experiments.sweeps.shapes import SHAPES
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Material, RoughPlastic
from twin.ground_truth import GroundTruth, ground_truth

POWER_SPREAD = 0.08
DISTANCES = (0.7, 1.3)
"""Of hand-held flashes, of their mean distance."""
GROUP = (("pear", (-62.0, 6.0, 0.0)), ("blob", (2.0, -28.0, 30.0)), ("knot", (58.0, 22.0, -10.0)))
"""Who stands where, mm from the middle."""
GROUP_RADIUS_MM = 42.0
MATERIALS: dict[str, tuple[Material, Material, Material]] = {
    "matte": (Diffuse((0.7, 0.55, 0.2)), Diffuse((0.6, 0.6, 0.6)), Diffuse((0.25, 0.45, 0.7))),
    "plastic": (
        RoughPlastic((0.6, 0.5, 0.1), 0.1),
        RoughPlastic((0.5, 0.5, 0.5), 0.2),
        RoughPlastic((0.1, 0.3, 0.6), 0.4),
    ),
    "metal": (Conductor("Au", 0.4), Conductor("Al", 0.3), Conductor("Cu", 0.5)),
    "mixed": (Diffuse((0.7, 0.6, 0.4)), RoughPlastic((0.5, 0.1, 0.1), 0.15), Conductor("Cu", 0.4)),
}
"""Of pear, blob and knot."""


@dataclass(frozen=True)
class Stack:
    """What a dataset holds.

    Parameters
    ----------
    frames : Frames
        Named 001, 002 ...
    lights : Lights
        Of the same names.
    camera : Camera
    truth : GroundTruth
        Its albedo is in the frames' exposure: pixel value under a light of intensity 1 along the normal.
    """

    frames: Frames
    lights: Lights
    camera: Camera
    truth: GroundTruth


def stack_of(dataset: Dataset) -> Stack:
    """Photograph a dataset's scene.

    Raises
    ------
    RenderError
        The scene cannot be rendered here.
    """
    if dataset.near_mm or dataset.group:
        frames, scene, exposure = _own(dataset)
    else:
        found = photograph(dataset.recipe)
        # Of the lights that were taken.
        scene = replace(stage(dataset.recipe.scene), lights=found.lights, radii_mm=np.zeros(len(found.lights)))
        frames, exposure = found.frames, None
        albedo = found.albedo
    truth = ground_truth(scene)
    truth = replace(truth, albedo=albedo if exposure is None else truth.albedo * np.float32(exposure))
    names = tuple(f"{number:03d}" for number in range(1, len(frames) + 1))
    frames, lights = replace(frames, names=names), replace(scene.lights, names=names)
    return Stack(_photographed(frames, dataset), lights, scene.camera, truth)


def _own(dataset: Dataset) -> tuple[Frames, TwinScene, float]:
    """Return the frames of a scene that no sweep has, the scene, and the exposure."""
    from twin.engines.engine_choice import Choice
    from twin.engines.layers import render_layers
    from twin.engines.variant import FAST, pick_variant

    scene = scene_of(dataset)
    engine = "many" if dataset.recipe.depth > 2 else "direct"
    choice = Choice(engine if pick_variant()[0] == FAST else "mitsuba", scene.sampling.error, PATHS, "the recipe's")
    film, camera = scene.film(), scene.camera
    images = np.zeros((len(scene.lights), camera.height, camera.width, 3), np.float32)
    images[:, film.rows, film.columns] = render_layers(scene, film, choice).frames()
    bright = float(np.quantile(images.max(-1)[images.max(-1) > 0], BRIGHTEST_SHARE))
    exposure = min(1.0, BRIGHTEST / bright)
    return Frames.from_linear(scene.lights.names, images * np.float32(exposure)), scene, exposure


def scene_of(dataset: Dataset) -> TwinScene:
    """Return the scene of a dataset with near lights, or of several objects."""
    scene = stage(dataset.recipe.scene)
    if dataset.group:
        names = [name for name, _ in GROUP]
        scene = replace(
            scene,
            objects=tuple(TwinObject(name, SHAPES[name](1.0), name, _place(place)) for name, place in GROUP),
            materials=dict(zip(names, MATERIALS[dataset.group], strict=True)),
            name=dataset.name,
        )
    lights = _lights(dataset, scene.lights)
    return replace(scene, lights=lights, radii_mm=np.zeros(len(lights)))


def _place(middle: tuple[float, float, float]) -> np.ndarray:
    matrix = np.diag([GROUP_RADIUS_MM, GROUP_RADIUS_MM, GROUP_RADIUS_MM, 1.0])
    matrix[:3, 3] = middle
    matrix[2, 3] -= DISTANCE_MM
    return matrix


def _lights(dataset: Dataset, distant: Lights) -> Lights:
    if not dataset.near_mm:
        return distant
    recipe, middle = dataset.recipe, distant.reference_point_mm
    directions, away, power = distant.directions, np.full(recipe.count, dataset.near_mm), np.ones((recipe.count, 3))
    if dataset.hand_held:
        # Another stream than the photons', which begins with the seed too.
        generator = np.random.default_rng([recipe.seed, recipe.count, 1])
        least = np.cos(np.radians(recipe.polar_deg))
        directions = directions_of(
            generator.uniform(least, 1, recipe.count), generator.uniform(0, 2 * np.pi, recipe.count)
        )
        away = dataset.near_mm * generator.uniform(*DISTANCES, recipe.count)
        flash = 1 + POWER_SPREAD * generator.standard_normal((recipe.count, 1))
        power = np.repeat(flash * (dataset.near_mm / away[:, None]) ** 2, 3, 1)
    lights = Lights(
        distant.names, directions, power, middle + away[:, None] * directions, reference_point_mm=middle
    )  # fmt: skip
    return lights.normalised()


def _photographed(frames: Frames, dataset: Dataset) -> Frames:
    """Return the frames as the dataset's camera sees them; as they are without one."""
    if dataset.sensor is None:
        return frames
    from twin.camera.virtual_camera import expose
    from twin.camera.virtual_photograph import developed

    images = [
        developed(
            expose(frames.frame(i), dataset.sensor, np.random.default_rng([dataset.recipe.seed, i, 2])), dataset.sensor
        )
        for i in range(len(frames))
    ]
    return Frames.from_linear(frames.names, np.stack(images))
