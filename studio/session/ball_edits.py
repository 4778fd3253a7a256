"""Balls as tables of session.toml, and what a hand does to one: moved, resized, added, of another kind."""

import numpy as np

from capture.session.manifest import SphereTable
from capture.session.manifest_file import table_of
from scene.spheres import Kind
from studio.session.plane import Plane

SMALLEST_PX = 4.0
"""A ball of a smaller radius tells nothing."""
Balls = tuple[SphereTable, ...]


def outline(
    kind: Kind, center_px: tuple[float, float], radius_px: float, diameter_mm: float | None = None
) -> SphereTable:
    """Return a ball with its circle; a radius that is none is the smallest."""
    u, v = map(float, center_px)
    radius = max(float(radius_px), SMALLEST_PX)
    return SphereTable(kind=kind, center_px=[u, v], radius_px=radius, diameter_mm=diameter_mm)


def circle_of(ball: SphereTable) -> tuple[tuple[float, float], float]:
    """Return centre and radius, px, of a ball that has both."""
    assert ball.center_px and ball.radius_px  # noqa: PT018
    u, v = ball.center_px
    return (u, v), ball.radius_px


def changed(balls: Balls, index: int, **keys: object) -> Balls:
    """Return the balls, one of them with other keys. Raises SessionError: a value that session.toml may not have."""
    data = balls[index].model_dump(exclude_none=True) | keys
    return (*balls[:index], table_of("spheres", data), *balls[index + 1 :])  # type: ignore[return-value]


def moved(balls: Balls, index: int, center_px: tuple[float, float], plane: Plane) -> Balls:
    """Return the balls, one of them elsewhere, its centre inside the picture."""
    return changed(balls, index, center_px=_inside(center_px, plane))


def resized(balls: Balls, index: int, radius_px: float, plane: Plane) -> Balls:
    """Return the balls, one of them larger or smaller."""
    return changed(balls, index, radius_px=float(min(max(radius_px, SMALLEST_PX), max(plane.width, plane.height))))


def added(balls: Balls, kind: Kind, center_px: tuple[float, float], plane: Plane) -> Balls:
    """Return the balls and one more, as large as most of them."""
    radius = float(np.median([circle_of(ball)[1] for ball in balls])) if balls else plane.width / 20
    u, v = _inside(center_px, plane)
    return (*balls, outline(kind, (u, v), radius, _usual_mm(balls, kind)))


def under(balls: Balls, pixel: tuple[float, float]) -> int | None:
    """Return the ball that a pixel lies on; of several the one whose middle is nearest, in radii."""
    circles = map(circle_of, balls)
    away = [np.hypot(*np.subtract(center, pixel)) / radius for center, radius in circles]
    return int(np.argmin(away)) if away and min(away) < 1 else None


def of_kind(balls: Balls, index: int, kind: Kind, plane: Plane) -> Balls:
    """Return the balls, one of them of this kind, and as large as all of that: of another kind it was another size."""
    return balls if balls[index].kind == kind else changed(balls, index, kind=kind, diameter_mm=_usual_mm(balls, kind))


def _usual_mm(balls: Balls, kind: Kind) -> float | None:
    """Return the diameter of all balls of a kind; None where they differ, or there is none."""
    known = {ball.diameter_mm for ball in balls if ball.kind == kind}
    return known.pop() if len(known) == 1 else None


def _inside(center_px: tuple[float, float], plane: Plane) -> list[float]:
    return np.clip(np.asarray(center_px, float), 0.0, [plane.width - 1.0, plane.height - 1.0]).tolist()
