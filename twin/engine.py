"""Which engine renders a scene: the smallest that holds the stated error, by a pilot of a few thousand pixels.

`direct` if light that goes on from surface to surface is too little to count, `many` if it agrees with stock Mitsuba on
the pilot, else `mitsuba`.
"""

import time
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from twin.description import TwinScene
from twin.direct import Direct
from twin.film import Film
from twin.flashes import import_mitsuba
from twin.many import Indirect
from twin.mitsuba_scene import mitsuba_scene
from twin.path_tracing import PathTracer
from twin.variant import FAST, pick_variant

Engine = Literal["direct", "many", "mitsuba"]
Images = NDArray[np.float32]

PILOT_PIXELS = 4096
PILOT_SAMPLES = 64
BLOCK = 8
"""Side of the blocks of pilot pixels whose means are compared: what is left there is no noise."""
FEWEST, MOST = 4, 1024


@dataclass(frozen=True)
class Choice:
    """An engine, what it is to be run with, and why.

    Parameters
    ----------
    engine : {"direct", "many", "mitsuba"}
    error : float
        That was asked for: root mean square over the frames' mean brightness.
    samples : int
        Paths a pixel of `many`, or of `mitsuba` for each light.
    reason : str
    onward : float or None
        Light that met more than one surface: root mean square over the mean, on the pilot. None: no pilot was run.
    disagreement : float or None
        Between the mean of blocks of pixels by the engines `direct` and `many` and by stock Mitsuba, likewise.
    seconds : dict of str to float
        What each engine would take at that error, from the pilot; compiling not counted.
    """

    engine: Engine
    error: float
    samples: int
    reason: str
    onward: float | None = None
    disagreement: float | None = None
    seconds: dict[str, float] | None = None

    def __str__(self) -> str:
        """The line that is printed."""
        told = f"engine {self.engine}: {self.reason}."
        if self.seconds:
            told += " At this error: " + ", ".join(f"{name} {s:.3g} s" for name, s in self.seconds.items()) + "."
        return told


def choose_engine(scene: TwinScene, film: Film) -> Choice:
    """Return the engine that `scene.sampling` names, or with "auto" the smallest that holds its `error`.

    Parameters
    ----------
    scene : TwinScene
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
    if variant != FAST:
        return f"the others need the variant {FAST}, and {note}"
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
    small = _small(film)
    larger = film.window[2] * film.window[3] / (small.window[2] * small.window[3])
    # One light more than another would do; the strongest shows most.
    index = int(np.argmax(scene.irradiance.sum(1)))
    dark = replace(scene, environment=type(scene.environment)())
    shapes = mitsuba_scene(dark)
    straight, direct_s = _timed(lambda: Direct(shapes, small, scene.lights, error=error / 2).images())
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
    tracer = PathTracer(dark, small, variant=FAST)
    halves = [_timed(lambda seed=seed: tracer.image(index, PILOT_SAMPLES, seed=seed)) for seed in (1, 2)]
    noise = float(np.mean((halves[0][0] - halves[1][0]) ** 2)) / 2
    whole = straight + onward
    mean = float(whole.mean())
    if mean <= 0:
        return Choice("direct", error, 1, "the pilot is black")
    difference = _blocks((halves[0][0] + halves[1][0]) / 2 - whole[index])
    left = float(np.mean(difference**2)) - (noise / 2 + spread / 2) / BLOCK**2
    disagreement = float(np.sqrt(max(left, 0))) / mean
    share = float(np.sqrt(np.mean(onward**2))) / mean
    # Half of the square of the error is left to each part.
    wanted = error**2 / 2 * mean**2
    paths = int(np.clip(np.ceil(PILOT_SAMPLES * spread / wanted), FEWEST, MOST))
    stock = int(np.clip(np.ceil(PILOT_SAMPLES * noise / (2 * wanted)), FEWEST, 1 << 20))
    seconds = {
        "direct": direct_s * larger,
        "many": (direct_s + onward_s * paths / PILOT_SAMPLES) * larger,
        "mitsuba": len(scene.lights) * min(half[1] for half in halves) * stock / PILOT_SAMPLES * larger,
    }
    onward_text = f"light that went on from surface to surface is {100 * share:.2g} % of the mean"
    against = f"stock Mitsuba on {small.window[2] * small.window[3]} pixels"
    facts = {"onward": share, "disagreement": disagreement, "seconds": seconds}
    if sampling.engine != "auto":
        return Choice(sampling.engine, error, paths, f"it was asked for; {onward_text}", **facts)
    if disagreement > error:
        reason = f"`many` differs from {against} by {100 * disagreement:.2g} %, more than {100 * error:g} %"
        return Choice("mitsuba", error, sampling.samples or stock, reason, **facts)
    agrees = f"agreement with {against} to {100 * disagreement:.2g} %"
    if share < error / 2:
        return Choice("direct", error, 1, f"{onward_text}; {agrees}", **facts)
    return Choice("many", error, sampling.samples or paths, f"{onward_text}; {agrees}", **facts)


def _small(film: Film) -> Film:
    """Return a film of the same view of at most PILOT_PIXELS pixels."""
    top, left, height, width = film.window
    scale = min(1.0, float(np.sqrt(PILOT_PIXELS / (height * width))))
    low = np.floor(np.array([top, left]) * scale).astype(int)
    high = np.maximum(np.floor(np.array([top + height, left + width]) * scale).astype(int), low + BLOCK)
    camera = film.rendered.scaled(int(high[1]), int(high[0]), scale, scale)
    rows, columns = slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))
    return Film(camera, rows, columns, camera, (*low.tolist(), *(high - low).tolist()), None)


def _blocks(image: Images) -> Images:
    """Return (h / 8, w / 8, 3), the means of blocks; what is left over at the border is left out."""
    height, width = (size // BLOCK for size in image.shape[:2])
    cut = image[: height * BLOCK, : width * BLOCK]
    return cut.reshape(height, BLOCK, width, BLOCK, 3).mean((1, 3))


def _timed(work: Any) -> tuple[Images, float]:
    """Return what is made the second time, and in how many seconds: the first may compile."""
    work()
    start = time.perf_counter()
    made = work()
    return made, time.perf_counter() - start
