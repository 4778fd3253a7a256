"""Which convention the photographs prove: axes of the lights and normals, how the map lies, which row is whose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solve.axes import AXES

Array = NDArray[np.float64]
_HIGHLIGHT = 3.0
"""Times a pixel's median above which its samples are cut: gloss."""
_LIT = 0.25


@dataclass(frozen=True)
class Arrangement:
    """A way in which a normal map may have been stored.

    Parameters
    ----------
    words : str
        What was done to it; empty: nothing.
    places : (H, W) int
        Of each pixel's normal, in the file's map, row by row.
    """

    words: str
    places: NDArray[np.intp]


def arrangements(height: int, width: int) -> list[Arrangement]:
    """Return the ways to mirror, turn and transpose a map of a size; the first changes nothing."""
    grid = np.arange(height * width).reshape(height, width)
    found = [
        Arrangement("", grid),
        Arrangement("mirrored left to right", grid[:, ::-1]),
        Arrangement("mirrored top to bottom", grid[::-1]),
        Arrangement("turned by 180 degrees", grid[::-1, ::-1]),
        Arrangement("stored column by column (transposed)", grid.reshape(width, height).T),
    ]
    if height == width:
        found += [
            Arrangement("transposed about the other diagonal", grid[::-1, ::-1].T),
            Arrangement("turned by 90 degrees", np.rot90(grid)),
            Arrangement("turned by 90 degrees", np.rot90(grid, 3)),
        ]
    return found


class Evidence:
    """The samples (P, N) of a dataset, against which conventions are tried.

    Parameters
    ----------
    gray : (P, N) float
        Divided by the intensities.
    clipped : (P, N) bool
    """

    def __init__(self, gray: Array, clipped: NDArray[np.bool_]) -> None:
        self.gray = np.maximum(gray, 0).astype(np.float64)
        middle = np.median(self.gray, axis=1, keepdims=True)
        self.known = ~clipped
        self._cut = np.minimum(self.gray, _HIGHLIGHT * np.maximum(middle, 1e-9) + 1e-12)
        self._centred = self._centre(self._cut)

    def _centre(self, values: Array) -> Array:
        count = np.maximum(self.known.sum(1, keepdims=True), 1)
        return self.known * (values - (values * self.known).sum(1, keepdims=True) / count)

    def agreement(self, normals: Array, lights: Array) -> float:
        """Return the median over pixels of the correlation, over lights, of samples with max(0, l . n).

        Parameters
        ----------
        normals : (P, 3) float64
            NaN: not counted.
        lights : (N, 3) float64
        """
        known = np.isfinite(normals[:, 0])
        if known.sum() < 0.2 * len(known):
            return 0.0
        shade = self._centre(np.maximum(np.where(known[:, None], normals, 0) @ lights.T, 0))
        power = np.sqrt((shade**2).sum(1) * (self._centred**2).sum(1))
        inner = (shade * self._centred).sum(1)
        correlation = np.divide(inner, power, out=np.zeros_like(inner), where=power > 1e-12)
        return float(np.median(correlation[known]))

    def all_axes(self, normals: Array, lights: Array) -> Array:
        """Return the agreement (48,) in each of `AXES`, applied to the normals."""
        return np.array([self.agreement(normals @ axes.T, lights) for axes in AXES])

    def rows_of(self, normals: Array, lights: Array) -> Array:
        """Return (N, N) correlation, over pixels, of each photograph with the shading by each row of the lights.

        Both less what all lights have in common, and by the pixel's albedo.
        """
        known = np.isfinite(normals[:, 0])
        shade = np.maximum(normals[known] @ lights.T, 0)
        mean = shade.mean(1, keepdims=True)
        seen = self._cut[known]
        albedo = seen.mean(1, keepdims=True) / np.maximum(mean, 1e-3)
        seen, shade = seen / np.maximum(albedo, 1e-9) - mean, shade - mean
        seen, shade = (part - part.mean(0) for part in (seen, shade))
        power = np.sqrt((seen**2).sum(0)[:, None] * (shade**2).sum(0)[None])
        return seen.T @ shade / np.maximum(power, 1e-12)


def fitted_intensities(values: NDArray, intensities: Array, normals: Array, lights: Array) -> Array:
    """Return each light's intensity (N, 3) as the photographs have it, up to one factor a channel.

    Parameters
    ----------
    values : (P, N, 3) float
        As photographed.
    intensities : (N, 3) float64
        As given: where the search starts.
    normals, lights
        In one frame.

    Notes
    -----
    value = albedo * intensity * max(0, l . n): medians over pixels and lights in turn, of logarithms, over lit samples.
    """
    known = np.isfinite(normals[:, 0])
    shade = (normals[known] @ lights.T)[..., None]
    seen = values[known].astype(np.float64)
    lit = (shade > _LIT) & (seen > 0.002) & (seen < 0.98)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(lit, np.log(seen) - np.log(np.where(shade > _LIT, shade, 1)), np.nan)
    found = np.log(intensities) - np.log(intensities).mean(0)
    for _ in range(20):
        albedo = _median(ratio - found, 1)
        found = np.nan_to_num(_median(ratio - albedo[:, None], 0), nan=0.0)
        found -= found.mean(0)
    return np.exp(found)


def _median(values: Array, axis: int) -> Array:
    """Return medians without NaN; NaN where there is nothing."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmedian(values, axis=axis)
