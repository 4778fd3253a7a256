"""Least absolute deviations by reweighted least squares: robust without any threshold on the residual."""

from typing import NamedTuple

import numpy as np

from solve.methods import Method
from solve.pixelwise.reweighted import Weighting, fit_reweighted
from solve.samples import Samples


class Settings(NamedTuple):
    """Settings of `l1`.

    Parameters
    ----------
    shadow_threshold : float
        Shadowed, and not fitted, is what lies under this share of the pixel's own 75th percentile.
    residual_floor : float
        Residuals count as no smaller than this share of the stack's 99th percentile.
    tolerance : float
        A pixel is done when b moves less than this share of the same, summed over its three components.
    iterations : int
        At most.
    outlier_sigmas, noise_floor : float
        What counts as agreeing with the fit, for albedo and inlier count, as in `solve.pixelwise.iterative`.
    """

    shadow_threshold: float = 0.05
    residual_floor: float = 1e-4
    tolerance: float = 1e-5
    iterations: int = 100
    outlier_sigmas: float = 2.5
    noise_floor: float = 0.004


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
    how = Weighting(
        unit=1.0,
        prior=0.0,
        least=settings.residual_floor * scale,
        tolerance=settings.tolerance * scale,
        iterations=settings.iterations,
        shadow_threshold=settings.shadow_threshold,
        outlier_sigmas=settings.outlier_sigmas,
        noise_floor=settings.noise_floor * scale,
    )
    return fit_reweighted(samples, how)


METHOD = Method("l1", {"default": Settings(), "seed": SEED}, fit=fit)
