"""Least squares with a constant shadow threshold: the baseline of photometric stereo."""

from typing import NamedTuple

import numba
import numpy as np

from solve.methods import Method
from solve.pixelwise.kernels import light_vector, normal_equations


class Settings(NamedTuple):
    """Settings of `ls`.

    Parameters
    ----------
    shadow_threshold : float
        Samples under this share of the stack's 99th percentile are taken as shadowed; a constant, as the benchmark's
        text describes it [Berkiten2016].
    keep_clipped : bool
        Clipped samples count like any other.
    ceiling : float
        Gray ends here.
    """

    shadow_threshold: float = 0.02
    keep_clipped: bool = False
    ceiling: float = np.inf


@numba.njit(nogil=True, cache=True)
def fit(samples, scale, settings):  # pragma: no cover
    """Fit b = albedo x normal to each pixel by linear least squares; see `solve.methods.Method`.

    Notes
    -----
    b = argmin sum_{f in V} (l_f . b - m_f)^2, V = {m_f > threshold, not clipped} [Woodham1980]. Prefer
    `iterative` where there is gloss or cast shadow: least squares has no defence against either
    but the threshold.
    """
    gray, valid, points, geometry = samples
    threshold, ceiling = settings.shadow_threshold * scale, np.float32(settings.ceiling)
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors, values = np.empty((lights, 3)), np.empty(lights, np.float32)
    for i in range(pixels):
        for k in range(lights):
            vectors[k] = light_vector(k, points[i], geometry)
            values[k] = min(gray[i, k], ceiling)
            used[i, k] = (valid[i, k] or settings.keep_clipped) and values[k] > threshold
        x, y, z, well = normal_equations(vectors, values, used[i])
        if not well:
            # Too few lit samples: the shadowed ones still bound the normal, the clipped ones do not.
            for k in range(lights):
                used[i, k] = valid[i, k] or settings.keep_clipped
            x, y, z, well = normal_equations(vectors, values, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


METHOD = Method(
    "ls",
    {
        "default": Settings(),
        # A constant shadow threshold, and not a word of clipped samples.
        "seed": Settings(keep_clipped=True),
        # What DiLiGenT's published figures for least squares are [Shi2019]: no threshold, and gray, once divided by the
        # intensities that come with it, ends at 1 (`Lights` with those intensities as they are, not normalised).
        "published": Settings(-np.inf, keep_clipped=True, ceiling=1.0),
    },
    fit=fit,
    is_linear=True,
)
