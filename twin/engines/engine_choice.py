"""Which engine renders a scene: `many` wherever it can, which costs a third of stock Mitsuba or less at equal error.

Both trace the same paths; `many` traces a path once for all flashes.
"""

from dataclasses import dataclass
from typing import Literal

from twin.description.description import TwinScene
from twin.description.materials import Conductor
from twin.engines.variant import SLOW, pick_variant

Engine = Literal["many", "mitsuba"]


@dataclass(frozen=True)
class Choice:
    """An engine, what it is to be run with, and why.

    Parameters
    ----------
    samples : int
        Paths a pixel and light.
    noise : float or None
        What these leave: standard deviation over the mean of what is lit, predicted from strips that were rendered
        twice (`twin.engines.light_layers.noise_of_one_sample`). None: nothing was rendered.
    """

    engine: Engine
    samples: int
    reason: str
    noise: float | None = None

    def __str__(self) -> str:
        """The line that is printed."""
        noise = "" if self.noise is None else f", noise {100 * self.noise:.2g} %"
        return f"engine {self.engine}, {self.samples} samples{noise}: {self.reason}."


def choose_engine(scene: TwinScene) -> tuple[Engine, str]:
    """Return the engine that `scene.sampling` asks for, or with "auto" the fastest that can render the scene; and why.

    What only stock Mitsuba can render it renders, whatever was asked for.
    """
    barred, asked = _needs_mitsuba(scene), scene.sampling.engine
    if barred or asked == "mitsuba":
        return "mitsuba", barred or "it was asked for"
    return "many", "it was asked for" if asked == "many" else f"one path for all flashes, {len(scene.lights)} of them"


def _needs_mitsuba(scene: TwinScene) -> str:
    """Return why only stock Mitsuba can render a scene; empty if `many` can too."""
    variant, note = pick_variant()
    if variant == SLOW:
        return f"`many` needs a vectorised variant of Mitsuba, and {note}"
    if scene.radii_mm.any():
        return "the lights have a size"
    for name in dict.fromkeys(one.material for one in scene.objects):
        material = scene.materials[name]
        if isinstance(material, Conductor) and material.roughness == 0:
            return f"{name} reflects like a mirror"
        if getattr(material, "subsurface", None) is not None:
            return f"{name} holds a medium"
    return ""
