"""Sparse Bayesian regression: every sample has a variance of its own, learned; outliers get a large one."""

from typing import NamedTuple

import numpy as np

from solve.methods import Method
from solve.pixelwise import reweighted
from solve.samples import Samples


class Settings(NamedTuple):
    """Settings of `sbl`.

    Parameters
    ----------
    prior : float
        Precision of b before any sample was seen, in units of 1 / (the stack's 99th percentile)^2.
    weighting : NamedTuple
        Of `solve.pixelwise.reweighted`; its residual floor is the least standard deviation of a sample.
    """

    prior: float = 0.01
    weighting: reweighted.Settings = reweighted.Settings(residual_floor=3e-3, iterations=50)


SEED = Settings(1.0, reweighted.Settings(-np.inf, tolerance=1e-8, iterations=1000))
"""The plain reading: shadows are outliers like any other, and it is run to the end. (The seed has no such method.)"""


def fit(samples: Samples, scale: float, settings: Settings):
    """Fit b = albedo x normal with a sparse error beside the Lambertian part; see `solve.methods.Method`.

    Notes
    -----
    m = L b + e, e_f ~ N(0, g_f), b ~ N(0, I / prior) [Ikehata2012]. From g = 1 in turn

    - C = (prior I + sum l_f l_f^T / g_f)^-1, the covariance of b given the samples,
    - b = argmin sum (m_f - l_f . b)^2 / g_f; without the prior, which would shorten it,
    - g_f = max((m_f - l_f . b)^2 + l_f^T C l_f, floor^2).

    The variance l^T C l keeps a sample from being trusted because the fit happens to pass it, which is what
    reweighting by the residual alone does.

    Do not believe it where half of the lit samples are not Lambertian; and it is not convex: it may settle on
    the wrong half.
    """
    return reweighted.fit_reweighted(samples, scale, settings.weighting, settings.prior)


METHOD = Method("sbl", {"default": Settings(), "seed": SEED}, fit=fit)
