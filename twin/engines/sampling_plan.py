"""Where a picture needs more than one sample a pixel, and how many: from the picture itself, for each light apart."""

import numba
import numpy as np
from numpy.typing import NDArray

MOST_SAMPLES = 4096
EDGE_ERROR = 0.37
"""Of n samples of `Direct` in a pixel that a step of height 1 crosses anywhere, times n^(3/4); found by trying."""
SEVERAL = 2**1.25
"""Second difference, over the tolerance, from which on more than one sample is taken."""
ACROSS_CORNERS = 0.25
"""A step between diagonal neighbours alone cuts off no more than the pixel's corner."""


@numba.njit(nogil=True, cache=True)
def bends(images, scale, out):
    """Fill `out` (F, h, w) with the greatest second difference, along rows, columns or diagonals, of any channel.

    images (F, h, w, 3).
    scale (F,): The frames' brightness: what the difference is divided by.

    |2 c - a - b| is the height of a step between c and one neighbour, and small on what is smooth. Beyond the
    picture's border the neighbour is the pixel itself.
    """
    frames, height, width, channels = images.shape
    # Three rows with their border, one pixel wider on either side: the loop over them has no exceptions.
    rows = np.empty((3, (width + 2) * channels), np.float32)
    most = np.empty(width * channels, np.float32)
    for f in range(frames):
        for row in range(height):
            for k in range(3):
                values = images[f, min(max(row + k - 1, 0), height - 1)].reshape(-1)
                rows[k, channels:-channels] = values
                rows[k, :channels] = values[:channels]
                rows[k, -channels:] = values[-channels:]
            _second_differences(rows, channels, most)
            for column in range(width):
                value = most[channels * column]
                for c in range(1, channels):
                    value = max(value, most[channels * column + c])
                out[f, row, column] = value / scale[f]


@numba.njit(nogil=True, cache=True)
def _second_differences(rows, channels, most):
    """Fill `most` (w * channels,) from three rows that are one pixel wider on either side."""
    # Slices and conditional expressions: so the compiler makes vector instructions of the loop.
    above_before, above, above_after = rows[0], rows[0, channels:], rows[0, 2 * channels :]
    before, here, after = rows[1], rows[1, channels:], rows[1, 2 * channels :]
    below_before, below, below_after = rows[2], rows[2, channels:], rows[2, 2 * channels :]
    for k in range(len(most)):
        twice = here[k] + here[k]
        along, down = abs(twice - before[k] - after[k]), abs(twice - above[k] - below[k])
        falling = abs(twice - above_before[k] - below_after[k])
        rising = abs(twice - below_before[k] - above_after[k])
        straight = along if along > down else down
        across = np.float32(ACROSS_CORNERS) * (falling if falling > rising else rising)
        most[k] = straight if straight > across else across


def samples_for(bend: NDArray[np.float32], tolerance: float) -> NDArray[np.float32]:
    """Return how many samples pixels of a second difference get: 1, or an even number.

    n well-spread samples of a step of height e err by 0.37 e n^(-3/4). The least sum of n at a given sum of squared
    errors has n proportional to e^(4/5).
    """
    out = np.ones(bend.shape, np.float32)
    several = bend > tolerance * SEVERAL
    out[several] = np.minimum(2 * np.floor(0.5 * (bend[several] / tolerance) ** 0.8), MOST_SAMPLES)
    return np.maximum(out, 1, out=out)


def predicted_error(bend: NDArray[np.float32], samples: NDArray[np.float32]) -> float:
    """Return the root mean square error that remains, of the frames' brightness."""
    return float(np.sqrt(np.mean((EDGE_ERROR * bend) ** 2 / (samples * np.sqrt(samples)))))


def tolerance_for(bend: NDArray[np.float32], error: float) -> float:
    """Return the tolerance whose predicted error is `error`, by bisection on a logarithmic scale."""
    # What bends so little adds less than a thousandth of the error's square, whatever its samples.
    steep = bend[bend > 0.1 * error]
    share = np.sqrt(len(steep) / bend.size)
    low, high = 0.01 * error, 1e3
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        if len(steep) and share * predicted_error(steep, samples_for(steep, middle)) > error:
            high = middle
        else:
            low = middle
    return low


@numba.njit(nogil=True, cache=True)
def plan_samples(bend, first_row, rows, tolerance):
    """Return which samples are traced for which pixels and lights.

    bend (F, h, w).
    first_row, rows: The rows of `bend` that are wanted.
    pixels (Q,): Index in the wanted rows of each pixel that more than one sample is taken of.
    first_lane (Q + 1,): Its lanes, one a sample.
    first_pair (Q + 1,): Its pairs, one a light that needs them, those of most samples first.
    light (pairs,); samples (pairs,).
    lights_of_lane (lanes,): How many of the pixel's lights still want a lane's sample.
    """
    frames, _, width = bend.shape
    threshold = tolerance * SEVERAL
    most = np.zeros(rows * width, np.float32)
    pairs = np.zeros(rows * width, np.int32)
    for f in range(frames):
        for row in range(rows):
            for column in range(width):
                value = bend[f, first_row + row, column]
                if value > threshold:
                    pixel = row * width + column
                    pairs[pixel] += 1
                    most[pixel] = max(most[pixel], value)
    pixels = np.nonzero(pairs)[0].astype(np.int32)
    first_pair = np.zeros(len(pixels) + 1, np.int32)
    first_lane = np.zeros(len(pixels) + 1, np.int32)
    for q in range(len(pixels)):
        first_pair[q + 1] = first_pair[q] + pairs[pixels[q]]
        first_lane[q + 1] = first_lane[q] + _samples(most[pixels[q]], tolerance)
    light = np.empty(first_pair[-1], np.int32)
    samples = np.empty(first_pair[-1], np.int32)
    lights_of_lane = np.zeros(first_lane[-1], np.int32)
    found = np.empty(frames, np.int32)
    for q in range(len(pixels)):
        row, column = first_row + pixels[q] // width, pixels[q] % width
        for f in range(frames):
            found[f] = 0
            if bend[f, row, column] > threshold:
                found[f] = _samples(bend[f, row, column], tolerance)
        order = np.argsort(-found)
        for k in range(pairs[pixels[q]]):
            light[first_pair[q] + k] = order[k]
            samples[first_pair[q] + k] = found[order[k]]
            for lane in range(first_lane[q], first_lane[q] + found[order[k]]):
                lights_of_lane[lane] += 1
    return pixels, first_lane, first_pair, light, samples, lights_of_lane


@numba.njit(nogil=True, cache=True, inline="always")
def _samples(bend, tolerance):
    return min(2 * np.int32(0.5 * np.float64(bend / tolerance) ** 0.8), MOST_SAMPLES)
