"""The inner loops of `solve.pixelwise.ls_tiles`: a tile of pixels, four lights at a time, from codes to sums.

Every array is flat, its rows a constant `TILE` apart, and indices are unsigned: only so does the compiler see that rows
do not overlap and no index is negative, and make vectors of the loops. No views are passed: counting who holds them
costs as much as a loop. The codes of the next tile are asked for while this one is summed.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

TILE = 256
"""Pixels a tile: the samples of four lights and all sums stay in a core's innermost cache."""
LIGHTS = 4
"""Lights a step: the sums are loaded and stored once for all of them."""
WORD = 32
"""Lights a block: summed in float32, which rounds no more than a sample was rounded by; a bit each of one integer."""
SAMPLE_ROWS, SUM_ROWS = 4, 10
LINE = 64
"""Bytes that memory hands over at a time."""

_u = np.uint64


@intrinsic
def _ask_for(_: Any, array: Any, index: Any) -> Any:
    """Have the processor fetch an element into its cache; nothing waits for it."""

    def generate(context, builder, __, arguments):
        data = context.make_array(array)(context, builder, arguments[0]).data
        byte = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte.type, number, number, number])
        prefetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        # To read, to be kept in every cache, data.
        builder.call(prefetch, [byte, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


@numba.njit(nogil=True, cache=True)
def ask_for(codes, start, stop):  # pragma: no cover
    """Have codes from `start` to `stop` fetched in advance."""
    for at in range(start, min(stop, len(codes)), LINE // codes.itemsize):
        _ask_for(codes, at)  # pyright: ignore[reportCallIssue]


@numba.njit(nogil=True, cache=True)
def read_ambient(ambient, at, count, out):  # pragma: no cover
    """Write red, green and blue of a tile's ambient light to the three rows of `out`."""
    for i in range(count):
        j = _u(at + 3 * i)
        out[_u(i)], out[_u(TILE + i)], out[_u(2 * TILE + i)] = ambient[j], ambient[j + _u(1)], ambient[j + _u(2)]


class Reading(NamedTuple):
    """How one frame's tile is read.

    A sample is code - black - ambient * factor; gray is its sum over the channels by `weights`, and a sample whose
    gray is not above the threshold is zero. `place`: of the first of the frame's rows in `samples`. `word`: the place
    of its word in `bits`. `bit`: the frame's in that word, set where a sample is lit.
    """

    black: np.float32
    factor: np.float32
    weights: tuple[np.float32, np.float32, np.float32]
    threshold: np.float32
    place: int
    word: int
    bit: np.int32


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def read_lit(codes, at, count, ambient, how, samples, bits):  # pragma: no cover
    """Write red, green, blue and gray of a tile to `samples`, and which are lit to `bits`; `how` is a `Reading`."""
    black, factor, (red, green, blue), threshold, place, word, bit = how
    none, no_bit = np.float32(0), np.int32(0)
    for i in range(count):
        j = _u(at + 3 * i)
        r = np.float32(codes[j]) - black - ambient[_u(i)] * factor
        g = np.float32(codes[j + _u(1)]) - black - ambient[_u(TILE + i)] * factor
        b = np.float32(codes[j + _u(2)]) - black - ambient[_u(2 * TILE + i)] * factor
        gray = r * red + g * green + b * blue
        lit = gray > threshold
        bits[_u(word * TILE + i)] |= bit if lit else no_bit
        samples[_u(place + i)] = r if lit else none
        samples[_u(place + TILE + i)] = g if lit else none
        samples[_u(place + 2 * TILE + i)] = b if lit else none
        samples[_u(place + 3 * TILE + i)] = gray if lit else none


@numba.njit(nogil=True, cache=True)
def drop_clipped(clipped, count, how, samples, bits):  # pragma: no cover
    """Undo for the clipped pixels what `read_lit` did."""
    for i in range(count):
        if clipped[i]:
            bits[how.word * TILE + i] &= ~how.bit
            for row in range(SAMPLE_ROWS):
                samples[how.place + row * TILE + i] = np.float32(0)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def add_channel(samples, channel, vectors, first, count, part):  # pragma: no cover
    """Add the samples of a channel of four lights, times their vectors (F, 3, 3), to its three rows of `part`."""
    x0, y0, z0 = vectors[first, channel, 0], vectors[first, channel, 1], vectors[first, channel, 2]
    x1, y1, z1 = vectors[first + 1, channel, 0], vectors[first + 1, channel, 1], vectors[first + 1, channel, 2]
    x2, y2, z2 = vectors[first + 2, channel, 0], vectors[first + 2, channel, 1], vectors[first + 2, channel, 2]
    x3, y3, z3 = vectors[first + 3, channel, 0], vectors[first + 3, channel, 1], vectors[first + 3, channel, 2]
    place, step, to = channel * TILE, SAMPLE_ROWS * TILE, 3 * channel * TILE
    for i in range(count):
        m0, m1 = samples[_u(place + i)], samples[_u(place + step + i)]
        m2, m3 = samples[_u(place + 2 * step + i)], samples[_u(place + 3 * step + i)]
        part[_u(to + i)] += m0 * x0 + m1 * x1 + m2 * x2 + m3 * x3
        part[_u(to + TILE + i)] += m0 * y0 + m1 * y1 + m2 * y2 + m3 * y3
        part[_u(to + 2 * TILE + i)] += m0 * z0 + m1 * z1 + m2 * z2 + m3 * z3


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def add_squares(samples, count, part):  # pragma: no cover
    """Add the squares of four lights' gray to the last row of `part`."""
    place, step, to = 3 * TILE, SAMPLE_ROWS * TILE, (SUM_ROWS - 1) * TILE
    for i in range(count):
        m0, m1 = samples[_u(place + i)], samples[_u(place + step + i)]
        m2, m3 = samples[_u(place + 2 * step + i)], samples[_u(place + 3 * step + i)]
        part[_u(to + i)] += m0 * m0 + m1 * m1 + m2 * m2 + m3 * m3


@numba.njit(nogil=True, cache=True)
def flush(part, count, total):  # pragma: no cover
    """Add the float32 sums over a block of lights to the float64 sums over all, and begin anew."""
    for row in range(SUM_ROWS):
        for i in range(count):
            at = _u(row * TILE + i)
            total[at] += part[at]
            part[at] = np.float32(0)
