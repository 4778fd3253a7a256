"""Compiled kernels of the shared reflectance: normal equations of pixels and table, and each pixel's own refinement."""

import numba
import numpy as np

from solve.pixelwise.kernels import light_vector

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


@numba.njit(nogil=True, cache=True)
def _prepare(i, valid, points, views, directions, positions, reach, is_near, lights, halves, gains):  # pragma: no cover
    """Fill the pixel's light vectors (F, 3), unit half vectors (F, 3), and place and share of each difference angle."""
    for k in range(len(valid)):
        x, y, z = light_vector(k, points[i], directions, positions, reach, is_near)
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
    axis = 0 if abs(n[0]) < 0.6 else 1
    helper = np.zeros(3)
    helper[axis] = 1.0
    out[0] = np.cross(n, helper)
    out[0] /= np.sqrt((out[0] ** 2).sum())
    out[1] = np.cross(n, out[0])


@numba.njit(nogil=True, cache=True)
def _model(
    values, valid, n, albedo, table, threshold, floor, sigmas, lights, halves, gains, across, slopes, entry, state
):  # pragma: no cover
    """Fill, per sample, slopes (F, 3) along both tangents and the log albedo, table entries, and state (F, 4).

    entry (F, 5): the first of four table entries, their weights; state: residual, weight, n . l, f; all relative to
    the albedo. Returns the robust sigma of the residuals and how many samples are lit.
    """
    count = len(values)
    wide = len(DIFFERENCE)
    size = 0
    rest = np.empty(count)
    for k in range(count):
        state[k, 1] = 0.0
        c = n[0] * lights[k, 0] + n[1] * lights[k, 1] + n[2] * lights[k, 2]
        state[k, 2] = c
        if not valid[k] or values[k] <= threshold or c <= GRAZING:
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
        state[k, 0] = values[k] / albedo - c * f
        state[k, 1] = 1.0
        state[k, 3] = f
        rest[size] = abs(state[k, 0])
        size += 1
    if size < 4:
        return 0.0, size
    sigma = max(1.4826 * np.median(rest[:size]), floor / albedo)
    for k in range(count):
        if state[k, 1] > 0:
            loose = 1.0 + STEEP * abs(state[k, 3] - 1.0)
            ratio = state[k, 0] / (sigmas * sigma * loose)
            state[k, 1] = 1.0 / (loose * (1.0 + ratio * ratio) ** 2)
    return sigma, size


@numba.njit(nogil=True, cache=True)
def _step(n, albedo, across, first, second, third):  # pragma: no cover
    """Turn n in place by two angles along its tangents, and return the albedo times exp(third), both within limits."""
    first = min(max(first, -LARGEST), LARGEST)
    second = min(max(second, -LARGEST), LARGEST)
    total = 0.0
    for axis in range(3):
        n[axis] += first * across[0, axis] + second * across[1, axis]
        total += n[axis] ** 2
    n /= np.sqrt(total)
    return albedo * np.exp(min(max(third, -0.5), 0.5))


@numba.njit(nogil=True, cache=True)
def accumulate(
    gray, valid, points, views, directions, positions, reach, is_near, threshold, floor, sigmas,
    chosen, normals, albedo, table, joint,
):  # fmt: skip  # pragma: no cover
    """Return the table's normal equations over the pixels chosen, their normals and albedos eliminated if `joint`.

    Returns
    -------
    hessian, slope : (SIZE, SIZE), (SIZE,)
    samples : float
        How many took part.
    sigma : (K,)
        Of each pixel's residuals, in units of the samples.
    inverse, own, coupling : (K, 3, 3), (K, 3), (K, 3, SIZE)
        For `back_substitute`.
    """
    count, frames = len(chosen), gray.shape[1]
    hessian, slope, samples, sigma = np.zeros((SIZE, SIZE)), np.zeros(SIZE), 0.0, np.zeros(count)
    inverse, own, coupling = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3, SIZE))
    lights, halves, gains = np.empty((frames, 3)), np.empty((frames, 3)), np.empty((frames, 2))
    slopes, entry, state = np.empty((frames, 3)), np.empty((frames, 5)), np.empty((frames, 4))
    across, place = np.empty((2, 3)), np.empty(4, np.int64)
    wide = len(DIFFERENCE)
    for p in range(count):
        i = chosen[p]
        _prepare(i, valid[i], points, views, directions, positions, reach, is_near, lights, halves, gains)
        _tangents(normals[p], across)
        spread, size = _model(
            gray[i], valid[i], normals[p], albedo[p], table, threshold, floor, sigmas, lights, halves, gains,
            across, slopes, entry, state,
        )  # fmt: skip
        sigma[p] = spread * albedo[p]
        if size < 4:
            continue
        samples += size
        block = np.zeros((3, 3))
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
            for j in range(3):
                own[p, j] += w * slopes[k, j] * r
                for m in range(3):
                    block[j, m] += w * slopes[k, j] * slopes[k, m]
        if not joint:
            continue
        damping = 1e-3 * np.trace(block) / 3 + 1e-12
        for j in range(3):
            block[j, j] += damping
        inverse[p] = np.linalg.inv(block)
        reduced = inverse[p] @ coupling[p]
        hessian -= coupling[p].T @ reduced
        slope -= reduced.T @ own[p]
    return hessian, slope, samples, sigma, inverse, own, coupling


@numba.njit(nogil=True, cache=True)
def back_substitute(normals, albedo, inverse, own, coupling, step):  # pragma: no cover
    """Move normals (K, 3) and albedos (K,), in place, as the table's step asks."""
    across = np.empty((2, 3))
    for p in range(len(albedo)):
        move = inverse[p] @ (own[p] - coupling[p] @ step)
        _tangents(normals[p], across)
        albedo[p] = _step(normals[p], albedo[p], across, move[0], move[1], move[2])


@numba.njit(nogil=True, cache=True)
def refine(
    gray, valid, points, views, directions, positions, reach, is_near, threshold, floor, sigmas,
    chosen, normals, albedo, table, steps, used,
):  # fmt: skip  # pragma: no cover
    """Fit each pixel chosen to the table, in place; `used` (P, F): matte samples that agree with the fit."""
    frames = gray.shape[1]
    lights, halves, gains = np.empty((frames, 3)), np.empty((frames, 3)), np.empty((frames, 2))
    slopes, entry, state = np.empty((frames, 3)), np.empty((frames, 5)), np.empty((frames, 4))
    across, block, own = np.empty((2, 3)), np.empty((3, 3)), np.empty(3)
    for p in range(len(chosen)):
        i = chosen[p]
        _prepare(i, valid[i], points, views, directions, positions, reach, is_near, lights, halves, gains)
        for _ in range(steps):
            _tangents(normals[p], across)
            _, size = _model(
                gray[i], valid[i], normals[p], albedo[p], table, threshold, floor, sigmas, lights, halves, gains,
                across, slopes, entry, state,
            )  # fmt: skip
            if size < 4:
                break
            block[:] = 0.0
            own[:] = 0.0
            for k in range(frames):
                w = state[k, 1]
                if w > 0:
                    for j in range(3):
                        own[j] += w * slopes[k, j] * state[k, 0]
                        for m in range(3):
                            block[j, m] += w * slopes[k, j] * slopes[k, m]
            damping = 1e-3 * (block[0, 0] + block[1, 1] + block[2, 2]) / 3 + 1e-12
            for j in range(3):
                block[j, j] += damping
            move = np.linalg.solve(block, own)
            albedo[p] = _step(normals[p], albedo[p], across, move[0], move[1], move[2])
            if abs(move[0]) + abs(move[1]) < 1e-5:
                break
        matte = 0
        for k in range(frames):
            matte += state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
        if matte >= 4:
            for k in range(frames):
                used[i, k] = state[k, 1] > 0.5 and abs(state[k, 3] - 1.0) < MATTE
