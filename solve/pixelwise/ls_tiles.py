"""Least squares under distant lights straight from the codes, a tile of pixels at a time, at the speed of reading them.

The same fit and the same judgement as `solve.pixelwise.ls` with `solve.assess`, which `tests/solve/test_ls_tiles.py`
holds it to.
"""

from typing import NamedTuple

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
    Reading,
    add_channel,
    add_squares,
    ask_for,
    drop_clipped,
    flush,
    read_ambient,
    read_lit,
)

_u = np.uint64


class Stretch(NamedTuple):
    """Pixels of one row: `count` from `column` on."""

    row: int
    column: int
    count: int


class Room(NamedTuple):
    """Arrays to work in, flat, rows a `TILE` apart: ambient light, clipped pixels, four lights' samples, which of a
    pixel's samples are kept (a bit each), their float32 and their float64 sums.
    """

    dark: np.ndarray
    clipped: np.ndarray
    samples: np.ndarray
    bits: np.ndarray
    part: np.ndarray
    total: np.ndarray


@numba.njit(nogil=True, cache=True)
def _sum_tile(band, tile, ahead, weights, vectors, cut, room):  # pragma: no cover
    """Write the sums over the lights of the samples that are kept, and which those are; `ahead` is the next tile."""
    codes, shape, ambient, unit = band.codes, band.shape, band.ambient, band.unit
    dark, clipped, samples, bits, part, total = room
    lights, n = shape[0], tile.count
    total[:] = 0.0
    bits[:] = 0
    if len(ambient):
        read_ambient(ambient, tile_at(shape, 0, tile.row, tile.column), n, dark)
    for first in range(0, lights, LIGHTS):
        for step in range(LIGHTS):
            k, place = first + step, step * SAMPLE_ROWS * TILE
            if k >= lights:
                for i in range(SAMPLE_ROWS * TILE):
                    samples[_u(place + i)] = np.float32(0)
                continue
            start = tile_at(shape, k, ahead.row, ahead.column)
            ask_for(codes, start, start + 3 * (ahead.count // 2))
            gray = weights[k, 0], weights[k, 1], weights[k, 2]
            bit = np.int32(1) << np.int32(k % WORD)
            how = Reading(band.black, np.float32(1) / unit[k], gray, cut, place, k // WORD, bit)
            read_lit(codes, tile_at(shape, k, tile.row, tile.column), n, dark, how, samples, bits)
            if tile_clipped(band, k, tile.row, tile.column, n, clipped):
                drop_clipped(clipped, n, how, samples, bits)
        for channel in range(3):
            # Half of the next tile while reading, half while summing: more at a time than memory answers would wait.
            start = tile_at(shape, min(first + channel, lights - 1), ahead.row, ahead.column)
            ask_for(codes, start + 3 * (ahead.count // 2), start + 3 * ahead.count)
            add_channel(samples, channel, vectors, first, n, part)
        start = tile_at(shape, min(first + 3, lights - 1), ahead.row, ahead.column)
        ask_for(codes, start + 3 * (ahead.count // 2), start + 3 * ahead.count)
        add_squares(samples, n, part)
        if (first + LIGHTS) % WORD == 0 or first + LIGHTS >= lights:
            flush(part, n, total)


@numba.njit(nogil=True, cache=True)
def fit_tiles(band, directions, intensities, weights, threshold):  # pragma: no cover
    """Fit and judge the pixels of a band under distant lights: directions and intensities (F, 3) float64.

    `weights` (3,) are those of the channels, for gray; samples above the `threshold` are used. Returns what
    `solve.assess.assess` does, a sigma under 0.01 degrees being rounding; the last array (P,) marks the pixels that are
    not done here: too few samples above the threshold.
    """
    shape, unit, runs = band.shape, band.unit, band.runs
    pixels, lights = runs[-1, 3] + runs[-1, 2], shape[0]
    normals, albedo = np.empty((pixels, 3), np.float32), np.empty((pixels, 3), np.float32)
    count = np.empty(pixels, np.uint16)
    condition, sigma = np.empty(pixels, np.float32), np.empty(pixels, np.float32)
    is_left = np.zeros(pixels, np.bool_)
    xx = xy = xz = yy = yz = zz = 0.0
    steps = (lights + LIGHTS - 1) // LIGHTS
    factors, vectors = np.empty((lights, 3)), np.zeros((steps * LIGHTS, 3, 3), np.float32)
    gray_weights = np.empty((lights, 3), np.float32)
    for k in range(lights):
        x, y, z = directions[k]
        xx, xy, xz, yy, yz, zz = xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z
        for c in range(3):
            factors[k, c] = unit[k] / intensities[k, c]
            gray_weights[k, c] = weights[c] * factors[k, c]
            for axis in range(3):
                vectors[k, c, axis] = factors[k, c] * directions[k, axis]
    room = Room(
        np.zeros(3 * TILE, np.float32),
        np.empty(TILE, np.bool_),
        np.empty(LIGHTS * SAMPLE_ROWS * TILE, np.float32),
        np.empty((lights + WORD - 1) // WORD * TILE, np.int32),
        np.zeros(SUM_ROWS * TILE, np.float32),
        np.empty(SUM_ROWS * TILE),
    )
    bits, total = room.bits, room.total
    behind = np.empty(TILE, np.int32)
    matrix, result = np.empty(MATRIX_ROWS * TILE), np.empty(RESULT_ROWS * TILE, np.float32)
    for run in range(len(runs)):
        row, start, length, place = runs[run]
        for done in range(0, length, TILE):
            n, column = min(TILE, length - done), start + done
            ahead = Stretch(row, column + TILE, min(TILE, length - done - TILE))
            if ahead.count <= 0:
                after = min(run + 1, len(runs) - 1)
                ahead = Stretch(runs[after, 0], runs[after, 1], min(TILE, runs[after, 2]))
            _sum_tile(band, Stretch(row, column, n), ahead, gray_weights, vectors, np.float32(threshold), room)
            matrices(bits, directions, (xx, xy, xz, yy, yz, zz), n, matrix)
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
                    where, lamps = (row, column + i, i), (directions, factors)
                    albedo_of_facing(band, where, lamps, bits, total, normals[p], albedo[p])
                sigma[p], condition[p] = result[6 * TILE + i], matrix[6 * TILE + i]
                count[p] = matrix[7 * TILE + i]
    return normals, albedo, count, condition, sigma, is_left
