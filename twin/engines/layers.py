"""A scene rendered by the engine that was chosen, piece by piece; light in layers: from the flash, sent on, standing.

A piece is a frame (stock Mitsuba) or a band of rows of all frames (the others). None depends on what was rendered
before it: pieces can be made anywhere, in any order, and a rendering that was stopped goes on with those that lack.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.description.description import Environment, TwinScene
from twin.engines.direct import VALUES_PER_BAND, Direct
from twin.engines.engine_choice import Choice
from twin.engines.film import Film
from twin.engines.many import SAMPLES_PER_CALL, Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import import_mitsuba

Images = NDArray[np.float32]

STANDING_SAMPLES = 256
"""A pixel of the environment's one picture, which is added to every frame."""


@dataclass(frozen=True)
class Layers:
    """What a scene's pixels are made of.

    direct (F, h, w, 3): Linear, of the film's box: light that met one surface. From stock Mitsuba, unless asked for
        apart: everything.
    onward (F, h, w, 3): Light of the same flashes that met more. None: not rendered, or in `direct`.
    standing (h, w, 3): The environment's light, in every frame the same. None: there is none, or it is in `direct`.
    """

    direct: Images
    onward: Images | None = None
    standing: Images | None = None

    def frames(self) -> Images:
        """Return the sum, (F, h, w, 3)."""
        total = self.direct if self.onward is None else self.direct + self.onward
        return total if self.standing is None else total + self.standing


@dataclass(frozen=True)
class Piece:
    """Some frames, and some rows of the film's box."""

    frames: slice
    rows: slice


def pieces_of(film: Film, count: int, choice: Choice) -> list[Piece]:
    """Return what is rendered at a time, of `count` frames: the same list whenever it is asked for."""
    height, width = film.size
    if choice.engine == "mitsuba":
        return [Piece(slice(index, index + 1), slice(0, height)) for index in range(count)]
    step = VALUES_PER_BAND // (3 * width * count)
    if choice.engine == "many":
        step = min(step, SAMPLES_PER_CALL // (width * max(choice.samples, count // 4)))
    step = max(1, min(step, height))
    return [Piece(slice(0, count), slice(row, min(row + step, height))) for row in range(0, height, step)]


class PieceRenderer:
    """A scene before a film, ready to be rendered by the engine chosen.

    Parameters
    ----------
    apart : bool
        Keep light that met more than one surface apart, by stock Mitsuba too (which then renders every frame twice,
        with the same samples).
    """

    def __init__(self, scene: TwinScene, film: Film, choice: Choice, *, apart: bool = False) -> None:
        self._film, self._choice = film, choice
        self._tracers: tuple[PathTracer, ...] = ()
        self._onward = None
        dark, depth = replace(scene, environment=Environment()), scene.sampling.max_depth
        if choice.engine == "mitsuba":
            first = replace(dark, sampling=replace(scene.sampling, max_depth=2))
            scenes = (dark, first) if apart else (scene,)
            self._tracers = tuple(PathTracer(one, film) for one in scenes)
            return
        import_mitsuba()
        shapes, error = mitsuba_scene(dark), choice.error
        if choice.engine == "many" and depth > 2:
            error /= np.sqrt(2)
            self._onward = Indirect(shapes, film, scene.lights, samples=choice.samples, max_depth=depth)
        self._straight = Direct(shapes, film, scene.lights, error=error)

    def render(self, piece: Piece) -> Layers:
        """Return a piece's layers, without what stands still."""
        if self._choice.engine != "mitsuba":
            onward = None if self._onward is None else self._onward.band(piece.rows)
            return Layers(self._straight.band(piece.rows), onward)
        index, samples = piece.frames.start, self._choice.samples
        whole, *first = (self._film.place(tracer.image(index, samples))[None] for tracer in self._tracers)
        return Layers(first[0], whole - first[0]) if first else Layers(whole)


def standing_light(scene: TwinScene, film: Film, choice: Choice, apart: bool = False) -> Images | None:
    """Return the environment's picture (h, w, 3), by stock Mitsuba with one flash that is dark.

    None where there is no environment, or stock Mitsuba renders it with every flash.
    """
    if scene.environment.is_dark or (choice.engine == "mitsuba" and not apart):
        return None
    dark = replace(scene, lights=replace(scene.lights, intensities=np.zeros_like(scene.lights.intensities)))
    return film.place(PathTracer(dark, film).image(0, STANDING_SAMPLES))


def render_layers(scene: TwinScene, film: Film, choice: Choice, *, apart: bool = False) -> Layers:
    """Render a scene in memory: 12 bytes a pixel and light, and as much again for the light that went on."""
    renderer = PieceRenderer(scene, film, choice, apart=apart)
    made = [renderer.render(piece) for piece in pieces_of(film, len(scene.lights), choice)]
    axis = 0 if choice.engine == "mitsuba" else 1
    onward = [layers.onward for layers in made if layers.onward is not None]
    return Layers(
        np.concatenate([layers.direct for layers in made], axis),
        np.concatenate(onward, axis) if onward else None,
        standing_light(scene, film, choice, apart),
    )
