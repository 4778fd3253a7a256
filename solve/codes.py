"""Codes to gray samples, inside the kernels: a tile of pixels of one frame at a time, no float copy of the stack.

A tile is a stretch of pixels in one row. Its loops run over memory in order: the compiler makes vectors of them.
"""

import numba
import numpy as np

TILE = 512
"""Pixels a tile: its samples under a hundred lights, and the sums over them, stay in a core's own cache."""


@numba.njit(nogil=True, cache=True, inline="always")
def tile_at(shape, frame, row, column):  # pragma: no cover
    """Return where in the flat codes a pixel starts; `shape` is (frames, height, width)."""
    return ((frame * shape[1] + row) * shape[2] + column) * 3


@numba.njit(nogil=True, cache=True)
def tile_gray(values, at, count, black, weights, gray):  # pragma: no cover
    """Write the weighted sum of the channels of `count` pixels from `at` on to `gray` (count,) float32.

    `values` are flat codes, whose weights hold the frame's gain and the code of white, or linear. Unsigned indices:
    with signed ones numba looks for negative ones, and the loop is five times slower.
    """
    red, green, blue = weights
    pixels = values[at : at + 3 * count]
    for i in range(count):
        j = np.uint64(3 * i)
        gray[i] = (
            (np.float32(pixels[j]) - black) * red
            + (np.float32(pixels[j + np.uint64(1)]) - black) * green
            + (np.float32(pixels[j + np.uint64(2)]) - black) * blue
        )


@numba.njit(nogil=True, cache=True)
def tile_clipped(band, frame, row, column, count, clipped):  # pragma: no cover
    """Write to `clipped` (count,) whether a pixel, or one within the margin of it, is clipped; say whether any is.

    `clipped` is written only where one is: most tiles have none, and finding that out costs a look at each code.
    """
    codes, shape, limit, margin = band.codes, band.shape, band.limit, band.margin
    first, last = max(row - margin, 0), min(row + margin, shape[1] - 1)
    left, right = max(column - margin, 0), min(column + count + margin, shape[2])
    top = codes[tile_at(shape, frame, row, column)]
    for line in range(first, last + 1):
        at = tile_at(shape, frame, line, left)
        pixels = codes[at : at + 3 * (right - left)]
        for k in range(len(pixels)):
            top = max(top, pixels[k])
    if top < limit:
        return False
    clipped[:count] = False
    for line in range(first, last + 1):
        for x in range(left, right):
            at = tile_at(shape, frame, line, x)
            if max(codes[at], codes[at + 1], codes[at + 2]) >= limit:
                for i in range(max(x - margin - column, 0), min(x + margin + 1 - column, count)):
                    clipped[i] = True
    return True


@numba.njit(nogil=True, cache=True)
def read_gray(band, weights):  # pragma: no cover
    """Return the gray samples (P, F) float32 of a `solve.samples.Band`, and which are not clipped (P, F) bool.

    `weights` (F, 3) float32 are those of the linear channels.
    """
    codes, shape, ambient, runs = band.codes, band.shape, band.ambient, band.runs
    lights = shape[0]
    pixels = runs[-1, 3] + runs[-1, 2]
    gray = np.empty((pixels, lights), np.float32)
    valid = np.ones((pixels, lights), np.bool_)
    line, behind = np.empty(TILE, np.float32), np.zeros(TILE, np.float32)
    clipped = np.empty(TILE, np.bool_)
    for n in range(len(runs)):
        row, start, total, place = runs[n]
        for done in range(0, total, TILE):
            count, column = min(TILE, total - done), start + done
            for k in range(lights):
                red, green, blue = weights[k]
                u = band.unit[k]
                tile_gray(
                    codes, tile_at(shape, k, row, column), count, band.black, (red * u, green * u, blue * u), line
                )
                if len(ambient):
                    at = tile_at(shape, 0, row, column)
                    tile_gray(ambient, at, count, np.float32(0), (red, green, blue), behind)
                for i in range(count):
                    gray[place + done + i, k] = line[i] - behind[i]
                if tile_clipped(band, k, row, column, count, clipped):
                    for i in range(count):
                        valid[place + done + i, k] = not clipped[i]
    return gray, valid
