"""How much the samples of a material's fit err, read from what the fit leaves, and how much they err together."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.material.material_samples import MaterialSamples

SOME = 10_000
"""Samples that the variance is read from."""
CELLS = (4, 16, 64)
"""Pixels to a block, of those that are tried."""
LIGHTS_TOGETHER = 6
FREEDOM = 4.0
"""Of Student's t: how far a sample may lie off."""


@dataclass(frozen=True)
class Noise:
    """Variance of a sample: constant + photons v + share^2 v^2 at the value v."""

    constant: float
    photons: float
    share: float

    def variance(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the variance (P, F, 3) at predicted values."""
        bright = np.maximum(values, 0)
        return (self.constant + self.photons * bright + (self.share * bright) ** 2).astype(np.float32)


def first_noise(samples: MaterialSamples) -> Noise:
    """Return what is supposed before anything is fitted: a twentieth of the value, a hundredth of what is bright."""
    return Noise((0.01 * float(np.percentile(samples.values[samples.usable], 90))) ** 2, 0.0, 0.05)


def noise_of(samples: MaterialSamples, values: NDArray[np.float32]) -> Noise:
    """Return the noise that is left of samples by the values (P, F, 3) of a fit.

    Non-negative least squares upon the squares, weighed with the inverse square of the variance so far, and cut off at
    nine times it: four rounds.
    """
    from scipy.optimize import nnls

    step = max(1, np.count_nonzero(samples.usable) // SOME)
    bright = np.maximum(values[samples.usable][::step].astype(np.float64).ravel(), 0)
    square = (samples.values - values)[samples.usable][::step].astype(np.float64).ravel() ** 2
    columns = np.stack([np.ones_like(bright), bright, bright**2, square], 1)
    # Nothing is known better than a thousandth of what is bright: a whisker against a variance of 0.
    floor = (1e-3 * np.percentile(bright, 90)) ** 2
    variance, found = np.full(len(square), max(float(np.median(square)) / 0.45, floor)), np.zeros(3)
    for _ in range(4):
        # A normal deviate's square, cut off at 9, keeps 0.985 of its mean.
        columns[:, 3] = np.minimum(square, 9 * variance) / 0.985
        # The triangle of columns and squares together stands for all rows.
        triangle: Any = np.linalg.qr(columns / variance[:, None], mode="r")
        found = nnls(triangle[:, :3], triangle[:, 3])[0]
        variance = np.maximum(columns[:, :3] @ found, floor)
    return Noise(float(max(found[0], floor)), float(found[1]), float(np.sqrt(found[2])))


def student_weights(samples: MaterialSamples, values: NDArray[np.float32], variance: NDArray) -> NDArray[np.float32]:
    """Return (P, F, 3): 1 / variance, times Student's (nu + 1) / (nu + residual^2 / variance); 0 where unusable."""
    robust = (FREEDOM + 1) / (FREEDOM + (samples.values - values) ** 2 / variance)
    return np.where(samples.usable[..., None], robust / variance, 0).astype(np.float32)


def deviances(samples: MaterialSamples, values: NDArray[np.float32], variance: NDArray) -> NDArray[np.float64]:
    """Return (P,) -2 log likelihood, up to a constant; the three channels err together and count as one sample."""
    square = (samples.values - values) ** 2 / variance
    each = (np.log(variance) + (FREEDOM + 1) * np.log1p(square / FREEDOM)).mean(-1)
    return np.asarray(np.sum(np.where(samples.usable, each, 0), 1, dtype=np.float64))


def inflation(samples: MaterialSamples, residual: NDArray[np.float32]) -> float:
    """Return by how much neighbouring pixels and lights that err together count too often, 1 or more.

    residual (P, F, 3): Over its standard deviation; 0 where unused.

    Variance of a block's sum over the sum of its variances: blocks of neighbouring pixels under neighbouring lights,
    the largest found over several sizes. Channels are averaged first.
    """
    mean = np.clip(residual, -4, 4).mean(-1).astype(np.float64)
    group = _grouped(samples.toward.mean(0))
    per_group = np.stack([mean[:, group == g].sum(1) for g in range(group.max() + 1)], 1)
    squares = max(float(np.sum(mean**2)), 1e-300)
    together = [
        sum(float(np.sum(np.bincount(samples.blocks(pixels), column) ** 2)) for column in per_group.T)
        for pixels in CELLS
    ]
    return max(1.0, max(together) / squares)


def _grouped(directions: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return (F,) groups of about six neighbouring lights: halved along their longest extent, again and again."""
    group = np.zeros(len(directions), np.intp)
    todo = [np.arange(len(directions))]
    done = 0
    while todo:
        members = todo.pop()
        if len(members) <= LIGHTS_TOGETHER:
            group[members] = done
            done += 1
            continue
        off = directions[members] - directions[members].mean(0)
        along = off @ np.linalg.svd(off, full_matrices=False)[2][0]
        order = members[np.argsort(along)]
        todo += [order[: len(order) // 2], order[len(order) // 2 :]]
    return group
