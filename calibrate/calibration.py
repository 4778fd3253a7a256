"""What a calibration is, and what is noted on the way to it."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.detect import Rejected
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """What the balls say.

    Parameters
    ----------
    spheres : list of Sphere
    lights : Lights
    highlights_px : (S, F, 2) float64
        Where each ball mirrors each flash; NaN for white balls and where none was seen or believed.
    rejected : tuple of Rejected
        Circles that are no ball, or not one asked for, with the reason.
    evidence : tuple of str
        Why this model, and how well it fits.
    warnings : tuple of str
        What is suspicious but usable.
    position_covariance_mm2 : (F, 3, 3) float64 or None
        Of each light's position; None for distant lights.
    camera : Camera or None
        The camera that spheres and positions belong to: adjusted within its sigmas, if it had any.
    """

    spheres: list[Sphere]
    lights: Lights
    highlights_px: Array
    rejected: tuple[Rejected, ...] = ()
    evidence: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    position_covariance_mm2: Array | None = None
    camera: Camera | None = None


def leave_out(names: Sequence[str]) -> str:
    """Return what session.toml says to leave frames out, to be pasted into a message."""
    return f"frames.skip = {json.dumps(list(names))}"


@dataclass(frozen=True)
class Notes:
    """What the stages have to say, collected: evidence, warnings, and per frame what is suspicious about its light."""

    evidence: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    flags: list[list[str]] = field(default_factory=list)
