"""How well the lights are known, as ellipsoids in space."""

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights

Array = NDArray[np.float64]
FACTORS = (1, 3, 10, 30, 100)
"""By which a sigma may be drawn larger."""
SHOWN_DEG = 4.0
"""A sigma drawn this large is seen well."""


def light_places(lights: Lights) -> Array:
    """Return (N, 3), mm, where lights are drawn: near ones where they are, distant ones a metre toward them."""
    if lights.positions_mm is not None:
        return lights.positions_mm
    return lights.reference_point_mm + 1000.0 * lights.directions


def covariance_mm2(lights: Lights, position_covariance_mm2: Array | None) -> Array:
    """Return (N, 3, 3), how well each of `light_places` is known; NaN where nothing is.

    Where the positions' covariance is not known, the stated sigma holds all round, across the direction.
    """
    if position_covariance_mm2 is not None and lights.positions_mm is not None:
        return position_covariance_mm2
    away = np.linalg.norm(light_places(lights) - lights.reference_point_mm, axis=1)
    wide = away * np.tan(np.radians(lights.direction_sigma_deg))
    across = np.eye(3) - lights.directions[:, :, None] * lights.directions[:, None]
    return wide[:, None, None] ** 2 * across


def fitting_factor(lights: Lights) -> int:
    """Return by how much sigmas are drawn larger so that they are seen."""
    sigma = lights.direction_sigma_deg
    typical = float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else SHOWN_DEG
    return min(FACTORS, key=lambda factor: abs(np.log(factor * max(typical, 1e-6) / SHOWN_DEG)))


def ellipsoid_of(covariance_mm2: Array) -> tuple[Array, Array] | None:
    """Return one standard deviation (3,) along each axis, and the axes (3, 3), right-handed, as columns.

    None where the covariance (3, 3) is not known.
    """
    if not np.isfinite(covariance_mm2).all():
        return None
    values, axes = np.linalg.eigh(covariance_mm2)
    return np.sqrt(np.maximum(values, 0)), axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]
