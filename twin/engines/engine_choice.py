"""Which engine renders a scene: the smallest that holds the stated error, by a pilot of a few thousand pixels.

`direct` if light that goes on from surface to surface is too little to count, `many` if it agrees with stock Mitsuba on
the pilot, else `mitsuba`.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twin.description.description import TwinScene
from twin.engines.direct import Direct
from twin.engines.film import Film
from twin.engines.flash_shading import give_memory_back
from twin.engines.many import Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, import_mitsuba, pick_variant

Engine = Literal["direct", "many", "mitsuba"]
Images = NDArray[np.float32]
Curves = dict[str, tuple[tuple[float, float], ...]]

PILOT_PIXELS = 4096
PILOT_SAMPLES = 64
BLOCK = 8
"""Side of the blocks of pilot pixels whose means are compared: what is left there is no noise."""
FEWEST, MOST = 4, 1024
TRIED = 0.5, 0.5**0.5, 1.0, 2.0, 4.0
"""The errors that `direct` is tried at, times the one that was asked for; as part of `many`, the second."""


@dataclass(frozen=True)
class Pilot:
    """What a pilot of a few thousand pixels tells.

    Errors are root mean squares over the film's box, over the frames' mean brightness where anything is seen.

    onward: Light that met more than one surface.
    disagreement: Between the mean of blocks of pixels by the engines `direct` and `many` and by stock Mitsuba.
    direct: Errors of `direct` for the light that comes straight from the flashes, and seconds; one for each of TRIED.
    spread, noise: Variance of `many`'s onward light and of stock Mitsuba, with PILOT_SAMPLES, over the mean squared.
    onward_s, stock_s: Seconds of the whole stack with PILOT_SAMPLES. All seconds are of the whole film, compiling not
        counted.
    """

    pixels: int
    onward: float
    disagreement: float
    direct: tuple[tuple[float, float], ...]
    spread: float
    noise: float
    onward_s: float
    stock_s: float

    def paths(self, error: float) -> int:
        """Return the paths a pixel of `many` that leave it half of an error's square."""
        return int(np.clip(np.ceil(PILOT_SAMPLES * self.spread / (error**2 / 2)), FEWEST, MOST))

    def stock_samples(self, error: float) -> int:
        """Return the samples a pixel and light with which stock Mitsuba has an error."""
        return int(np.clip(np.ceil(PILOT_SAMPLES * self.noise / error**2), FEWEST, 1 << 20))

    def seconds(self, error: float) -> dict[str, float]:
        """Return what each engine would take at the error that was asked for."""
        return {
            "direct": self.direct[TRIED.index(1.0)][1],
            "many": self.direct[1][1] + self.onward_s * self.paths(error) / PILOT_SAMPLES,
            "mitsuba": self.stock_s * self.stock_samples(error) / PILOT_SAMPLES,
        }

    def curves(self, error: float) -> Curves:
        """Return (error, seconds) of each engine at some settings, the most exact last.

        `direct` cannot be more exact than what it leaves out; `many`'s error has both parts; stock Mitsuba's falls with
        the root of its samples.
        """
        direct, many, stock = [], [], []
        for straight, seconds in reversed(self.direct):
            direct.append((float(np.hypot(straight, self.onward)), seconds))
            paths = self.paths(np.sqrt(2) * straight)
            left = self.spread * PILOT_SAMPLES / paths
            many.append((float(np.sqrt(straight**2 + left)), seconds + self.onward_s * paths / PILOT_SAMPLES))
        for part in (4, 2, 1, 0.5):
            samples = self.stock_samples(error * part)
            reached = float(np.sqrt(self.noise * PILOT_SAMPLES / samples))
            stock.append((reached, self.stock_s * samples / PILOT_SAMPLES))
        return {"direct": tuple(direct), "many": tuple(many), "mitsuba": tuple(stock)}


def run_pilot(scene: TwinScene, film: Film) -> Pilot | None:
    """Return what a small picture of the same view tells; None if it is black."""
    small = _small(film)
    larger = film.window[2] * film.window[3] / (small.window[2] * small.window[3])
    # One light more than another would do; the strongest shows most.
    index = int(np.argmax(scene.irradiance.sum(1)))
    dark = replace(scene, environment=type(scene.environment)())
    # One loaded scene at a time: each holds its textures several times.
    direct, straight, onward, onward_s, spread = _by_ours(dark, small, larger)
    give_memory_back()
    tracer = PathTracer(dark, small)
    halves = [_timed(lambda seed=seed: tracer.image(index, PILOT_SAMPLES, seed=seed)) for seed in (1, 2)]
    noise = float(np.mean((halves[0][0] - halves[1][0]) ** 2)) / 2
    whole = straight + onward
    seen = whole.max((0, -1)) > 0
    if not seen.any():
        return None
    mean = float(whole[:, seen].mean())
    difference = _blocks((halves[0][0] + halves[1][0]) / 2 - whole[index])
    left = float(np.mean(difference**2)) - (noise / 2 + spread / 2) / BLOCK**2
    return Pilot(
        pixels=small.window[2] * small.window[3],
        onward=float(np.sqrt(np.mean(onward**2))) / mean,
        disagreement=float(np.sqrt(max(left, 0))) / mean,
        direct=direct,
        spread=spread / mean**2,
        noise=noise / mean**2,
        onward_s=onward_s * larger,
        stock_s=len(scene.lights) * min(half[1] for half in halves) * larger,
    )


def _by_ours(
    scene: TwinScene, small: Film, larger: float
) -> tuple[tuple[tuple[float, float], ...], Images, NDArray, float, float]:
    """Return `Pilot.direct`, light of one surface and of more (F, h, w, 3), seconds and variance of the latter."""
    sampling = scene.sampling
    shapes = mitsuba_scene(scene)
    # The most exact one compiles what all of them need.
    first = Direct(shapes, small, scene.lights, error=TRIED[0] * sampling.error)
    straight, direct = first.images(), []
    for part in TRIED:
        engine = first.aimed_at(part * sampling.error)
        direct.append((engine.predicted_error, _timed(engine.images)[1] * larger))
    onward, onward_s, spread = np.zeros_like(straight), 0.0, 0.0
    if sampling.max_depth > 2:
        one, two = (
            _timed(
                lambda seed=seed: Indirect(
                    shapes, small, scene.lights, samples=PILOT_SAMPLES, max_depth=sampling.max_depth, seed=seed
                ).images()
            )
            for seed in (1, 2)
        )
        onward, onward_s = (one[0] + two[0]) / 2, min(one[1], two[1])
        spread = float(np.mean((one[0] - two[0]) ** 2)) / 2
    return tuple(direct), straight, onward, onward_s, spread


def _small(film: Film) -> Film:
    """Return a film of the same view of at most PILOT_PIXELS pixels."""
    top, left, height, width = film.window
    scale = min(1.0, float(np.sqrt(PILOT_PIXELS / (height * width))))
    low = np.floor(np.array([top, left]) * scale).astype(int)
    high = np.maximum(np.floor(np.array([top + height, left + width]) * scale).astype(int), low + BLOCK)
    camera = film.rendered.scaled(int(high[1]), int(high[0]), scale, scale)
    return Film.of_pinhole(camera, slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1])))


def _blocks(image: Images) -> Images:
    """Return (h / 8, w / 8, 3), the means of blocks; what is left over at the border is left out."""
    height, width = (size // BLOCK for size in image.shape[:2])
    cut = image[: height * BLOCK, : width * BLOCK]
    return cut.reshape(height, BLOCK, width, BLOCK, 3).mean((1, 3))


def _timed(work: Callable[[], Images]) -> tuple[Images, float]:
    """Return what is made, and in how many seconds: the first time it may compile."""
    start = time.perf_counter()
    made = work()
    return made, time.perf_counter() - start


@dataclass(frozen=True)
class Choice:
    """An engine, what it is to be run with, and why.

    Parameters
    ----------
    error : float
        That was asked for: see `Pilot`.
    samples : int
        Paths a pixel of `many`, or of `mitsuba` for each light.
    pilot : Pilot or None
        The evidence; None: no pilot was run.
    """

    engine: Engine
    error: float
    samples: int
    reason: str
    pilot: Pilot | None = None

    def __str__(self) -> str:
        """The line that is printed."""
        told = f"engine {self.engine}: {self.reason}."
        if self.pilot is not None:
            seconds = self.pilot.seconds(self.error)
            told += " At this error: " + ", ".join(f"{name} {s:.3g} s" for name, s in seconds.items()) + "."
        return told


def choose_engine(scene: TwinScene, film: Film) -> Choice:
    """Return the engine that `scene.sampling` names, or with "auto" the smallest that holds its `error`.

    Parameters
    ----------
    film : Film
        What will be rendered; the pilot is a small picture of the same view.
    """
    sampling, error = scene.sampling, scene.sampling.error
    barred = _needs_mitsuba(scene)
    if barred or sampling.engine == "mitsuba":
        return Choice("mitsuba", error, sampling.samples or PILOT_SAMPLES, barred or "it was asked for")
    if sampling.engine != "auto" and sampling.samples:
        return Choice(sampling.engine, error, sampling.samples, "it was asked for")
    return _by_pilot(scene, film)


def _needs_mitsuba(scene: TwinScene) -> str:
    """Return why only stock Mitsuba can render a scene; empty if the others can too."""
    variant, note = pick_variant()
    if variant == SLOW:
        return f"the others need a vectorised variant of Mitsuba, and {note}"
    if scene.radii_mm.any():
        return "the lights have a size"
    mi = import_mitsuba()
    for shape in mitsuba_scene(scene).shapes():
        flags = shape.bsdf().flags()
        if mi.has_flag(flags, mi.BSDFFlags.Delta) or mi.has_flag(flags, mi.BSDFFlags.Null):
            return f"the material of {shape.id()} reflects or transmits like a mirror or a pane"
        if shape.is_medium_transition():
            return f"{shape.id()} holds a medium"
    return ""


def _by_pilot(scene: TwinScene, film: Film) -> Choice:
    sampling, error = scene.sampling, scene.sampling.error
    pilot = run_pilot(scene, film)
    if pilot is None:
        return Choice("direct", error, 1, "the pilot is black")
    onward = f"light that went on from surface to surface is {100 * pilot.onward:.2g} % of the mean"
    against = f"stock Mitsuba on {pilot.pixels} pixels"
    paths = sampling.samples or pilot.paths(error)
    if sampling.engine != "auto":
        return Choice(sampling.engine, error, paths, f"it was asked for; {onward}", pilot)
    if pilot.disagreement > error:
        reason = f"`many` differs from {against} by {100 * pilot.disagreement:.2g} %, more than {100 * error:g} %"
        return Choice("mitsuba", error, sampling.samples or pilot.stock_samples(error), reason, pilot)
    agrees = f"agreement with {against} to {100 * pilot.disagreement:.2g} %"
    if pilot.onward < error / 2:
        return Choice("direct", error, 1, f"{onward}; {agrees}", pilot)
    return Choice("many", error, paths, f"{onward}; {agrees}", pilot)
