"""A scene rendered by the engine that was chosen, its light in layers: straight from the flash, sent on, standing."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.description import Environment, TwinScene
from twin.direct import Direct
from twin.engine import Choice
from twin.film import Film
from twin.flashes import import_mitsuba
from twin.many import Indirect
from twin.mitsuba_scene import mitsuba_scene
from twin.path_tracing import PathTracer
from twin.variant import pick_variant

Images = NDArray[np.float32]

STANDING_SAMPLES = 256
"""A pixel of the environment's one picture, which is added to every frame."""


@dataclass(frozen=True)
class Layers:
    """What a scene's pixels are made of.

    Parameters
    ----------
    direct : (F, h, w, 3) float32
        Linear, of the film's box: light that met one surface. From stock Mitsuba: everything.
    onward : (F, h, w, 3) float32 or None
        Light of the same flashes that met more. None: not rendered, or in `direct`.
    standing : (h, w, 3) float32 or None
        The environment's light, in every frame the same. None: there is none, or it is in `direct`.
    """

    direct: Images
    onward: Images | None = None
    standing: Images | None = None

    def frames(self) -> Images:
        """Return the sum, (F, h, w, 3)."""
        total = self.direct if self.onward is None else self.direct + self.onward
        return total if self.standing is None else total + self.standing


def render_layers(scene: TwinScene, film: Film, choice: Choice, *, seed: int = 0) -> Layers:
    """Render a scene in memory: 12 bytes a pixel and light, and as much again for the light that went on.

    `Direct.bands` and `Indirect.bands` give the same, rows by rows, where that is too much.
    """
    lights = scene.lights
    if choice.engine == "mitsuba":
        tracer = PathTracer(scene, film, variant=pick_variant()[0])
        return Layers(np.stack([film.place(tracer.image(i, choice.samples, seed=seed)) for i in range(len(lights))]))
    import_mitsuba()
    shapes = mitsuba_scene(replace(scene, environment=Environment()))
    part, depth = choice.error / np.sqrt(2), scene.sampling.max_depth
    onward = None
    if choice.engine == "many" and depth > 2:
        onward = Indirect(shapes, film, lights, samples=choice.samples, max_depth=depth, seed=seed).images()
    direct = Direct(shapes, film, lights, error=part if onward is not None else choice.error).images()
    return Layers(direct, onward, _standing(scene, film, seed))


def _standing(scene: TwinScene, film: Film, seed: int) -> Images | None:
    """Return the environment's picture, by stock Mitsuba with one flash that is dark."""
    if scene.environment.is_dark:
        return None
    dark = replace(scene, lights=replace(scene.lights, intensities=np.zeros_like(scene.lights.intensities)))
    return film.place(PathTracer(dark, film, variant=pick_variant()[0]).image(0, STANDING_SAMPLES, seed=seed))
