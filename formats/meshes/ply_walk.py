"""A walk through PLY lists of different lengths: where each starts is known only when the one before was read.

Apart from its reader because numba's cache looks at this file's date alone.
"""

import numba
import numpy as np


@numba.njit(cache=True)
def walk(data, at, rows, sizes, length_sizes, big, numbers):
    """Return where each list starts and how long it is.

    data (B,): The file.
    at: The element's first byte.
    rows: How many rows the element has.
    sizes, length_sizes (P,): Bytes of one value of each property; bytes of its list's length, 0 for a single value.
    big: Whether a length's high byte comes first.
    numbers (B / 8,): Where lengths are float64 (a text, parsed), the same bytes as such; else empty.
    starts, counts (rows, P): First byte and number of values of each list.
    at: The byte after the element; -1 where the file ends before.
    """
    starts = np.zeros((rows, len(sizes)), np.int64)
    counts = np.zeros((rows, len(sizes)), np.int64)
    for row in range(rows):
        for column in range(len(sizes)):
            count, width = 1, length_sizes[column]
            if at + width > len(data):
                return starts, counts, -1
            if width and len(numbers):
                # A text may hold any number: one beyond the file is no length.
                length = numbers[at // 8]
                count = int(length) if 0 <= length <= len(data) else -1
            elif width:
                count = 0
                for byte in range(width):
                    place = byte if big else width - 1 - byte
                    count = count * 256 + int(data[at + place])
            at += width
            if count < 0 or count > len(data) or at + count * sizes[column] > len(data):
                return starts, counts, -1
            starts[row, column], counts[row, column] = at, count
            at += count * sizes[column]
    return starts, counts, at


@numba.njit(cache=True)
def fetch(data, starts, lengths, out):
    """Copy pieces of `data` (B,), which start at `starts` (N,) and are `lengths` (N,) bytes long, to `out` in a row."""
    at = 0
    for row in range(len(starts)):
        for byte in range(lengths[row]):
            out[at] = data[starts[row] + byte]
            at += 1
