"""Balls as they are outlined on a photograph, in its pixels, and what a hand does to them."""

from typing import Any

import numpy as np

from capture.session.manifest import SphereTable
from scene.spheres import Kind, Sphere
from studio.photograph.plane import Plane

SMALLEST_PX = 4.0
"""A ball of a smaller radius tells nothing."""
Outlines = tuple[SphereTable, ...]
"""Each has its circle."""


def outline(
    kind: Kind, center_px: tuple[float, float], radius_px: float, diameter_mm: float | None = None
) -> SphereTable:
    """Return a ball with its circle; a radius that is none is the smallest."""
    u, v = map(float, center_px)
    radius = max(float(radius_px), SMALLEST_PX)
    return SphereTable(kind=kind, center_px=[u, v], radius_px=radius, diameter_mm=diameter_mm)


def circle_of(ball: SphereTable) -> tuple[tuple[float, float], float]:
    """Return centre and radius, px, of a ball that has both."""
    assert ball.center_px is not None
    assert ball.radius_px is not None
    return (ball.center_px[0], ball.center_px[1]), ball.radius_px


def sphere_of(ball: SphereTable) -> Sphere:
    """Return a ball as the fit's type, to be drawn."""
    center, radius = circle_of(ball)
    return Sphere(ball.kind, np.array(center), radius, ball.diameter_mm)


def changed(balls: Outlines, index: int, **keys: Any) -> Outlines:
    """Return the balls, one of them with other keys."""
    return (*balls[:index], balls[index].model_copy(update=keys), *balls[index + 1 :])


def moved(balls: Outlines, index: int, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls, one of them elsewhere, its centre inside the picture."""
    return changed(balls, index, center_px=_inside(center_px, plane))


def resized(balls: Outlines, index: int, radius_px: float, plane: Plane) -> Outlines:
    """Return the balls, one of them larger or smaller."""
    return changed(balls, index, radius_px=float(min(max(radius_px, SMALLEST_PX), max(plane.width, plane.height))))


def of_kind(balls: Outlines, index: int, kind: Kind, plane: Plane) -> Outlines:
    """Return the balls, one of them of this kind."""
    return changed(balls, index, kind=kind)


def added(balls: Outlines, kind: Kind, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls and one more, as large as most of them."""
    radii = [circle_of(ball)[1] for ball in balls]
    u, v = _inside(center_px, plane)
    return (*balls, outline(kind, (u, v), float(np.median(radii)) if radii else plane.width / 20))


def under(balls: Outlines, pixel: tuple[float, float]) -> int | None:
    """Return the ball that a pixel lies on; of several the one whose middle is nearest, in radii."""
    circles = map(circle_of, balls)
    away = [np.hypot(*np.subtract(center, pixel)) / radius for center, radius in circles]
    return int(np.argmin(away)) if away and min(away) < 1 else None


def _inside(center_px: tuple[float, float], plane: Plane) -> list[float]:
    return np.clip(np.asarray(center_px, float), 0.0, [plane.width - 1.0, plane.height - 1.0]).tolist()
