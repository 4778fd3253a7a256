"""How much farther noise moves a method's normals than its residuals tell, by giving it noise: a parametric bootstrap.

The residuals' scatter and the lights in use tell sigma of least squares on samples that were fixed beforehand. A method
that chooses or weighs its samples by their residuals keeps the short ones, and uses less than all of what is left.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.normals import unit
from solve.design.normal_information import variance_of_normals
from solve.problem import Problem, spread_over
from solve.samples import Samples, all_samples

_PIXELS = 1_200
_LEAST = 500
"""Fits: of a small object each pixel has several."""
_COMMON = 4.0
"""Degrees of freedom that the object's common noise has beside a pixel's own, which few samples tell badly."""
_OUTLIER = 4.0
"""Sigmas beyond which a sample is no noise."""


def sigma_factors(problem: Problem, fit: Callable[..., tuple[NDArray, NDArray]], settings: Any) -> NDArray[np.float32]:
    """Return the factor (F + 1,) that the sigma of a pixel lacks, by how many samples the pixel was fitted to.

    `fit` and `settings` are the method's; see `solve.methods.Method`.

    Notes
    -----
    Some pixels are fitted: b. Their samples are replaced by v . b and noise of their residuals' size, and fitted again
    by the same method: b*. Over the pixels with about as many samples used, factor^2 is the mean of |n* - n|^2 / 2 over
    the mean of what `solve.assess.sigma_deg` states of b*, both divided by what the lights in use make of the noise
    [Efron1993]. Samples that do not agree with b stay as they are: the method has to sort them out again. What
    all samples of a pixel share (a bias by gloss) is in neither.
    """
    samples = all_samples(replace(problem, mask=spread_over(problem.mask, _PIXELS)))
    samples = samples.some(np.tile(np.arange(len(samples.gray)), -(-_LEAST // len(samples.gray))))
    scale, toward, count = samples.scale(), samples.toward(), samples.gray.shape[1]
    b, used = fit(samples, scale, settings)
    square, free, _ = _scatter(samples, toward, b, used)
    spread = square * free + _COMMON * np.sum(square * free) / max(np.sum(free), 1.0)
    spread = np.sqrt(spread / (free + _COMMON))[:, None]
    shade = np.einsum("pfi,pi->pf", toward, b)
    agrees = used | (samples.valid & (shade > 0) & (np.abs(samples.gray - shade) < _OUTLIER * spread))
    noisy = shade + spread * np.random.default_rng(0).standard_normal(shade.shape)
    again = samples._replace(gray=np.where(agrees, noisy, samples.gray).astype(np.float32))
    moved, used = fit(again, scale, settings)
    square, free, gain = _scatter(again, toward, moved, used)
    told = (free > 0) & (gain > 0) & (spread[:, 0] > 0) & b.any(1)
    noise = spread[told, 0] ** 2
    real = np.sum((np.nan_to_num(unit(moved[told])) - unit(b[told])) ** 2, 1) / 2 / gain[told]
    place, every = used.sum(1)[told], np.arange(count + 1)
    # Neighbouring counts together; where no pixel is near, what all say.
    near = np.exp(-0.5 * ((every[:, None] - every) / (0.5 + 0.05 * every[:, None])) ** 2) + 1e-6
    real, stated = (near @ np.bincount(place, x / noise, count + 1) for x in (real, square[told]))
    return np.sqrt(np.divide(real, stated, where=stated > 0, out=np.ones(count + 1))).astype(np.float32)


def _scatter(samples: Samples, toward: NDArray, b: NDArray, used: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return the residuals' variance (P,), its degrees of freedom (P,), and what turns it into sigma^2, radians (P,).

    As in `solve.assess.sigma_deg`; zero where there are none.
    """
    matrix = np.swapaxes(toward * used[..., None], 1, 2) @ toward
    spans = np.linalg.det(matrix) > 0
    inverse = np.linalg.inv(np.where(spans[:, None, None], matrix, np.eye(3)))
    free = np.where(spans, np.maximum(used.sum(1) - 3.0, 0), 0)
    gap = np.where(used, samples.gray - np.einsum("pfi,pi->pf", toward, b), 0)
    return np.sum(gap**2, 1) / np.maximum(free, 1), free, np.nan_to_num(variance_of_normals(b, inverse))
