"""Intensities of lights whose directions are known, from pixels whose normals and albedos are not [Cho2016].

m_pf = e_f (l_f . b_p) is linear in b_p and x_f = 1 / e_f together: x_f m_pf - l_f . b_p = 0 [Cho2020]. With the pixels'
b_p eliminated, what is left is an F x F matrix, from one pass over the samples.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GROUPS = 10
"""Parts of the object whose intensities, each found without one of them, tell the standard deviation."""
_LEAST_SAMPLES = 4
"""A pixel with fewer says nothing of the intensities: three numbers are its own."""
_LEAST_EVIDENCE = 30.0
"""Samples beyond those that the normals take up, under which a light's intensity counts as unknown."""
_ROUNDING = 1e-12
"""Misfit, as a share of the samples' squares, that rounding leaves."""
_SINGULAR = 1e-3
"""det / (trace / 3)^3 of a pixel's light vectors under which it says nothing reliable."""


@dataclass(frozen=True)
class Eliminated:
    """Pixels whose b = albedo x normal follows the intensities.

    Parameters
    ----------
    b : (P, 3) float64
        By weighted least squares.
    weight : (P, F) float64
    adapted : (P, F, 3) float64
        Q: W - Q Q' is what is left of a pixel's weights once its b has adapted.
    """

    b: Array
    weight: Array
    adapted: Array

    @classmethod
    def of(cls, toward: Array, weight: Array, values: Array) -> "Eliminated":
        """Fit b to values (P, F) under light vectors (P, F, 3)."""
        weighted = np.swapaxes(toward * weight[..., None], 1, 2)
        matrix = weighted @ toward
        # The ridge keeps pixels without any weight solvable; it must leave less misfit than `_ROUNDING`.
        ridge = 1e-14 * np.trace(matrix, axis1=1, axis2=2) + 1e-30
        root = np.linalg.cholesky(matrix + ridge[:, None, None] * np.eye(3))
        adapted = np.linalg.solve(root, weighted)
        b = np.linalg.solve(np.swapaxes(root, 1, 2), adapted @ values[..., None])[..., 0]
        return cls(b, weight, np.swapaxes(adapted, 1, 2))

    def left_over(self, left: Array, right: Array, chosen: NDArray | slice = slice(None)) -> Array:
        """Return the sum over chosen pixels of diag(left) (W - Q Q') diag(right), (F, F); left, right (P, F)."""
        left, right, adapted = left[chosen], right[chosen], self.adapted[chosen]
        one, other = (np.swapaxes(x[..., None] * adapted, 1, 2).reshape(-1, x.shape[1]) for x in (left, right))
        return np.diag(np.sum(self.weight[chosen] * left * right, 0)) - one.T @ other


@dataclass(frozen=True)
class Evidence:
    """What pixels say of one channel's intensities: quadratic forms, a group of pixels each.

    Parameters
    ----------
    misfit : (GROUPS, F, F) float64
        x' misfit x is the sum of squares that no normal explains, x being 1 / intensity.
    noise : (GROUPS, F) float64
        What unit noise of the samples adds to the diagonal.
    """

    misfit: Array
    noise: Array


@dataclass(frozen=True)
class Intensities:
    """One channel's intensities.

    Parameters
    ----------
    relative : (F,) float64
        To those that the samples were divided by; mean 1 over those that are known, 1 for the others.
    sigma : (F,) float64
        Relative standard deviation, by leaving out each group in turn: what the pixels of a group share counts, not
        only their noise. NaN where nothing is known.
    contrast : float
        The misfit of the next best intensities over that of the best: 1 where they cannot be told apart.
    misfit : float
        What no normal explains, mean square over the samples' mean square.
    """

    relative: Array
    sigma: Array
    contrast: float
    misfit: float


def evidence(values: NDArray, used: NDArray[np.bool_], toward: Array) -> list[Evidence]:
    """Return what pixels, in an order in which neighbours belong together, say of each channel's intensities.

    Parameters
    ----------
    values : (P, F, C) float
        Samples of C channels.
    used : (P, F) bool
        Those that obey Lambert's law.
    toward : (P, F, 3) float64
        Light vectors of intensity 1; see `Lights.toward`.
    """
    matrix = np.swapaxes(toward, 1, 2) @ (toward * used[..., None])
    third = np.trace(matrix, axis1=1, axis2=2) / 3
    sound = (used.sum(1) >= _LEAST_SAMPLES) & (np.linalg.det(matrix) > _SINGULAR * third**3)
    weight = (used & sound[:, None]).astype(np.float64)
    pixels = Eliminated.of(toward, weight, np.zeros(used.shape))
    unit_noise = weight - (pixels.adapted**2).sum(-1)
    first = -(-np.arange(GROUPS + 1) * len(used) // GROUPS)
    places = [slice(first[group], first[group + 1]) for group in range(GROUPS)]
    noise = np.stack([unit_noise[some].sum(0) for some in places])
    found = []
    for channel in np.moveaxis(values, -1, 0):
        square = (weight * channel.astype(np.float64) ** 2).sum(1)
        # Dark pixels count as bright ones: what is not Lambert's law grows with the albedo.
        factor = np.sqrt(np.divide(weight.sum(1), square, out=np.zeros_like(square), where=square > 0))
        part = channel * factor[:, None]
        found.append(Evidence(np.stack([pixels.left_over(part, part, some) for some in places]), noise))
    return found


def solve_intensities(found: Evidence, *, with_sigma: bool = False) -> Intensities:
    """Return the intensities that leave the least misfit.

    Notes
    -----
    The least generalised eigenvector of (misfit, diag(noise)): noise adds its diagonal to the misfit, which shifts
    all eigenvalues alike and turns no vector.
    """
    misfit, noise = found.misfit.sum(0), found.noise.sum(0)
    known = noise > _LEAST_EVIDENCE
    relative, sigma = np.ones(len(noise)), np.full(len(noise), np.nan)
    if np.count_nonzero(known) < 4:
        return Intensities(relative, sigma, 1.0, 1.0)
    misfit, noise = found.misfit[:, known][:, :, known], found.noise[:, known]
    best, values = _least(misfit.sum(0), noise.sum(0))
    relative[known] = best
    contrast = values[1] / max(values[0], _ROUNDING) if (best > 0).all() else 1.0
    if with_sigma:
        parts = [
            _least(misfit.sum(0) - less, np.maximum(noise.sum(0) - fewer, 1e-6))[0]
            for less, fewer in zip(misfit, noise, strict=True)
        ]
        with np.errstate(invalid="ignore"):
            sigma[known] = np.sqrt((GROUPS - 1) / GROUPS * ((np.stack(parts) / best - 1) ** 2).sum(0))
    return Intensities(relative, sigma, float(contrast), float(values[0]))


def _least(misfit: Array, noise: Array) -> tuple[Array, Array]:
    """Return intensities (F,) of mean 1, not all positive where undetermined; and the eigenvalues, ascending."""
    scale = 1 / np.sqrt(noise)
    values, vectors = np.linalg.eigh(scale[:, None] * misfit * scale)
    x = vectors[:, 0] * scale
    x *= np.sign(x.sum())
    intensities = 1 / np.where(x == 0, 1e-30, x)
    return intensities / np.mean(intensities), values
