"""The bas-relief transform that gives all lights one intensity."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def depth_of_equal_lights(lights: Array, mu: float, nu: float) -> tuple[float | None, float]:
    """Return lambda that makes lights (F, 3) equally strong for a given tilt, and their relative spread then.

    None where no lambda does. Least absolute deviations of L1^2 + L2^2 + x (L3 - mu L1 - nu L2)^2 = c,
    x = 1 / lambda^2: some lights may be off.
    """
    flat = np.sum(lights[:, :2] ** 2, 1)
    deep = (lights[:, 2] - mu * lights[:, 0] - nu * lights[:, 1]) ** 2
    weight = np.ones(len(lights))
    x = 0.0
    for _ in range(30):
        total = weight.sum()
        a, d = flat - weight @ flat / total, deep - weight @ deep / total
        x = -float(np.sum(weight * a * d)) / max(float(np.sum(weight * d * d)), 1e-300)
        residual = np.abs(a + x * d)
        weight = 1 / np.maximum(residual, 0.5 * np.median(residual) + 1e-12 * flat.mean())
    if x <= 0:
        return None, np.inf
    strength = np.sqrt(flat + x * deep)
    middle = float(np.median(strength))
    return float(x**-0.5), 1.4826 * float(np.median(np.abs(strength - middle))) / middle
