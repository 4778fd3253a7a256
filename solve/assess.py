"""What a fit is worth, pixel by pixel: albedo, condition number, sigma; the same for every method."""

import numba
import numpy as np
from numpy.typing import NDArray

from solve.codes import tile_at
from solve.pixelwise.kernels import adjugate, light_vector

DARK = 0.02
"""Samples under this share of the stack's 99th percentile are not lit: they cannot count among the three."""


@numba.njit(nogil=True, cache=True)
def condition_and_inverse(a, b, c, d, e, f):  # pragma: no cover
    """Return the condition number of light vectors, and the inverse of their normal matrix, from its upper triangle.

    The matrix is the sum of v v^T: its eigenvalues are the squares of the singular values. In closed form
    [Smith1961]. The inverse is an upper triangle too.
    """
    mean = (a + d + f) / 3.0
    x, y, z = a - mean, d - mean, f - mean
    spread = np.sqrt(max((x * x + y * y + z * z + 2.0 * (b * b + c * c + e * e)) / 6.0, 0.0))
    det, (ia, ib, ic, id_, ie, if_) = adjugate(a, b, c, d, e, f)
    condition = 1.0
    if spread > 1e-12 * mean:
        centred = x * (y * z - e * e) - b * (b * z - c * e) + c * (b * e - c * y)
        angle = np.arccos(min(1.0, max(-1.0, 0.5 * centred / (spread * spread * spread)))) / 3.0
        first = np.cos(angle)
        # cos(angle - 120 degrees) without another cosine: angle is at most 60 degrees.
        second = 0.5 * (np.sqrt(max(3.0 * (1.0 - first * first), 0.0)) - first)
        most, middle = mean + 2.0 * spread * first, mean + 2.0 * spread * second
        # Not by the third cosine, which cancels; the product of the three is the determinant. Of a single light both
        # the middle one and the determinant are rounding, of either sign: the cosines are good to 1e-8.
        spans = det > 0.0 and middle > 1e-7 * mean
        condition = np.sqrt(most * (most * middle) / det) if spans else np.inf
    if det <= 0.0:
        return np.inf, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return condition, (ia / det, ib / det, ic / det, id_ / det, ie / det, if_ / det)


@numba.njit(nogil=True, cache=True)
def sigma_deg(length, normal, squares, count, inverse):  # pragma: no cover
    """Return the standard deviation of a normal, degrees along one tangent axis; NaN where nothing checks the fit.

    `length` is that of b, `squares` the sum of the squared residuals of `count` samples, `inverse` the upper triangle
    of the inverse of the normal matrix.

    Notes
    -----
    cov b = s^2 (sum v v^T)^-1 with s^2 = squares / (count - 3); what of it lies across the normal, divided by
    |b|: sigma^2 = (trace(cov b) - n^T cov b n) / (2 |b|^2). At most 90 degrees.
    """
    if count <= 3:
        return np.nan
    x, y, z = normal
    ia, ib, ic, id_, ie, if_ = inverse
    along = x * (ia * x + 2.0 * (ib * y + ic * z)) + y * (id_ * y + 2.0 * ie * z) + z * z * if_
    across = max(ia + id_ + if_ - along, 0.0) * squares / (count - 3)
    return min(np.degrees(np.sqrt(0.5 * across) / length), 90.0)


@numba.njit(nogil=True, cache=True)
def assess(band, samples, b, intensities, dark):  # pragma: no cover
    """Judge the fits b (P, 3) of the pixels of a band to their samples, `samples.valid` being those that were used.

    `intensities` (F, 3) are the lights', `dark` the gray value under which a sample is not lit.

    Returns
    -------
    normals, albedo : (P, 3) float32
        Unit; NaN where b is zero. Per channel sum(m s) / sum(s^2) over the used samples that face the light, s = v . n,
        m the sample divided by its light's intensity, as in the fit of the normal: how strong a flash was changes
        nothing.
    count : (P,) uint16
        Used samples.
    condition, sigma : (P,) float32
        Condition number of the used light vectors; see `sigma_deg`.
    is_dark : (P,) bool
        Fewer than three used samples are lit.
    """
    gray, used, points, geometry = samples
    codes, shape, ambient, black, unit, runs = band.codes, band.shape, band.ambient, band.black, band.unit, band.runs
    pixels, lights = used.shape
    normals = np.full((pixels, 3), np.nan, np.float32)
    albedo = np.full((pixels, 3), np.nan, np.float32)
    count = np.zeros(pixels, np.uint16)
    condition = np.full(pixels, np.nan, np.float32)
    sigma = np.full(pixels, np.nan, np.float32)
    is_dark = np.zeros(pixels, np.bool_)
    normal, top = np.empty(3), np.empty(3)
    # Three divisions a sample would take as long as all the rest.
    per_intensity = 1.0 / intensities
    for run in range(len(runs)):
        row, start, total, place = runs[run]
        for i in range(place, place + total):
            length = np.sqrt(b[i, 0] * b[i, 0] + b[i, 1] * b[i, 1] + b[i, 2] * b[i, 2])
            if not length > 0.0:
                continue
            for axis in range(3):
                normal[axis] = b[i, axis] / length
            column = start + i - place
            behind = tile_at(shape, 0, row, column)
            xx = xy = xz = yy = yz = zz = bottom = squares = 0.0
            top[:] = 0.0
            size = lit = 0
            for k in range(lights):
                if not used[i, k]:
                    continue
                x, y, z = light_vector(k, points[i], geometry)
                xx += x * x
                xy += x * y
                xz += x * z
                yy += y * y
                yz += y * z
                zz += z * z
                shade = x * normal[0] + y * normal[1] + z * normal[2]
                gap = gray[i, k] - shade * length
                squares += gap * gap
                size += 1
                lit += gray[i, k] > dark
                if shade <= 0.0:
                    continue
                bottom += shade * shade
                at = tile_at(shape, k, row, column)
                for channel in range(3):
                    value = (np.float32(codes[at + channel]) - black) * unit[k]
                    if len(ambient):
                        value -= ambient[behind + channel]
                    top[channel] += value * per_intensity[k, channel] * shade
            normals[i] = normal
            count[i] = size
            is_dark[i] = lit < 3
            condition[i], inverse = condition_and_inverse(xx, xy, xz, yy, yz, zz)
            sigma[i] = sigma_deg(length, (normal[0], normal[1], normal[2]), squares, size, inverse)
            if bottom > 0.0:
                for channel in range(3):
                    albedo[i, channel] = top[channel] / bottom
    return normals, albedo, count, condition, sigma, is_dark


def shared_sigma_deg(normals: NDArray, directions: NDArray, covariance: NDArray) -> NDArray[np.float32]:
    """Return what errors of the intensities do to normals (..., 3): standard deviation along one tangent axis, degrees.

    `directions` (F, 3) and `covariance` (F, F) of the relative errors; every light is taken to be lit.

    Notes
    -----
    db = L+ diag(d) L b for errors d, to first order; the mean square of its part across the normal.
    """
    inverse = np.linalg.pinv(directions)
    change = (inverse[:, None] * directions.T).reshape(9, -1)
    squares = (change @ covariance @ change.T).reshape(3, 3, 3, 3)
    whole = np.einsum("ijil->jl", squares)
    found = np.full(normals.shape[:-1], np.nan, np.float32)
    for row, n in enumerate(normals):
        twice = (n[..., None] * n[..., None, :]).reshape(*n.shape[:-1], 9)
        along = np.sum(twice @ squares.reshape(9, 9) * twice, -1)
        across = np.maximum(twice @ whole.reshape(9) - along, 0)
        found[row] = np.degrees(np.sqrt(0.5 * across))
    return found
