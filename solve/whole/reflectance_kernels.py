"""What a pixel looks like by the shared reflectance, and how that changes with its normal: compiled kernels."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from scene.robust import MAD
from solve.pixelwise.kernels import half_vector, light_vector
from solve.samples import Samples
from solve.whole.interreflection import Thrown

HALF = np.radians(np.array([0.0, 2, 4, 7, 10, 14, 19, 25, 32, 40, 50, 65, 90]))
"""Half angles of the table's knots: dense where highlights are."""
DIFFERENCE = np.radians(np.array([0.0, 6, 12, 18, 24, 30, 40, 60]))
INCIDENCE = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0])
"""n . l at the curve's knots."""
TABLE = len(HALF) * len(DIFFERENCE)
SIZE = TABLE + len(INCIDENCE) + 1
"""What all pixels share: the table, the curve, and the reflectance of what throws light upon other parts."""
GRAZING = 0.05
"""Samples whose light stands lower over the surface (cosine) are left out."""
STEEP = 3.0
"""Weight of a sample with table value f: 1 / (1 + STEEP |f - 1|)."""
SIGMAS = 2.0
"""Residuals beyond this times their pixel's own robust sigma count ever less."""


class Given(NamedTuple):
    """What pixels are fitted to: samples, unit vectors to the camera (P, 3), the gray value under which a sample is
    shadowed, the least sigma, and the object's own light on it.
    """

    samples: Samples
    views: NDArray[np.float64]
    threshold: float
    floor: float
    thrown: Thrown


class Pixels(NamedTuple):
    """Some of the pixels: which they are (K,), their normals (K, 3) and albedos (K,), which kernels move in place."""

    index: NDArray[np.intp]
    normals: NDArray[np.float64]
    albedo: NDArray[np.float64]

    def some(self, chosen: NDArray | slice) -> "Pixels":
        """Return those of them that are chosen; of a slice, the same memory."""
        return Pixels(self.index[chosen], self.normals[chosen], self.albedo[chosen])


class Room(NamedTuple):
    """One pixel's numbers, for its F lights.

    Light vectors and unit half vectors (F, 3); gains (F, 3): place and share of each difference angle, light thrown by
    the object; two tangents (2, 3); slopes along both and along the log albedo (F, 3); entry (F, 7, 2): which of the
    SIZE that are shared make the sample, and its slopes along them;
    state (F, 4): residual, weight, n . l, f; all relative to the albedo. Last, the residuals (F,) that are lit.
    """

    lights: NDArray[np.float64]
    halves: NDArray[np.float64]
    gains: NDArray[np.float64]
    across: NDArray[np.float64]
    slopes: NDArray[np.float64]
    entry: NDArray[np.float64]
    state: NDArray[np.float64]
    rest: NDArray[np.float64]

    @classmethod
    def of(cls, frames: int) -> "Room":
        """Return room for one pixel's numbers."""
        each = [np.empty((frames, *shape)) for shape in ((3,), (3,), (3,), (3,), (7, 2), (4,), ())]
        return cls._make([*each[:3], np.empty((2, 3)), *each[3:]])


@numba.njit(nogil=True, cache=True, inline="always")
def between(knots, value):  # pragma: no cover
    """Return the knot before a value, the distance to the next, and the value's share of it, 1 at most."""
    place = min(max(np.searchsorted(knots, value, "right") - 1, 0), len(knots) - 2)
    width = knots[place + 1] - knots[place]
    return place, width, min((value - knots[place]) / width, 1.0)


@numba.njit(nogil=True, cache=True)
def prepare(i, given, room):  # pragma: no cover
    """Fill in what does not change with the normal."""
    points, geometry, views, thrown = given.samples.points, given.samples.lights, given.views, given.thrown
    lights, halves, gains = room.lights, room.halves, room.gains
    for k in range(len(lights)):
        x, y, z = light_vector(k, points[i], geometry)
        lights[k, 0], lights[k, 1], lights[k, 2] = x, y, z
        u, v, w, _ = half_vector(x, y, z, views[i])
        halves[k, 0], halves[k, 1], halves[k, 2] = u, v, w
        cosine = u * views[i, 0] + v * views[i, 1] + w * views[i, 2]
        angle = np.arccos(min(max(cosine, -1.0), 1.0))
        gains[k, 0], _, gains[k, 1] = between(DIFFERENCE, angle)
        gains[k, 2] = 0.0
        for corner in range(4):
            gains[k, 2] += thrown.share[i, corner] * thrown.patches[thrown.corner[i, corner], k]


@numba.njit(nogil=True, cache=True)
def tangents(n, out):  # pragma: no cover
    """Fill `out` (2, 3) with two unit vectors across n."""
    x, y, z = n[0], n[1], n[2]
    # n x (1, 0, 0) or n x (0, 1, 0), written out: a tenth of the time to compile.
    u, v, w = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    length = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    out[0, 0], out[0, 1], out[0, 2] = u, v, w
    out[1, 0], out[1, 1], out[1, 2] = y * w - z * v, z * u - x * w, x * v - y * u


@numba.njit(nogil=True, cache=True)
def model(i, given, n, albedo, table, room):  # pragma: no cover
    """Fill in what changes with the normal; return the robust sigma of the residuals and how many samples are lit."""
    gray, valid = given.samples.gray, given.samples.valid
    lights, halves, gains, across, slopes, entry, state, rest = room
    tangents(n, across)
    count, wide, size = gray.shape[1], len(DIFFERENCE), 0
    for k in range(count):
        state[k, 1] = 0.0
        c = n[0] * lights[k, 0] + n[1] * lights[k, 1] + n[2] * lights[k, 2]
        state[k, 2] = c
        if not valid[i, k] or gray[i, k] <= given.threshold or c <= GRAZING:
            continue
        cosine = n[0] * halves[k, 0] + n[1] * halves[k, 1] + n[2] * halves[k, 2]
        cosine = min(max(cosine, -1.0), 1.0)
        row, width, t = between(HALF, np.arccos(cosine))
        column, s = int(gains[k, 0]), gains[k, 1]
        first = row * wide + column
        knot, span, p = between(INCIDENCE, c)
        curve = TABLE + knot
        entry[k, 0, 0], entry[k, 1, 0] = first, first + 1
        entry[k, 2, 0], entry[k, 3, 0] = first + wide, first + wide + 1
        entry[k, 4, 0], entry[k, 5, 0] = curve, curve + 1
        entry[k, 0, 1], entry[k, 1, 1] = c * (1 - t) * (1 - s), c * (1 - t) * s
        entry[k, 2, 1], entry[k, 3, 1] = c * t * (1 - s), c * t * s
        entry[k, 4, 1], entry[k, 5, 1] = c * (1 - p), c * p
        entry[k, 6, 0], entry[k, 6, 1] = SIZE - 1, gains[k, 2]
        low = table[first] * (1 - s) + table[first + 1] * s
        high = table[first + wide] * (1 - s) + table[first + wide + 1] * s
        f = low + t * (high - low) + table[curve] + p * (table[curve + 1] - table[curve])
        bent = f + c * (table[curve + 1] - table[curve]) / span
        # d angle / d cosine = -1 / sin; at the lobe's middle the table is level.
        fall = -(high - low) / width / max(np.sqrt(1 - cosine * cosine), 0.02)
        for j in range(2):
            dc = across[j, 0] * lights[k, 0] + across[j, 1] * lights[k, 1] + across[j, 2] * lights[k, 2]
            dh = across[j, 0] * halves[k, 0] + across[j, 1] * halves[k, 1] + across[j, 2] * halves[k, 2]
            slopes[k, j] = dc * bent + c * fall * dh
        slopes[k, 2] = c * f + table[SIZE - 1] * gains[k, 2]
        state[k, 0] = gray[i, k] / albedo - slopes[k, 2]
        state[k, 1] = 1.0
        state[k, 3] = f
        rest[size] = abs(state[k, 0])
        size += 1
    if size < 4:
        return 0.0, size
    sigma = max(MAD * np.median(rest[:size]), given.floor / albedo)
    for k in range(count):
        if state[k, 1] > 0:
            loose = 1.0 + STEEP * abs(state[k, 3] - 1.0)
            ratio = state[k, 0] / (SIGMAS * sigma * loose)
            state[k, 1] = 1.0 / (loose * (1.0 + ratio * ratio) ** 2)
    return sigma, size
