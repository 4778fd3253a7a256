"""Least squares with a constant shadow threshold: the baseline of photometric stereo."""

import numba
import numpy as np

from solve.assess import DARK
from solve.pixelwise.kernels import light_vector, normal_equations
from solve.pixelwise.ls_tiles import fit_tiles
from solve.samples import GRAY

SETTINGS = {"shadow_threshold": 0.02, "keep_clipped": False, "ceiling": np.inf}
"""Samples under this share of the stack's 99th percentile are taken as shadowed."""

SEED_SETTINGS = {**SETTINGS, "keep_clipped": True}
"""The plain reading: a constant shadow threshold, and not a word of clipped samples."""

PUBLISHED_SETTINGS = {"shadow_threshold": -np.inf, "keep_clipped": True, "ceiling": 1.0}
"""What DiLiGenT's published figures for least squares are [Shi2019]: no threshold, and gray, once divided by the
intensities that come with it, ends at 1 (`Lights` with those intensities as they are, not normalised)."""


def fit(gray, valid, points, directions, positions, reach, is_near, scale, *, shadow_threshold, keep_clipped, ceiling):
    """Fit b = albedo x normal to each pixel by linear least squares.

    Parameters
    ----------
    gray : (P, F) float32
        Samples divided by the lights' intensities.
    valid : (P, F) bool
        Not clipped.
    points : (P, 3) float64
        Where the pixels are, mm, for near lights.
    directions, positions : (F, 3) float64
    reach : (F,) float64
        Squared distance from each light to the reference point.
    is_near : bool
    scale : float
        99th percentile of the stack.
    shadow_threshold : float
        Share of `scale`; a constant, as the benchmark's text describes it [Berkiten2016].
    keep_clipped : bool
        Clipped samples count like any other.
    ceiling : float
        Gray ends here.

    Returns
    -------
    b : (P, 3) float64
        Zero where the lit lights do not span space.
    used : (P, F) bool
        The samples that the fit is based on.

    Notes
    -----
    b = argmin sum_{f in V} (l_f . b - m_f)^2, V = {m_f > threshold, not clipped} [Woodham1980]. Prefer
    `iterative` where there is gloss or cast shadow: least squares has no defence against either
    but the threshold.
    """
    if keep_clipped:
        valid = np.ones_like(valid)
    gray = np.minimum(gray, np.float32(ceiling)) if np.isfinite(ceiling) else gray
    return _fit(gray, valid, points, directions, positions, reach, is_near, shadow_threshold * scale)


@numba.njit(nogil=True, cache=True)
def _fit(gray, valid, points, directions, positions, reach, is_near, threshold):  # pragma: no cover
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    for i in range(pixels):
        for k in range(lights):
            vectors[k] = light_vector(k, points[i], directions, positions, reach, is_near)
            used[i, k] = valid[i, k] and gray[i, k] > threshold
        x, y, z, well = normal_equations(vectors, gray[i], used[i])
        if not well:
            # Too few lit samples: the shadowed ones still bound the normal, the clipped ones do not.
            for k in range(lights):
                used[i, k] = valid[i, k]
            x, y, z, well = normal_equations(vectors, gray[i], used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


def stream(band, lights, scale, *, shadow_threshold, keep_clipped, ceiling):
    """Fit and judge the pixels of a `solve.samples.Band` straight from the codes, where that can be done.

    Returns
    -------
    normals, albedo, count, condition, sigma, is_left
        See `solve.pixelwise.ls_tiles.fit_tiles`. None under near lights, whose vectors differ from pixel to pixel, and
        with settings that it does not know.
    """
    if lights.positions_mm is not None or keep_clipped or np.isfinite(ceiling) or shadow_threshold < DARK:
        return None
    directions, intensities = np.ascontiguousarray(lights.directions), np.ascontiguousarray(lights.intensities)
    store = (band.codes, band.shape, band.ambient, band.black, band.unit, band.limit, band.margin, band.runs)
    return fit_tiles(*store, directions, intensities, GRAY, shadow_threshold * scale)
