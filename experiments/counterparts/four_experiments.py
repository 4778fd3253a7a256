"""The seed's four experiments on real things, each a line: what is photographed, and which level is made harder."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

METHODS = ("ls", "rpca", "iterative", "hsh", "ldr", "entropy", "tv")
"""The benchmark's seven."""


@dataclass(frozen=True)
class Setup:
    """What stands on the table, and how it is photographed.

    Parameters
    ----------
    shape : {"sphere", "cardboard"}
        White and matte, reflectance 0.8.
    fold_deg : float
        Between the cardboard's two halves; 180: flat.
    ring_deg : float or None
        Flashes on a ring so many degrees from the camera's axis; None: all over a cap of 60 degrees.
    ambient : float
        Radiance of the room, which nobody subtracts; a flash gives a white surface the radiance 1.
    iso : float
        Of the camera: at 100 white are 40 000 electrons, at 200 half of them.
    frames : int
    seed : int
        Of the hand that holds the flash, and of the sensor's noise.
    """

    shape: str = "sphere"
    fold_deg: float = 180.0
    ring_deg: float | None = None
    ambient: float = 0.0
    iso: float = 100.0
    frames: int = 16
    seed: int = 0


@dataclass(frozen=True)
class Experiment:
    """One factor, from easy to hard.

    Parameters
    ----------
    name, title : str
    vary : str
        The field of `Setup` that the levels are of.
    levels : tuple of float
    axis : str
        What the chart's axis says.
    fixed : dict
        Other fields that are not the setup's defaults.
    log : bool
        The axis is logarithmic.
    """

    name: str
    title: str
    vary: str
    levels: tuple[float, ...]
    axis: str
    fixed: dict[str, Any] = field(default_factory=dict)
    log: bool = False

    def setups(self) -> Iterator[tuple[float, Setup]]:
        """Yield each level with its setup."""
        for level in self.levels:
            yield level, replace(Setup(**self.fixed), **{self.vary: level})


EXPERIMENTS = (
    Experiment(
        "ambient",
        "White sphere, more and more light of the room",
        "ambient",
        (0.0, 0.05, 0.15, 0.4),
        "ambient light left in, share of the flash",
    ),
    Experiment(
        "cardboard",
        "White cardboard, folded",
        "fold_deg",
        (160.0, 120.0, 90.0, 60.0),
        "degrees between the halves",
        {"shape": "cardboard"},
    ),
    Experiment(
        "iso",
        "White sphere, higher and higher ISO",
        "iso",
        (100.0, 1600.0, 6400.0, 25600.0),
        "ISO",
        log=True,
    ),
    Experiment(
        "ring",
        "White sphere, flashes held on a ring",
        "ring_deg",
        (15.0, 35.0, 55.0, 75.0),
        "degrees of the ring from the camera's axis",
    ),
)
