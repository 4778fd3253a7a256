"""Balls as they are outlined on a photograph, and what a hand does to them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scene.spheres import Kind, Sphere
from studio.photograph.plane import Plane

SMALLEST_PX = 4.0
"""A ball of a smaller radius tells nothing."""


@dataclass(frozen=True)
class Outline:
    """A ball as it is to be calibrated with, moved by hand or not.

    center_px: Projection of its centre, pixels of the frames.
    """

    kind: Kind
    center_px: tuple[float, float]
    radius_px: float
    diameter_mm: float | None = None
    is_moved: bool = False

    @property
    def sphere(self) -> Sphere:
        """The same as the fit's type, to be drawn."""
        return Sphere(self.kind, np.array(self.center_px), self.radius_px, self.diameter_mm)


Outlines = tuple[Outline, ...]


def moved(balls: Outlines, index: int, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls, one of them elsewhere, its centre inside the picture."""
    return _with(balls, index, center_px=_inside(center_px, plane))


def resized(balls: Outlines, index: int, radius_px: float, plane: Plane) -> Outlines:
    """Return the balls, one of them larger or smaller."""
    largest = max(plane.width, plane.height)
    return _with(balls, index, radius_px=float(min(max(radius_px, SMALLEST_PX), largest)))


def added(balls: Outlines, kind: Kind, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls and one more, as large as most of them."""
    seen = [ball.radius_px for ball in balls]
    radius = float(np.median(seen)) if seen else max(plane.width / 20, SMALLEST_PX)
    return (*balls, Outline(kind, _inside(center_px, plane), radius, None, True))


def removed(balls: Outlines, index: int) -> Outlines:
    """Return the balls without one of them."""
    return (*balls[:index], *balls[index + 1 :])


def of_kind(balls: Outlines, index: int, kind: Kind, plane: Plane | None = None) -> Outlines:
    """Return the balls, one of them of this kind."""
    return balls if balls[index].kind == kind else _with(balls, index, kind=kind)


def under(balls: Outlines, pixel: tuple[float, float]) -> int | None:
    """Return the ball that a pixel lies on; of several the one whose middle is nearest, in radii."""
    away = [np.hypot(*np.subtract(ball.center_px, pixel)) / ball.radius_px for ball in balls]
    return int(np.argmin(away)) if away and min(away) < 1 else None


def _inside(center_px: tuple[float, float], plane: Plane) -> tuple[float, float]:
    u = min(max(float(center_px[0]), 0.0), plane.width - 1.0)
    return u, min(max(float(center_px[1]), 0.0), plane.height - 1.0)


def _with(balls: Outlines, index: int, **changes: Any) -> Outlines:
    return (*balls[:index], replace(balls[index], is_moved=True, **changes), *balls[index + 1 :])
