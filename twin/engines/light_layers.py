"""A scene rendered by the engine that was chosen, piece by piece; light in layers: from the flash, sent on, standing.

A piece is a frame (stock Mitsuba) or a band of rows of all frames (`many`). None depends on what was rendered
before it: pieces can be made anywhere, in any order, and a rendering that was stopped goes on with those that lack.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.description.description import Environment, TwinScene
from twin.engines.engine_choice import Engine
from twin.engines.film import Film
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import import_mitsuba

Images = NDArray[np.float32]

STANDING_SAMPLES = 256
"""A pixel of the environment's one picture, which is added to every frame."""
VALUES_PER_BAND = 1 << 22
"""Of a band's images, in float32: 16 MiB."""
STRIP_PIXELS, STRIPS = 4096, 8
"""Of the rows that are rendered twice; in so many strips: what stands in the middle is not all of a picture."""
TRIED = 16
"""Samples a pixel by which that is done, at most."""


@dataclass(frozen=True)
class LightLayers:
    """What a scene's pixels are made of.

    direct (F, h, w, 3): Linear, of the film's box: light that met one surface. From stock Mitsuba, unless asked for
        apart: everything.
    onward (F, h, w, 3): Light of the same flashes that met more. None: it is in `direct`.
    standing (h, w, 3): The environment's light, in every frame the same. None: there is none.
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


def pieces_of(film: Film, count: int, engine: Engine) -> list[Piece]:
    """Return what is rendered at a time, of `count` frames: the same list whenever it is asked for."""
    height, width = film.size
    if engine == "mitsuba":
        return [Piece(slice(index, index + 1), slice(0, height)) for index in range(count)]
    step = max(1, min(VALUES_PER_BAND // (3 * width * count), height))
    return [Piece(slice(0, count), slice(row, min(row + step, height))) for row in range(0, height, step)]


class PieceRenderer:
    """A scene before a film, ready to be rendered by an engine.

    Parameters
    ----------
    apart : bool
        Keep light that met more than one surface apart, by stock Mitsuba too (which then renders every frame twice,
        with the same samples).
    """

    def __init__(self, scene: TwinScene, film: Film, engine: Engine, *, apart: bool = False) -> None:
        self._film = film
        self._tracers: tuple[PathTracer, ...] = ()
        # What stands still is rendered once, by itself: `standing_light`.
        dark, depth = replace(scene, environment=Environment()), scene.sampling.max_depth
        if engine == "mitsuba":
            first = replace(dark, sampling=replace(scene.sampling, max_depth=2))
            self._tracers = tuple(PathTracer(one, film) for one in ((dark, first) if apart else (dark,)))
            return
        import_mitsuba()
        self._many = Many(mitsuba_scene(dark), film, scene.lights, max_depth=depth)

    def render(self, piece: Piece, samples: int, *, seed: int = 0) -> LightLayers:
        """Return a piece's layers, without what stands still.

        samples: Paths a pixel and light; stock Mitsuba's jittered grid holds a square number.
        seed: Other paths.
        """
        if not self._tracers:
            return LightLayers(*self._many.band(piece.rows, samples, seed))
        images = [tracer.image(piece.frames.start, samples, seed=seed) for tracer in self._tracers]
        whole, *first = (self._film.place(image)[None] for image in images)
        return LightLayers(first[0], whole - first[0]) if first else LightLayers(whole)


def noise_of_one_sample(scene: TwinScene, film: Film, engine: Engine, samples: int = TRIED) -> float:
    """Return the standard deviation of a lit pixel over its mean that one sample a pixel would leave; 0 in the dark.

    Some strips of the film, spread over its height, are rendered twice, with `samples`: by stock Mitsuba under the
    strongest light.
    """
    top, left, height, width = film.window if engine == "mitsuba" else (0, 0, *film.size)
    count = max(1, min(height, -(-STRIP_PIXELS // width)) // STRIPS)
    starts = np.unique(((np.arange(STRIPS) + 0.5) / STRIPS * (height - count + 1)).astype(int)).tolist()
    if engine == "mitsuba":
        dark, index = replace(scene, environment=Environment()), int(np.argmax(scene.irradiance.sum(1)))
        tracer = PathTracer(dark, film)

        def rendered(start: int, seed: int) -> Images:
            strip = replace(film, window=(top + start, left, count, width), pixels=None)
            return tracer.image(index, samples, seed=seed, film=strip)
    else:
        renderer = PieceRenderer(scene, film, engine)

        def rendered(start: int, seed: int) -> Images:
            return renderer.render(Piece(slice(None), slice(start, start + count)), samples, seed=seed).frames()

    one, two = (np.stack([rendered(start, seed) for start in starts]) for seed in (1, 2))
    mean = (one + two) / 2
    lit = mean > 0.05 * mean.max()
    # Two renderings differ by twice the variance of one.
    return float(np.sqrt(samples * np.mean((one - two)[lit] ** 2) / 2) / np.mean(mean[lit])) if lit.any() else 0.0


def standing_light(scene: TwinScene, film: Film) -> Images | None:
    """Return the environment's picture (h, w, 3), by stock Mitsuba with one flash that is dark; None if there is none.

    It is the same in every frame, and what a photograph without flash shows.
    """
    if scene.environment.is_dark:
        return None
    dark = replace(scene, lights=replace(scene.lights, intensities=np.zeros_like(scene.lights.intensities)))
    return film.place(PathTracer(dark, film).image(0, STANDING_SAMPLES))


def render_layers(scene: TwinScene, film: Film, engine: Engine, samples: int) -> LightLayers:
    """Render a scene in memory: 12 bytes a pixel and light, and as much again for the light that went on."""
    renderer = PieceRenderer(scene, film, engine)
    made = [renderer.render(piece, samples) for piece in pieces_of(film, len(scene.lights), engine)]
    axis = 0 if engine == "mitsuba" else 1
    onward = [layers.onward for layers in made if layers.onward is not None]
    return LightLayers(
        np.concatenate([layers.direct for layers in made], axis),
        np.concatenate(onward, axis) if onward else None,
        standing_light(scene, film),
    )
