"""Which axes a normal map is written in: those by which the lights explain the photographs."""

from dataclasses import dataclass
from itertools import permutations, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError

if TYPE_CHECKING:
    from solve.samples import Samples

Array = NDArray[np.float64]

AXES = tuple(
    np.array([[sign * (axis == column) for column in range(3)] for sign, axis in zip(signs, order, strict=True)], float)
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
)
"""The 48 ways to swap and flip three axes; the first changes nothing."""
INVERTED = np.diag([-1.0, -1.0, 1.0])
"""Convex for concave."""
_PIXELS = 4000
_EXPLAINED = 0.75
"""Share of what least squares explains of the photographs, beyond normals at random, under which a map is refused.

True normals of glossy objects explain 0.96 and more, right normals in wrong axes 0.64 at most, a shifted map 0.7."""
_CAUTIOUS = 0.9
TELLING = 0.1
"""Share of the misfit of normals at random that least squares must remove, or the object tells nothing of axes."""
_ALIKE = 0.05
"""Axes whose misfit lies within this share of the best's gain count as equally good."""


@dataclass(frozen=True)
class Axes:
    """What a map's components are.

    Parameters
    ----------
    matrix : (3, 3) float64
        Camera frame from the map's: n = matrix @ (its first, second, third component).
    cautions : tuple of str
    """

    matrix: Array
    cautions: tuple[str, ...] = ()

    def __str__(self) -> str:
        rows = [(int(np.abs(row).argmax()), row.sum() < 0) for row in self.matrix]
        return "(" + ", ".join(f"{'-' if flipped else ''}{'xyz'[axis]}" for axis, flipped in rows) + ")"


def find_axes(normals: Array, samples: "Samples", *, name: str) -> Axes:
    """Return the axes in which unit normals (P, 3) explain the photographs; `name` stands in messages.

    Raises
    ------
    SceneError
        No axes explain them.

    Notes
    -----
    A candidate's misfit is the median over pixels of min_r |m - r max(0, l . n)|^2 / |m|^2. It is set between that of
    the same normals dealt out to the pixels at random, and that of least squares, so that gloss, which no normal
    explains, counts neither way.
    """
    valid, toward = samples.valid, samples.toward()
    weights = valid * np.maximum(samples.gray, 0).astype(np.float64)
    misfit = np.array([_misfit(normals @ axes.T, weights, valid, toward) for axes in AXES])
    best = int(misfit.argmin())
    shuffled = normals[np.random.default_rng(0).permutation(len(normals))] @ AXES[best].T
    by_chance = _misfit(shuffled, weights, valid, toward)
    least = min(misfit[best], _least_squares(weights, valid, toward))
    if by_chance - least < TELLING * by_chance:
        said = "the object is too flat to tell the axes of its normals from the photographs: taken as x, y, z."
        return Axes(AXES[0], (said,))
    explained = (by_chance - misfit[best]) / (by_chance - least)
    if explained < _EXPLAINED:
        raise SceneError(
            f"{name}: its normals do not explain the photographs by the lights, whichever way their axes are flipped "
            f"or swapped (the best way {Axes(AXES[best])} explains {max(explained, 0):.0%} of what least squares does, "
            f"expected {_EXPLAINED:.0%}). Is the picture upside down, of another object, or in a frame that is turned?"
        )
    alike = misfit <= misfit[best] + _ALIKE * (by_chance - misfit[best])
    cautions = ()
    if explained < _CAUTIOUS:
        cautions = (f"its normals explain {explained:.0%} only of what least squares does of the photographs.",)
    if alike[0]:
        return Axes(AXES[0], cautions)
    if np.array_equal(AXES[best], INVERTED):
        cautions += ("its relief is inverted, convex for concave: the lights say so, and x and y are negated.",)
    if alike.sum() > 1:
        other = Axes(AXES[next(k for k in np.argsort(misfit) if k != best)])
        cautions += (f"its axes may be {Axes(AXES[best])} or {other}: both explain the photographs.",)
    return Axes(AXES[best], cautions)


def some_pixels(known: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return at most some thousand of the pixels that are known (P,), evenly spread."""
    places = np.flatnonzero(known)
    return places[np.unique(np.linspace(0, len(places) - 1, min(_PIXELS, len(places))).astype(int))]


def misfits(normals: Array, samples: Array, valid: NDArray[np.bool_], toward: Array) -> Array:
    """Return each pixel's misfit (P,) under unit normals (P, 3): see `find_axes`; NaN where all is dark.

    samples (P, F), zero where not `valid`; toward (P, F, 3), the light vectors.
    """
    shade = np.maximum(np.einsum("pfi,pi->pf", toward, normals), 0) * valid
    square, power = (shade**2).sum(1), (samples**2).sum(1)
    explained = np.divide((samples * shade).sum(1) ** 2, square, out=np.zeros_like(square), where=square > 0)
    return 1 - np.divide(explained, power, out=np.full_like(power, np.nan), where=power > 0)


def _misfit(normals: Array, samples: Array, valid: NDArray[np.bool_], toward: Array) -> float:
    each = misfits(normals, samples, valid, toward)
    return float(np.nanmedian(each)) if np.isfinite(each).any() else 1.0


def _least_squares(samples: Array, valid: NDArray[np.bool_], toward: Array) -> float:
    """Return the misfit of each pixel's own least squares over its lit samples."""
    used = valid * (samples > 0.05 * samples.max(1, keepdims=True))
    matrix = np.einsum("pf,pfi,pfj->pij", used, toward, toward) + 1e-9 * np.eye(3)
    b = np.linalg.solve(matrix, np.einsum("pf,pfi,pf->pi", used, toward, samples)[..., None])[..., 0]
    return _misfit(b, samples, valid, toward)
