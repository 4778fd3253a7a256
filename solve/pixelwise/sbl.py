"""Sparse Bayesian regression: every sample has a variance of its own, learned; outliers get a large one.

m = L b + e, e_f ~ N(0, g_f), b ~ N(0, I / prior) [Ikehata2012]. From g = 1 in turn

- C = (prior I + sum l_f l_f^T / g_f)^-1, the covariance of b given the samples,
- b = argmin sum (m_f - l_f . b)^2 / g_f; without the prior, which would shorten it,
- g_f = max((m_f - l_f . b)^2 + l_f^T C l_f, floor^2).

The variance l^T C l keeps a sample from being trusted because the fit happens to pass it, which is what reweighting by
the residual alone does. Do not believe it where half of the lit samples are not Lambertian; and it is not convex: it
may settle on the wrong half.
"""

import numpy as np

from solve.methods import Method
from solve.pixelwise.l1 import L1Settings, fit

DEFAULT = L1Settings(residual_floor=3e-3, iterations=50, prior=0.01)
SEED = L1Settings(-np.inf, tolerance=1e-8, iterations=1000, prior=1.0)
"""The plain reading: shadows are outliers like any other, and it is run to the end. (The seed has no such method.)"""
METHOD = Method("sbl", {"default": DEFAULT, "seed": SEED}, fit=fit)
