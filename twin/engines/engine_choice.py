"""Which engine renders a scene: the smallest that holds the stated error, by a pilot of a few thousand pixels.

`direct` if light that goes on from surface to surface is too little to count, `many` if it agrees with stock Mitsuba on
the pilot, else `mitsuba`.
"""

from dataclasses import dataclass
from typing import Literal

from twin.description.description import TwinScene
from twin.engines.film import Film
from twin.engines.flash_shading import import_mitsuba
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.pilot import PILOT_SAMPLES, Pilot, run_pilot
from twin.engines.variant import FAST, pick_variant

Engine = Literal["direct", "many", "mitsuba"]


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
