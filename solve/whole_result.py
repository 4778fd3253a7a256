"""What a method that looks at all pixels at once returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Whole:
    """The result of a method with `fit_whole`.

    Parameters
    ----------
    b : (P, 3) float64
        Albedo x normal; zero or NaN where unknown.
    used : (P, F) bool
        The samples that it is based on.
    doubts : tuple of str
        Why it should not be believed.
    lights : (F, 3) float64 or None
        Direction times intensity, of methods that recover the lights too.
    """

    b: NDArray[np.float64]
    used: NDArray[np.bool_]
    doubts: tuple[str, ...] = ()
    lights: NDArray[np.float64] | None = None


def scale_of_samples(gray: NDArray, valid: NDArray[np.bool_]) -> float:
    """Return the 99th percentile of the samples (P, F) that are not clipped, from at most some 5,000 pixels."""
    step = max(1, len(gray) // 5_000)
    values = gray[::step][valid[::step]]
    scale = float(np.percentile(values, 99)) if len(values) else 0.0
    return scale if scale > 0 else 1.0
