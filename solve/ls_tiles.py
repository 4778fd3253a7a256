"""Least squares under distant lights straight from the codes, a tile of pixels at a time, at the speed of reading them.

The same fit and the same judgement as `solve.ls` with `solve.assess`, which `tests/solve/test_ls_tiles.py` holds it to.
"""

import numba
import numpy as np

from solve.assess import condition_and_inverse, sigma_deg
from solve.decode import TILE, tile_at, tile_clipped, tile_without_ambient
from solve.kernels import SINGULAR, solve_sums

BLOCK = 8
"""Frames summed in float32, twice as many at a time as float64: it rounds no more than a sample was rounded by."""


@numba.njit(nogil=True, cache=True)
def _tile_channels(codes, at, count, black, red, green, blue, r, g, b):  # pragma: no cover
    """Write the channels, each times its factor, to r, g, b (count,) float32; see `tile_gray`."""
    pixels = codes[at : at + 3 * count]
    for i in range(count):
        j = np.uint64(3 * i)
        r[i] = (np.float32(pixels[j]) - black) * red
        g[i] = (np.float32(pixels[j + np.uint64(1)]) - black) * green
        b[i] = (np.float32(pixels[j + np.uint64(2)]) - black) * blue


@numba.njit(nogil=True, cache=True)
def _add(x, y, z, values, u, v, w, count):  # pragma: no cover
    """Add values (u, v, w) to three rows of sums."""
    u, v, w = np.float32(u), np.float32(v), np.float32(w)
    for i in range(count):
        m = values[i]
        x[i] += m * u
        y[i] += m * v
        z[i] += m * w


@numba.njit(nogil=True, cache=True)
def _add_squares(out, values, count):  # pragma: no cover
    for i in range(count):
        out[i] += values[i] * values[i]


@numba.njit(nogil=True, cache=True)
def _mask(r, g, b, gray, kept, out, count):  # pragma: no cover
    """Zero what is not kept, and write 1 to `out` where."""
    for i in range(count):
        w = np.float32(kept[i])
        r[i] *= w
        g[i] *= w
        b[i] *= w
        gray[i] *= w
        out[i] = np.float32(1) - w


@numba.njit(nogil=True, cache=True)
def _gray_above(r, g, b, red, green, blue, threshold, gray, kept, count):  # pragma: no cover
    """Write gray, and which are above the threshold; return how many are."""
    for i in range(count):
        gray[i] = r[i] * red + g[i] * green + b[i] * blue
    total = np.int32(0)
    for i in range(count):
        above = np.int32(gray[i] > threshold)
        kept[i] = above
        total = np.int32(total + above)
    return total


@numba.njit(nogil=True, cache=True)
def _flush(part, total):  # pragma: no cover
    """Add the float32 sums over a block of frames to the float64 sums over all, and begin anew."""
    for row in range(len(part)):
        line, whole = part[row], total[row]
        for i in range(TILE):
            whole[i] += line[i]
            line[i] = np.float32(0)


@numba.njit(nogil=True, cache=True)
def _back(kept, vector, x, y, z, away, count):  # pragma: no cover
    """Note in `away` the pixels with a kept sample whose light is behind the normal (x, y, z)."""
    u, v, w = np.float32(vector[0]), np.float32(vector[1]), np.float32(vector[2])
    for i in range(count):
        away[i] |= kept[i] & np.int32(x[i] * u + y[i] * v + z[i] * w <= np.float32(0))


@numba.njit(nogil=True, cache=True)
def fit_tiles(
    codes, shape, ambient, black, unit, limit, margin, runs, directions, intensities, weights, threshold
):  # pragma: no cover
    """Fit and judge runs of pixels under distant lights (F, 3).

    Parameters
    ----------
    codes, shape, ambient, black, unit, limit, margin, runs
        See `solve.samples.Band`.
    intensities : (F, 3) float64
    weights : (3,) float64
        Of the channels, for gray.
    threshold : float
        Samples above it are used.

    Returns
    -------
    normals, albedo, count, condition, sigma
        See `solve.assess.assess`. A sigma under 0.01 degrees is rounding.
    is_left : (P,) bool
        Not done here: too few samples above the threshold, or one whose light is behind the normal, which does not
        count for the albedo. One pass over the codes cannot know.
    """
    pixels, lights = runs[-1, 3] + runs[-1, 2], shape[0]
    normals = np.full((pixels, 3), np.nan, np.float32)
    albedo = np.full((pixels, 3), np.nan, np.float32)
    count = np.zeros(pixels, np.uint16)
    condition = np.full(pixels, np.nan, np.float32)
    sigma = np.full(pixels, np.nan, np.float32)
    is_left = np.zeros(pixels, np.bool_)
    matrix = np.dot(directions.T, directions)
    of_all = condition_and_inverse(matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[1, 1], matrix[1, 2], matrix[2, 2])
    wr, wg, wb = np.float32(weights[0]), np.float32(weights[1]), np.float32(weights[2])
    cut = np.float32(threshold)
    right, missing = np.empty((10, TILE)), np.empty((7, TILE))
    part, gaps = np.empty((10, TILE), np.float32), np.empty((7, TILE), np.float32)
    r, g, b, gray = (
        np.empty(TILE, np.float32),
        np.empty(TILE, np.float32),
        np.empty(TILE, np.float32),
        np.empty(TILE, np.float32),
    )
    out, kept, clipped = np.empty(TILE, np.float32), np.empty((lights, TILE), np.int32), np.empty(TILE, np.bool_)
    nx, ny, nz = np.empty(TILE, np.float32), np.empty(TILE, np.float32), np.empty(TILE, np.float32)
    away = np.empty(TILE, np.int32)
    sums = np.empty(9)
    for run in range(len(runs)):
        row, start, total, place = runs[run]
        for done in range(0, total, TILE):
            n, column = min(TILE, total - done), start + done
            first = place + done
            right[:] = 0.0
            missing[:] = 0.0
            part[:] = np.float32(0)
            gaps[:] = np.float32(0)
            for k in range(lights):
                x, y, z = directions[k]
                at, u = tile_at(shape, k, row, column), np.float64(unit[k])
                red, green, blue = 1.0 / intensities[k, 0], 1.0 / intensities[k, 1], 1.0 / intensities[k, 2]
                _tile_channels(
                    codes, at, n, black, np.float32(u * red), np.float32(u * green), np.float32(u * blue), r, g, b
                )
                if len(ambient):
                    behind, none = tile_at(shape, 0, row, column), np.float32(0)
                    tile_without_ambient(ambient, behind, n, np.float32(red), none, none, r)
                    tile_without_ambient(ambient, behind, n, none, np.float32(green), none, g)
                    tile_without_ambient(ambient, behind, n, none, none, np.float32(blue), b)
                above = _gray_above(r, g, b, wr, wg, wb, cut, gray, kept[k], n)
                if tile_clipped(codes, shape, k, row, column, n, limit, margin, clipped):
                    above = 0
                    for i in range(n):
                        if clipped[i]:
                            kept[k, i] = 0
                        above += kept[k, i]
                if above < n:
                    _mask(r, g, b, gray, kept[k], out, n)
                    _add(gaps[0], gaps[1], gaps[2], out, x * x, x * y, x * z, n)
                    _add(gaps[3], gaps[4], gaps[5], out, y * y, y * z, z * z, n)
                    _add_squares(gaps[6], out, n)
                if above > 0:
                    _add(part[0], part[1], part[2], r, x, y, z, n)
                    _add(part[3], part[4], part[5], g, x, y, z, n)
                    _add(part[6], part[7], part[8], b, x, y, z, n)
                    _add_squares(part[9], gray, n)
                if k % BLOCK == BLOCK - 1 or k == lights - 1:
                    _flush(part, right)
                    _flush(gaps, missing)
            for i in range(n):
                size = lights - int(missing[6, i])
                sums[0], sums[1], sums[2] = (
                    matrix[0, 0] - missing[0, i],
                    matrix[0, 1] - missing[1, i],
                    matrix[0, 2] - missing[2, i],
                )
                sums[3], sums[4], sums[5] = (
                    matrix[1, 1] - missing[3, i],
                    matrix[1, 2] - missing[4, i],
                    matrix[2, 2] - missing[5, i],
                )
                for axis in range(3):
                    sums[6 + axis] = (
                        weights[0] * right[axis, i] + weights[1] * right[3 + axis, i] + weights[2] * right[6 + axis, i]
                    )
                x, y, z, well = solve_sums(sums, SINGULAR)
                length = np.sqrt(x * x + y * y + z * z)
                p = first + i
                if size < 3 or not well or not length > 0.0:
                    is_left[p] = True
                    nx[i] = ny[i] = nz[i] = np.float32(1)
                    continue
                squares = max(right[9, i] - (x * sums[6] + y * sums[7] + z * sums[8]), 0.0)
                x, y, z = x / length, y / length, z / length
                found, ia, ib, ic, id_, ie, if_ = of_all
                if size < lights:
                    found, ia, ib, ic, id_, ie, if_ = condition_and_inverse(
                        sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
                    )
                nx[i], ny[i], nz[i] = x, y, z
                normals[p, 0], normals[p, 1], normals[p, 2] = x, y, z
                count[p], condition[p] = size, found
                sigma[p] = sigma_deg(length, x, y, z, squares, size, ia, ib, ic, id_, ie, if_)
                bottom = (
                    x * (sums[0] * x + 2.0 * (sums[1] * y + sums[2] * z))
                    + y * (sums[3] * y + 2.0 * sums[4] * z)
                    + z * z * sums[5]
                )
                for c in range(3):
                    albedo[p, c] = (right[3 * c, i] * x + right[3 * c + 1, i] * y + right[3 * c + 2, i] * z) / bottom
            away[:] = 0
            for k in range(lights):
                _back(kept[k], directions[k], nx, ny, nz, away, n)
            for i in range(n):
                is_left[first + i] |= away[i] != 0
    return normals, albedo, count, condition, sigma, is_left
