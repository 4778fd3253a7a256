"""What pixels of known normals look like by the reflectance that `reflectance` found for the whole object."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solve.medians import row_medians
from solve.whole.reflectance_kernels import DIFFERENCE, GRAZING, HALF, INCIDENCE, STEEP, TABLE

ROUNDS = 4
FLOOR = 0.004
"""Least sigma of a pixel's residuals, of its albedo."""
SIGMAS = 3.0


class Geometry(NamedTuple):
    """P pixels under F lights, (P, F[, k]): n . l with the fall-off; which entries of what all pixels share make the
    reflectance, and their shares.
    """

    cosine: NDArray
    entry: NDArray[np.intp]
    share: NDArray

    @classmethod
    def of(cls, normals: NDArray, views: NDArray, toward: NDArray) -> "Geometry":
        """Return that of unit normals and views (P, 3), and light vectors (P, F, 3)."""
        cosine = np.einsum("pi,pfi->pf", normals, toward)
        half = toward / np.linalg.norm(toward, axis=-1, keepdims=True) + views[:, None]
        half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
        row, down = _between(HALF, np.arccos(np.clip(np.einsum("pi,pfi->pf", normals, half), -1, 1)))
        column, right = _between(DIFFERENCE, np.arccos(np.clip(np.einsum("pi,pfi->pf", views, half), -1, 1)))
        knot, along = _between(INCIDENCE, cosine)
        first, curve, wide = row * len(DIFFERENCE) + column, TABLE + knot, len(DIFFERENCE)
        entry = np.stack([first, first + 1, first + wide, first + wide + 1, curve, curve + 1], -1)
        up, left = 1 - down, 1 - right
        share = np.stack([up * left, up * right, down * left, down * right, 1 - along, along], -1)
        return cls(cosine, entry, share)

    def only(self, which: NDArray) -> "Geometry":
        """Return that of some of the lights."""
        return Geometry(*(values[:, which] for values in self))

    def reflectance(self, shared: NDArray) -> NDArray:
        """Return (P, F) what matte is multiplied by: f in `solve.whole.reflectance.fit_to_views`."""
        return (shared[self.entry] * self.share).sum(-1)


def _between(knots: NDArray, value: NDArray) -> tuple[NDArray[np.intp], NDArray]:
    first = np.clip(np.searchsorted(knots, value, "right") - 1, 0, len(knots) - 2)
    return first, np.clip((value - knots[first]) / (knots[first + 1] - knots[first]), 0, 1)


def albedo_of(
    geometry: Geometry, gray: NDArray, usable: NDArray[np.bool_], shared: NDArray, thrown: NDArray | float = 0.0
) -> NDArray:
    """Return (P,) the albedo that explains samples (P, F): gray = albedo (cosine f + thrown).

    usable (P, F): Lit, and not clipped. Weights are Cauchy's, by each pixel's own robust sigma; less where f is far
    from 1.
    """
    usable = usable & (geometry.cosine > GRAZING)
    factor = geometry.reflectance(shared)
    shade, loose = geometry.cosine * factor + thrown, 1 + STEEP * np.abs(factor - 1)
    weight = usable / loose
    albedo = np.zeros(len(gray))
    least = 1e-6 * float(np.percentile(gray, 99)) if gray.size else 0.0
    for _ in range(ROUNDS):
        albedo = np.sum(weight * gray * shade, 1) / np.maximum(np.sum(weight * shade**2, 1), 1e-12)
        albedo = np.maximum(albedo, least)
        residual = np.abs(gray / albedo[:, None] - shade)
        sigma = np.maximum(1.4826 * row_medians(residual, usable), FLOOR)[:, None]
        weight = usable / (loose * (1 + (residual / (SIGMAS * sigma * loose)) ** 2) ** 2)
    return albedo
