"""What profiles across an outline show outside of it: a value and a slope, each profile's own."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.silhouette.cone_fit import blurred_ramp

Array = NDArray[np.float64]
Values = NDArray[np.floating]


def outside(offsets: Array, blur_px: float) -> Values:
    """Return (M, 2), the blurred profiles of what lies outside: its value at the outline, and its slope."""
    return np.stack([ndtr(offsets / blur_px), blurred_ramp(offsets, blur_px)], -1).astype(np.float32)


def coefficients(values: Values, basis: Values, weight: Values) -> Values:
    """Return (..., F, BINS, 2): what of the basis (M, 2) each profile holds, by weighted least squares."""
    products = np.stack([basis[:, 0] ** 2, basis[:, 0] * basis[:, 1], basis[:, 1] ** 2], -1)
    # In 64 bits: where a profile shows little, first * second and both^2 are almost the same number.
    first, both, second = np.moveaxis((weight @ products).astype(np.float64), -1, 0)
    first, second = first + 1e-6, second + 1e-6
    x, y = np.moveaxis((weight * values) @ basis, -1, 0)
    inverse = 1 / (first * second - both * both)
    found = np.stack([(second * x - both * y) * inverse, (first * y - both * x) * inverse], -1)
    return found.astype(np.float32)


def without(values: Values, basis: Values, weight: Values) -> Values:
    """Return the profiles without what the basis explains of them."""
    return np.asarray(values - coefficients(values, basis, weight) @ basis.T, np.float32)
