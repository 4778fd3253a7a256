"""Compiled kernels that fit the shared reflectance: normal equations over pixels, and a pixel's own refinement."""

import numba
import numpy as np

from solve.whole.reflectance_kernels import SIZE, model, prepare, tangents

LARGEST = 0.15
"""Radians: a step of a normal at most."""
MATTE = 0.2


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
def _eliminate(inverse, own, coupling, hessian, slope):  # pragma: no cover
    """Take one pixel's own unknowns out of the normal equations of what is shared: its Schur complement.

    Written out: a pixel touches half of them, and the linear algebra library's threads cost more than they work.
    """
    touched, reduced, count = np.empty(SIZE, np.int64), np.empty((3, SIZE)), 0
    for column in range(SIZE):
        a, b, c = coupling[0, column], coupling[1, column], coupling[2, column]
        if a == 0 and b == 0 and c == 0:
            continue
        touched[count] = column
        for j in range(3):
            reduced[j, count] = inverse[j, 0] * a + inverse[j, 1] * b + inverse[j, 2] * c
            slope[column] -= reduced[j, count] * own[j]
        count += 1
    for x in range(count):
        row = touched[x]
        a, b, c = coupling[0, row], coupling[1, row], coupling[2, row]
        for y in range(x, count):
            hessian[row, touched[y]] -= a * reduced[0, y] + b * reduced[1, y] + c * reduced[2, y]


@numba.njit(nogil=True, cache=True)
def accumulate(given, pixels, table, room, joint):  # pragma: no cover
    """Return the normal equations of what is shared over the pixels, their normals and albedos eliminated if `joint`.

    They are hessian (SIZE, SIZE), its upper half, and slope (SIZE,); then how many samples took part, the sigma of
    each pixel's residuals (K,) relative to its albedo; and for `back_substitute` inverse (K, 3, 3), own (K, 3)
    and coupling (K, 3, SIZE).
    """
    count, frames = len(pixels.index), given.samples.gray.shape[1]
    hessian, slope, samples, sigma = np.zeros((SIZE, SIZE)), np.zeros(SIZE), 0.0, np.zeros(count)
    inverse, own, coupling = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3, SIZE))
    block, slopes, entry, state = np.empty((3, 3)), room.slopes, room.entry, room.state
    for p in range(count):
        i = pixels.index[p]
        prepare(i, given, room)
        spread, size = model(i, given, pixels.normals[p], pixels.albedo[p], table, room)
        sigma[p] = spread
        if size < 4:
            continue
        samples += size
        for k in range(frames):
            if state[k, 1] <= 0:
                continue
            r, w = state[k, 0], state[k, 1] if joint else 1.0 / (1.0 + (state[k, 0] / 0.5) ** 2) ** 2
            for a in range(7):
                left, row = w * entry[k, a, 1], int(entry[k, a, 0])
                slope[row] += left * r
                for b in range(a, 7):
                    hessian[row, int(entry[k, b, 0])] += left * entry[k, b, 1]
                for j in range(3):
                    coupling[p, j, row] += left * slopes[k, j]
        if not joint:
            continue
        _own_equations(room, block, own[p])
        inverse[p] = np.linalg.inv(block)
        _eliminate(inverse[p], own[p], coupling[p], hessian, slope)
    return hessian, slope, samples, sigma, inverse, own, coupling


@numba.njit(nogil=True, cache=True)
def back_substitute(pixels, inverse, own, coupling, step):  # pragma: no cover
    """Move normals and albedos, in place, as the table's step asks."""
    across = np.empty((2, 3))
    normals, albedo = pixels.normals, pixels.albedo
    for p in range(len(albedo)):
        move = inverse[p] @ (own[p] - coupling[p] @ step)
        tangents(normals[p], across)
        albedo[p] = _step(normals[p], albedo[p], across, move)


@numba.njit(nogil=True, cache=True)
def refine(given, pixels, table, room, steps, used):  # pragma: no cover
    """Fit each pixel to the table, in place; `used` (P, F): matte samples that agree with the fit."""
    block, own, state = np.empty((3, 3)), np.empty(3), room.state
    index, normals, albedo = pixels
    for p in range(len(index)):
        i = index[p]
        prepare(i, given, room)
        for _ in range(steps):
            _, size = model(i, given, normals[p], albedo[p], table, room)
            if size < 4:
                break
            _own_equations(room, block, own)
            move = np.linalg.solve(block, own)
            albedo[p] = _step(normals[p], albedo[p], room.across, move)
            if abs(move[0]) + abs(move[1]) < 1e-5:
                break
        matte = 0
        for k in range(len(state)):
            matte += state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
        if matte >= 4:
            for k in range(len(state)):
                used[i, k] = state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
