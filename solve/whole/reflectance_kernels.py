"""Compiled kernels of the shared reflectance: normal equations of pixels and table, and each pixel's own refinement."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from solve.pixelwise.kernels import light_vector
from solve.samples import Samples

HALF = np.radians(np.array([0.0, 2, 4, 7, 10, 14, 19, 25, 32, 40, 50, 65, 90]))
"""Half angles of the table's knots: dense where highlights are."""
DIFFERENCE = np.radians(np.array([0.0, 6, 12, 18, 24, 30, 40, 60]))
SIZE = len(HALF) * len(DIFFERENCE)
GRAZING = 0.05
"""Samples whose light stands lower over the surface (cosine) are left out."""
STEEP = 3.0
"""Weight of a sample with table value f: 1 / (1 + STEEP |f - 1|)."""
LARGEST = 0.15
"""Radians: a step of a normal at most."""
MATTE = 0.2


class Given(NamedTuple):
    """What pixels are fitted to: samples, unit vectors to the camera (P, 3), the gray value under which a sample is
    shadowed, the least sigma, and the sigmas beyond which a residual counts ever less.
    """

    samples: Samples
    views: NDArray[np.float64]
    threshold: float
    floor: float
    sigmas: float


class Pixels(NamedTuple):
    """Some of the pixels: which they are (K,), their normals (K, 3) and albedos (K,), which kernels move in place."""

    index: NDArray[np.intp]
    normals: NDArray[np.float64]
    albedo: NDArray[np.float64]

    def some(self, chosen: NDArray | slice) -> "Pixels":
        """Return those of them that are chosen; of a slice, the same memory."""
        return Pixels(self.index[chosen], self.normals[chosen], self.albedo[chosen])


class _Room(NamedTuple):
    """One pixel's numbers, for its F lights.

    Light vectors and unit half vectors (F, 3); place and share of each difference angle (F, 2); two tangents (2, 3);
    slopes along both and along the log albedo (F, 3); entry (F, 5): the first of four table entries, their weights;
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


@numba.njit(nogil=True, cache=True, inline="always")
def _room(frames):  # pragma: no cover
    return _Room(
        np.empty((frames, 3)),
        np.empty((frames, 3)),
        np.empty((frames, 2)),
        np.empty((2, 3)),
        np.empty((frames, 3)),
        np.empty((frames, 5)),
        np.empty((frames, 4)),
        np.empty(frames),
    )


@numba.njit(nogil=True, cache=True)
def _prepare(i, given, room):  # pragma: no cover
    """Fill in what does not change with the normal."""
    points, geometry, views = given.samples.points, given.samples.lights, given.views
    lights, halves, gains = room.lights, room.halves, room.gains
    for k in range(len(lights)):
        x, y, z = light_vector(k, points[i], geometry)
        lights[k, 0], lights[k, 1], lights[k, 2] = x, y, z
        length = np.sqrt(x * x + y * y + z * z)
        total = 0.0
        for axis in range(3):
            halves[k, axis] = lights[k, axis] / length + views[i, axis]
            total += halves[k, axis] ** 2
        total = max(np.sqrt(total), 1e-9)
        cosine = 0.0
        for axis in range(3):
            halves[k, axis] /= total
            cosine += halves[k, axis] * views[i, axis]
        angle = np.arccos(min(max(cosine, -1.0), 1.0))
        place = min(max(np.searchsorted(DIFFERENCE, angle, "right") - 1, 0), len(DIFFERENCE) - 2)
        gains[k, 0] = place
        gains[k, 1] = min((angle - DIFFERENCE[place]) / (DIFFERENCE[place + 1] - DIFFERENCE[place]), 1.0)


@numba.njit(nogil=True, cache=True)
def _tangents(n, out):  # pragma: no cover
    """Fill `out` (2, 3) with two unit vectors across n."""
    x, y, z = n[0], n[1], n[2]
    # n x (1, 0, 0) or n x (0, 1, 0), written out: a tenth of the time to compile.
    u, v, w = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    length = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    out[0, 0], out[0, 1], out[0, 2] = u, v, w
    out[1, 0], out[1, 1], out[1, 2] = y * w - z * v, z * u - x * w, x * v - y * u


@numba.njit(nogil=True, cache=True)
def _model(i, given, n, albedo, table, room):  # pragma: no cover
    """Fill in what changes with the normal; return the robust sigma of the residuals and how many samples are lit."""
    gray, valid = given.samples.gray, given.samples.valid
    lights, halves, gains, across, slopes, entry, state, rest = room
    _tangents(n, across)
    count, wide, size = gray.shape[1], len(DIFFERENCE), 0
    for k in range(count):
        state[k, 1] = 0.0
        c = n[0] * lights[k, 0] + n[1] * lights[k, 1] + n[2] * lights[k, 2]
        state[k, 2] = c
        if not valid[i, k] or gray[i, k] <= given.threshold or c <= GRAZING:
            continue
        cosine = n[0] * halves[k, 0] + n[1] * halves[k, 1] + n[2] * halves[k, 2]
        cosine = min(max(cosine, -1.0), 1.0)
        angle = np.arccos(cosine)
        row = min(max(np.searchsorted(HALF, angle, "right") - 1, 0), len(HALF) - 2)
        width = HALF[row + 1] - HALF[row]
        t = min((angle - HALF[row]) / width, 1.0)
        column, s = int(gains[k, 0]), gains[k, 1]
        first = row * wide + column
        entry[k, 0] = first
        entry[k, 1], entry[k, 2] = (1 - t) * (1 - s), (1 - t) * s
        entry[k, 3], entry[k, 4] = t * (1 - s), t * s
        low = table[first] * (1 - s) + table[first + 1] * s
        high = table[first + wide] * (1 - s) + table[first + wide + 1] * s
        f = low + t * (high - low)
        # d angle / d cosine = -1 / sin; at the lobe's middle the table is level.
        fall = -(high - low) / width / max(np.sqrt(1 - cosine * cosine), 0.02)
        for j in range(2):
            dc = across[j, 0] * lights[k, 0] + across[j, 1] * lights[k, 1] + across[j, 2] * lights[k, 2]
            dh = across[j, 0] * halves[k, 0] + across[j, 1] * halves[k, 1] + across[j, 2] * halves[k, 2]
            slopes[k, j] = dc * f + c * fall * dh
        slopes[k, 2] = c * f
        state[k, 0] = gray[i, k] / albedo - c * f
        state[k, 1] = 1.0
        state[k, 3] = f
        rest[size] = abs(state[k, 0])
        size += 1
    if size < 4:
        return 0.0, size
    sigma = max(1.4826 * np.median(rest[:size]), given.floor / albedo)
    for k in range(count):
        if state[k, 1] > 0:
            loose = 1.0 + STEEP * abs(state[k, 3] - 1.0)
            ratio = state[k, 0] / (given.sigmas * sigma * loose)
            state[k, 1] = 1.0 / (loose * (1.0 + ratio * ratio) ** 2)
    return sigma, size


@numba.njit(nogil=True, cache=True)
def _own_equations(room, block, own):  # pragma: no cover
    """Write the damped normal equations, (3, 3) and (3,), of one pixel's two angles and log albedo."""
    slopes, state = room.slopes, room.state
    block[:] = 0.0
    own[:] = 0.0
    for k in range(len(state)):
        w = state[k, 1]
        if w > 0:
            for j in range(3):
                own[j] += w * slopes[k, j] * state[k, 0]
                for m in range(3):
                    block[j, m] += w * slopes[k, j] * slopes[k, m]
    damping = 1e-3 * (block[0, 0] + block[1, 1] + block[2, 2]) / 3 + 1e-12
    for j in range(3):
        block[j, j] += damping


@numba.njit(nogil=True, cache=True)
def _step(n, albedo, across, move):  # pragma: no cover
    """Turn n in place by two angles along its tangents, and return the albedo times exp(move[2]), within limits."""
    first = min(max(move[0], -LARGEST), LARGEST)
    second = min(max(move[1], -LARGEST), LARGEST)
    total = 0.0
    for axis in range(3):
        n[axis] += first * across[0, axis] + second * across[1, axis]
        total += n[axis] ** 2
    n /= np.sqrt(total)
    return albedo * np.exp(min(max(move[2], -0.5), 0.5))


@numba.njit(nogil=True, cache=True)
def accumulate(given, pixels, table, joint):  # pragma: no cover
    """Return the table's normal equations over the pixels, their normals and albedos eliminated if `joint`.

    They are hessian (SIZE, SIZE) and slope (SIZE,); then how many samples took part, the sigma of each pixel's
    residuals (K,) in units of the samples, and for `back_substitute` inverse (K, 3, 3), own (K, 3) and coupling
    (K, 3, SIZE).
    """
    count, frames = len(pixels.index), given.samples.gray.shape[1]
    hessian, slope, samples, sigma = np.zeros((SIZE, SIZE)), np.zeros(SIZE), 0.0, np.zeros(count)
    inverse, own, coupling = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3, SIZE))
    room, block, place = _room(frames), np.empty((3, 3)), np.empty(4, np.int64)
    slopes, entry, state = room.slopes, room.entry, room.state
    wide = len(DIFFERENCE)
    for p in range(count):
        i = pixels.index[p]
        _prepare(i, given, room)
        spread, size = _model(i, given, pixels.normals[p], pixels.albedo[p], table, room)
        sigma[p] = spread * pixels.albedo[p]
        if size < 4:
            continue
        samples += size
        for k in range(frames):
            if state[k, 1] <= 0:
                continue
            r, w, c = state[k, 0], state[k, 1] if joint else 1.0 / (1.0 + (state[k, 0] / 0.5) ** 2) ** 2, state[k, 2]
            first = int(entry[k, 0])
            place[0], place[1], place[2], place[3] = first, first + 1, first + wide, first + wide + 1
            for a in range(4):
                left = w * c * entry[k, 1 + a]
                slope[place[a]] += left * r
                for b in range(4):
                    hessian[place[a], place[b]] += left * c * entry[k, 1 + b]
                for j in range(3):
                    coupling[p, j, place[a]] += left * slopes[k, j]
        if not joint:
            continue
        _own_equations(room, block, own[p])
        inverse[p] = np.linalg.inv(block)
        reduced = inverse[p] @ coupling[p]
        hessian -= coupling[p].T @ reduced
        slope -= reduced.T @ own[p]
    return hessian, slope, samples, sigma, inverse, own, coupling


@numba.njit(nogil=True, cache=True)
def back_substitute(pixels, inverse, own, coupling, step):  # pragma: no cover
    """Move normals and albedos, in place, as the table's step asks."""
    across = np.empty((2, 3))
    normals, albedo = pixels.normals, pixels.albedo
    for p in range(len(albedo)):
        move = inverse[p] @ (own[p] - coupling[p] @ step)
        _tangents(normals[p], across)
        albedo[p] = _step(normals[p], albedo[p], across, move)


@numba.njit(nogil=True, cache=True)
def refine(given, pixels, table, steps, used):  # pragma: no cover
    """Fit each pixel to the table, in place; `used` (P, F): matte samples that agree with the fit."""
    frames = given.samples.gray.shape[1]
    room, block, own = _room(frames), np.empty((3, 3)), np.empty(3)
    state = room.state
    index, normals, albedo = pixels
    for p in range(len(index)):
        i = index[p]
        _prepare(i, given, room)
        for _ in range(steps):
            _, size = _model(i, given, normals[p], albedo[p], table, room)
            if size < 4:
                break
            _own_equations(room, block, own)
            move = np.linalg.solve(block, own)
            albedo[p] = _step(normals[p], albedo[p], room.across, move)
            if abs(move[0]) + abs(move[1]) < 1e-5:
                break
        matte = 0
        for k in range(frames):
            matte += state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
        if matte >= 4:
            for k in range(frames):
                used[i, k] = state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
