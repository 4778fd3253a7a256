"""Least absolute deviations by reweighted least squares: robust without any threshold on the residual."""

import numpy as np

from solve.methods import Method
from solve.pixelwise.reweighted import Settings, fit_reweighted
from solve.samples import Samples

SEED = Settings(shadow_threshold=-np.inf, residual_floor=1e-6, tolerance=1e-8, iterations=1000)
"""The plain reading: shadows are outliers like any other, and it is run to the end. (The seed has no such method.)"""


def fit(samples: Samples, scale: float, settings: Settings):
    """Fit b = albedo x normal with the least sum of absolute residuals; see `solve.methods.Method`.

    Notes
    -----
    b = argmin sum_f |m_f - l_f . b|, by b <- argmin sum w_f (m_f - l_f . b)^2, w_f = 1 / max(|m_f - l_f . b|, floor)
    [Schlossmacher1973], for photometric stereo in [Ikehata2012]. The start is least squares.

    Do not believe it where half of the lit samples or nearly so are not Lambertian, or where the outliers all
    pull one way and lie where the light vectors are extreme: absolute deviations bound an outlier's residual,
    not its leverage.
    """
    return fit_reweighted(samples, scale, settings, 0.0)


METHOD = Method("l1", {"default": Settings(), "seed": SEED}, fit=fit)
