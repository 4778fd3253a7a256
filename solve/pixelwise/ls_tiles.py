"""Least squares under distant lights straight from the codes, a tile of pixels at a time, at the speed of reading them.

The same fit and the same judgement as `solve.pixelwise.ls` with `solve.assess`, which `tests/solve/test_ls_tiles.py`
holds it to. A tile's samples stay in a core's cache: they are read once for the fit, again for the judgement. Arrays
are flat, their rows a constant `TILE` apart, and indices are unsigned: only so does the compiler see that rows do not
overlap and no index is negative, and make vectors of the loops.
"""

import numba
import numpy as np

from solve.assess import condition_and_inverse, sigma_deg
from solve.codes import tile_at, tile_clipped, tile_gray, tile_without_ambient
from solve.pixelwise.kernels import SINGULAR, solve_sums

TILE = 128
"""Pixels a tile: its samples under sixty lights and all sums stay in a core's innermost cache."""
_u = np.uint64


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _add_light(line, threshold, n, light, place, gray, sums):  # pragma: no cover
    """Write the samples above the threshold to `gray`, from `place` on, 0 for the others; return how many they are.

    Add them to the right side of the normal equations.
    """
    x, y, z = light
    kept = np.int32(0)
    for i in range(n):
        lit = line[_u(i)] > threshold
        m = line[_u(i)] if lit else np.float32(0)
        gray[_u(place + i)] = m
        kept = np.int32(kept + np.int32(lit))
        value = np.float64(m)
        sums[_u(i)] += value * x
        sums[_u(TILE + i)] += value * y
        sums[_u(2 * TILE + i)] += value * z
    return kept


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _add_matrix(gray, place, n, products, sums):  # pragma: no cover
    """Add a light where it is lit to the upper triangle of the normal matrix, and to how many lights there are."""
    xx, xy, xz, yy, yz, zz = products[0], products[1], products[2], products[3], products[4], products[5]
    for i in range(n):
        lit = 1.0 if gray[_u(place + i)] > 0 else 0.0
        sums[_u(3 * TILE + i)] += lit * xx
        sums[_u(4 * TILE + i)] += lit * xy
        sums[_u(5 * TILE + i)] += lit * xz
        sums[_u(6 * TILE + i)] += lit * yy
        sums[_u(7 * TILE + i)] += lit * yz
        sums[_u(8 * TILE + i)] += lit * zz
        sums[_u(9 * TILE + i)] += lit


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _judge_light(codes, at, dark, n, light, how, gray, b, sums):  # pragma: no cover
    """Add a light to the five `sums`: squared residuals, squared shading, and each channel times its shading.

    `b` are the three rows of the normal and one of the length; `how`: black, unit, and one over the intensities.
    """
    (black, unit, red, green, blue), none = how, np.float32(0)
    x, y, z = np.float32(light[0]), np.float32(light[1]), np.float32(light[2])
    for i in range(n):
        j, m = _u(at + 3 * i), gray[_u(i)]
        shade = x * b[_u(i)] + y * b[_u(TILE + i)] + z * b[_u(2 * TILE + i)]
        gap = m - shade * b[_u(3 * TILE + i)]
        sums[_u(i)] += gap * gap if m > none else none
        facing = max(shade, none) if m > none else none
        sums[_u(TILE + i)] += facing * facing
        r = (np.float32(codes[j]) - black) * unit - dark[_u(i)]
        g = (np.float32(codes[j + _u(1)]) - black) * unit - dark[_u(TILE + i)]
        a = (np.float32(codes[j + _u(2)]) - black) * unit - dark[_u(2 * TILE + i)]
        sums[_u(2 * TILE + i)] += r * (red * facing)
        sums[_u(3 * TILE + i)] += g * (green * facing)
        sums[_u(4 * TILE + i)] += a * (blue * facing)


@numba.njit(nogil=True, cache=True)
def _solve_tile(total, n, fit):  # pragma: no cover
    """Write each pixel's normal and its length, 0 where too few lights are left."""
    for i in range(n):
        sums = (
            total[3 * TILE + i], total[4 * TILE + i], total[5 * TILE + i], total[6 * TILE + i], total[7 * TILE + i],
            total[8 * TILE + i], total[i], total[TILE + i], total[2 * TILE + i],
        )  # fmt: skip
        x, y, z, well = solve_sums(sums, SINGULAR)
        length = np.sqrt(x * x + y * y + z * z) if well and total[9 * TILE + i] >= 3.0 else 0.0
        per = 1.0 / length if length > 0.0 else 0.0
        fit[i], fit[TILE + i], fit[2 * TILE + i], fit[3 * TILE + i] = x * per, y * per, z * per, length


@numba.njit(nogil=True, cache=True)
def fit_tiles(band, directions, intensities, weights, threshold):  # pragma: no cover
    """Fit and judge the pixels of a band under distant lights: directions and intensities (F, 3) float64.

    `weights` (F, 3) float32 are those of the linear channels, for gray; samples above the `threshold`, which is above
    0, are used. Returns what `solve.assess.assess` does; the last array (P,) marks the pixels that are not done here:
    too few samples above the threshold.
    """
    codes, shape, ambient, black, unit, runs = band.codes, band.shape, band.ambient, band.black, band.unit, band.runs
    pixels, lights = runs[-1, 3] + runs[-1, 2], shape[0]
    normals, albedo = np.empty((pixels, 3), np.float32), np.empty((pixels, 3), np.float32)
    count, is_left = np.empty(pixels, np.uint16), np.zeros(pixels, np.bool_)
    condition, sigma = np.empty(pixels, np.float32), np.empty(pixels, np.float32)
    threshold, per = np.float32(threshold), (1.0 / intensities).astype(np.float32)
    line, clipped, dark = np.empty(TILE, np.float32), np.empty(TILE, np.bool_), np.zeros(3 * TILE, np.float32)
    gray, kept = np.empty(lights * TILE, np.float32), np.empty(lights, np.int32)
    total, judged, fit = np.empty(10 * TILE), np.empty(5 * TILE, np.float32), np.empty(4 * TILE, np.float32)
    x, y, z = directions.T
    products, common = np.stack((x * x, x * y, x * z, y * y, y * z, z * z, np.ones(lights)), 1), np.empty(7)
    before = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    found, inverse = condition_and_inverse(*before)
    for run in range(len(runs)):
        row, start, length, first = runs[run]
        for done in range(0, length, TILE):
            n, column = min(TILE, length - done), start + done
            below = tile_at(shape, 0, row, column)
            total[:] = 0.0
            judged[:] = 0.0
            common[:] = 0.0
            for k in range(lights):
                red, green, blue = weights[k]
                u, at = unit[k], tile_at(shape, k, row, column)
                tile_gray(codes, at, n, black, (red * u, green * u, blue * u), line)
                if len(ambient):
                    tile_without_ambient(ambient, below, n, (red, green, blue), line)
                if tile_clipped(band, k, row, column, n, clipped):
                    for i in range(n):
                        line[i] = np.float32(0) if clipped[i] else line[i]
                light = directions[k, 0], directions[k, 1], directions[k, 2]
                kept[k] = _add_light(line, threshold, n, light, k * TILE, gray, total)
                # Most lights reach all of a tile, or nothing of it.
                if kept[k] == n:
                    for entry in range(7):
                        common[entry] += products[k, entry]
                elif kept[k]:
                    _add_matrix(gray, k * TILE, n, products[k], total)
            for entry in range(7):
                for i in range(n):
                    total[(3 + entry) * TILE + i] += common[entry]
            _solve_tile(total, n, fit)
            if len(ambient):
                for i in range(n):
                    for c in range(3):
                        dark[c * TILE + i] = ambient[below + 3 * i + c]
            for k in range(lights):
                if kept[k]:
                    light, at = (directions[k, 0], directions[k, 1], directions[k, 2]), tile_at(shape, k, row, column)
                    how = black, unit[k], per[k, 0], per[k, 1], per[k, 2]
                    _judge_light(codes, at, dark, n, light, how, gray[k * TILE :], fit, judged)
            for i in range(n):
                p = first + done + i
                matrix = (
                    total[3 * TILE + i], total[4 * TILE + i], total[5 * TILE + i],
                    total[6 * TILE + i], total[7 * TILE + i], total[8 * TILE + i],
                )  # fmt: skip
                # Neighbours are lit by the same lights, as a rule.
                if matrix != before:
                    (found, inverse), before = condition_and_inverse(*matrix), matrix
                size, bottom = total[9 * TILE + i], judged[TILE + i]
                normal = fit[i], fit[TILE + i], fit[2 * TILE + i]
                normals[p, 0], normals[p, 1], normals[p, 2] = normal
                for c in range(3):
                    albedo[p, c] = judged[(2 + c) * TILE + i] / bottom if bottom > 0.0 else np.nan
                count[p], condition[p], is_left[p] = size, found, fit[3 * TILE + i] == 0.0
                if not is_left[p]:
                    sigma[p] = sigma_deg(fit[3 * TILE + i], normal, judged[i], size, inverse)
    return normals, albedo, count, condition, sigma, is_left
