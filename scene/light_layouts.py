"""Directions of flashes that lie evenly: over a cap, on a ring."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def cap(count: int, half_angle_deg: float) -> Array:
    """Return unit vectors (N, 3) evenly over a cap about z: equal areas, each turned on by the golden angle."""
    number = np.arange(count)
    z = 1 - (1 - np.cos(np.radians(half_angle_deg))) * (number + 0.5) / count
    return directions_of(z, GOLDEN_ANGLE * number)


def ring(count: int, polar_deg: float, first: float = 0.0) -> Array:
    """Return unit vectors (N, 3) evenly on a ring about z; the first so many steps from x toward y."""
    azimuth = 2 * np.pi * (np.arange(count) + first) / count
    return directions_of(np.full(count, np.cos(np.radians(polar_deg))), azimuth)


def directions_of(z: Array, azimuth: Array) -> Array:
    """Return unit vectors (N, 3) of z and azimuth, radians from x toward y."""
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
