"""Least squares under distant lights straight from the codes, a tile of pixels at a time, at the speed of reading them.

The same fit and the same judgement as `solve.pixelwise.ls` with `solve.assess`, which `tests/solve/test_ls_tiles.py`
holds it to.
"""

import numba
import numpy as np

from solve.codes import tile_at, tile_clipped
from solve.pixelwise.tile_judgement import (
    MATRIX_ROWS,
    RESULT_ROWS,
    albedo_of_facing,
    find_behind,
    fit_and_judge,
    matrices,
)
from solve.pixelwise.tile_sums import (
    LIGHTS,
    SAMPLE_ROWS,
    SUM_ROWS,
    TILE,
    WORD,
    add_channel,
    add_squares,
    ask_for,
    drop_clipped,
    flush,
    read_ambient,
    read_lit,
)

_u = np.uint64


@numba.njit(nogil=True, cache=True)
def _sum_tile(
    store, at, ahead, place, n, weights, vectors, cut, dark, clipped, samples, bits, part, total
):  # pragma: no cover
    """Write the sums over the lights of the samples that are kept to `total`, and which are to `bits`.

    `at` is the tile's row and column, `ahead` those of the next one, `place` how many pixels that has.
    """
    codes, shape, ambient, black, unit, limit, margin = store
    lights = shape[0]
    total[:] = 0.0
    bits[:] = 0
    if len(ambient):
        read_ambient(ambient, tile_at(shape, 0, at[0], at[1]), n, dark)
    for first in range(0, lights, LIGHTS):
        for step in range(LIGHTS):
            k, place_of = first + step, step * SAMPLE_ROWS * TILE
            if k >= lights:
                for i in range(SAMPLE_ROWS * TILE):
                    samples[_u(place_of + i)] = np.float32(0)
                continue
            start = tile_at(shape, k, ahead[0], ahead[1])
            ask_for(codes, start, start + 3 * (place // 2))
            bit = np.int32(1) << np.int32(k % WORD)
            read_lit(
                codes, tile_at(shape, k, at[0], at[1]), n, black, dark, np.float32(1) / unit[k], weights[k, 0],
                weights[k, 1], weights[k, 2], cut, bit, samples, place_of, bits, k // WORD,
            )  # fmt: skip
            if tile_clipped(codes, shape, k, at[0], at[1], n, limit, margin, clipped):
                drop_clipped(clipped, n, bit, samples, place_of, bits, k // WORD)
        for channel in range(3):
            # Half of the next tile while reading, half while summing: more at a time than memory answers would wait.
            start = tile_at(shape, min(first + channel, lights - 1), ahead[0], ahead[1])
            ask_for(codes, start + 3 * (place // 2), start + 3 * place)
            add_channel(samples, channel, vectors, first, n, part)
        start = tile_at(shape, min(first + 3, lights - 1), ahead[0], ahead[1])
        ask_for(codes, start + 3 * (place // 2), start + 3 * place)
        add_squares(samples, n, part)
        if (first + LIGHTS) % WORD == 0 or first + LIGHTS >= lights:
            flush(part, n, total)


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
        Not done here: too few samples above the threshold.
    """
    store = codes, shape, ambient, black, unit, limit, margin
    pixels, lights = runs[-1, 3] + runs[-1, 2], shape[0]
    normals, albedo = np.empty((pixels, 3), np.float32), np.empty((pixels, 3), np.float32)
    count = np.empty(pixels, np.uint16)
    condition, sigma = np.empty(pixels, np.float32), np.empty(pixels, np.float32)
    is_left = np.zeros(pixels, np.bool_)
    of_all = np.zeros(6)
    steps = (lights + LIGHTS - 1) // LIGHTS
    factors, vectors = np.empty((lights, 3)), np.zeros((steps * LIGHTS, 3, 3), np.float32)
    gray_weights = np.empty((lights, 3), np.float32)
    for k in range(lights):
        x, y, z = directions[k]
        of_all += np.array([x * x, x * y, x * z, y * y, y * z, z * z])
        for c in range(3):
            factors[k, c] = unit[k] / intensities[k, c]
            gray_weights[k, c] = weights[c] * factors[k, c]
            for axis in range(3):
                vectors[k, c, axis] = factors[k, c] * directions[k, axis]
    dark, clipped = np.zeros(3 * TILE, np.float32), np.empty(TILE, np.bool_)
    behind = np.empty(TILE, np.int32)
    samples = np.empty(LIGHTS * SAMPLE_ROWS * TILE, np.float32)
    part, total = np.zeros(SUM_ROWS * TILE, np.float32), np.empty(SUM_ROWS * TILE)
    bits = np.empty((lights + WORD - 1) // WORD * TILE, np.int32)
    matrix, result = np.empty(MATRIX_ROWS * TILE), np.empty(RESULT_ROWS * TILE, np.float32)
    for run in range(len(runs)):
        row, start, length, place = runs[run]
        for done in range(0, length, TILE):
            n, column, ahead = min(TILE, length - done), start + done, min(TILE, length - done - TILE)
            coming = row, column + TILE
            if ahead <= 0:
                following = min(run + 1, len(runs) - 1)
                coming, ahead = (runs[following, 0], runs[following, 1]), min(TILE, runs[following, 2])
            _sum_tile(
                store, (row, column), coming, ahead, n, gray_weights, vectors, np.float32(threshold), dark,
                clipped, samples, bits, part, total,
            )  # fmt: skip
            matrices(bits, directions, of_all, n, matrix)
            fit_and_judge(total, matrix, weights, n, result)
            find_behind(directions, bits, result, n, behind)
            for i in range(n):
                p = place + done + i
                if matrix[7 * TILE + i] == 0.0 or not result[7 * TILE + i] > 0.0:
                    is_left[p] = True
                    continue
                normals[p, 0], normals[p, 1], normals[p, 2] = result[i], result[TILE + i], result[2 * TILE + i]
                albedo[p, 0], albedo[p, 1] = result[3 * TILE + i], result[4 * TILE + i]
                albedo[p, 2] = result[5 * TILE + i]
                if behind[i]:
                    albedo_of_facing(store, row, column + i, i, directions, factors, bits, total, normals, albedo, p)
                sigma[p], condition[p] = result[6 * TILE + i], matrix[6 * TILE + i]
                count[p] = matrix[7 * TILE + i]
    return normals, albedo, count, condition, sigma, is_left
