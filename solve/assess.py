"""What a fit is worth, pixel by pixel: albedo, sigma; the same for every method."""

import numba
import numpy as np
from numpy.typing import NDArray

from solve.codes import tile_at
from solve.pixelwise.kernels import NOTHING, adjugate, light_vector, with_sample

DARK = 0.02
"""Samples under this share of the stack's 99th percentile are not lit: they cannot count among the three."""
FACING = 0.1
"""Cosine under which a sample says more of the noise than of its light or its albedo."""
AMPLIFIED = 20.0
"""Condition number of light vectors from which noise across their plane comes twentyfold."""


@numba.njit(nogil=True, cache=True)
def sigma_deg(length, normal, squares, count, det, adjoint):  # pragma: no cover
    """Return the standard deviation of a normal, degrees along one tangent axis; NaN where nothing checks the fit.

    `length` is that of b, `squares` the sum of the squared residuals of `count` samples, `det` and
    `adjoint` those of the normal matrix, the latter's upper triangle.

    Notes
    -----
    cov b = s^2 (sum v v^T)^-1 with s^2 = squares / (count - 3); what of it lies across the normal, divided by
    |b|: sigma^2 = (trace(cov b) - n^T cov b n) / (2 |b|^2). At most 90 degrees.
    """
    if count <= 3 or not det > 0.0:
        return np.nan
    x, y, z = normal
    ia, ib, ic, id_, ie, if_ = adjoint
    along = x * (ia * x + 2.0 * (ib * y + ic * z)) + y * (id_ * y + 2.0 * ie * z) + z * z * if_
    across = max(ia + id_ + if_ - along, 0.0) * squares / (det * (count - 3))
    return min(np.degrees(np.sqrt(0.5 * across) / length), 90.0)


@numba.njit(nogil=True, cache=True)
def assess(band, samples, b, intensities, dark, shades):  # pragma: no cover
    """Judge the fits b (P, 3) of the pixels of a band to their samples, `samples.valid` being those that were used.

    `intensities` (F, 3) are the lights', `dark` the gray value under which a sample is not lit, `shades` (P, F) what is
    seen of albedo 1 where it is not v . n; else empty.

    Returns
    -------
    normals, albedo : (P, 3) float32
        Unit; NaN where b is zero. Per channel sum(m s) / sum(s^2) over the used samples that face the light, s = v . n,
        m the sample divided by its light's intensity, as in the fit of the normal: how strong a flash was changes
        nothing.
    count : (P,) uint16
        Used samples.
    sigma : (P,) float32
        See `sigma_deg`.
    doubts : (2,) int64
        Pixels with fewer than three used samples that are lit; pixels whose used lights lie nearly in a plane.
    """
    gray, used, points, geometry = samples
    codes, shape, ambient, black, unit, runs = band.codes, band.shape, band.ambient, band.black, band.unit, band.runs
    pixels, lights = used.shape
    normals = np.full((pixels, 3), np.nan, np.float32)
    albedo = np.full((pixels, 3), np.nan, np.float32)
    count = np.zeros(pixels, np.uint16)
    sigma = np.full(pixels, np.nan, np.float32)
    doubts = np.zeros(2, np.int64)
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
            sums, bottom, squares = NOTHING, 0.0, 0.0
            top[:] = 0.0
            size = lit = 0
            for k in range(lights):
                if not used[i, k]:
                    continue
                x, y, z = light_vector(k, points[i], geometry)
                sums = with_sample(sums, x, y, z, gray[i, k])
                shade = shades[i, k] if len(shades) else x * normal[0] + y * normal[1] + z * normal[2]
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
            xx, xy, xz, yy, yz, zz, _, _, _ = sums
            det, adjoint = adjugate(xx, xy, xz, yy, yz, zz)
            doubts[0] += lit < 3
            # trace(M) trace(M^-1) is twice the condition number's square where two of three are far from the third.
            spread = (xx + yy + zz) * (adjoint[0] + adjoint[3] + adjoint[5])
            doubts[1] += not spread <= 2.0 * AMPLIFIED * AMPLIFIED * det
            sigma[i] = sigma_deg(length, (normal[0], normal[1], normal[2]), squares, size, det, adjoint)
            if bottom > 0.0:
                for channel in range(3):
                    albedo[i, channel] = top[channel] / bottom
    return normals, albedo, count, sigma, doubts


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
