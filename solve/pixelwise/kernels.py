"""Compiled kernels of one pixel: which samples are lit, normal equations, which samples agree.

float64 accumulation and a 3 x 3 closed form: no Python and no allocation per pixel. Where the light comes from is a
`solve.samples.Geometry`.
"""

import numba
import numpy as np

from solve.pixelwise.selection import NO_KEY, keys_of, smallest_key, value_of

SINGULAR = 1e-6
"""det / (trace / 3)^3 of the 3 x 3 normal matrix under which a pixel's lit lights lie in a plane."""
SINGULAR_WEIGHTED = 1e-12
"""The same where a few samples may outweigh the rest a thousandfold: what float64 still solves."""


@numba.njit(nogil=True, cache=True, inline="always")
def light_vector(light, point, lights):  # pragma: no cover
    """Return the light vector (3 floats) of one light at one point; see `Lights.toward`."""
    directions, positions, reach, is_near = lights
    if not is_near:
        return directions[light, 0], directions[light, 1], directions[light, 2]
    x = positions[light, 0] - point[0]
    y = positions[light, 1] - point[1]
    z = positions[light, 2] - point[2]
    square = x * x + y * y + z * z
    factor = reach[light] / (square * np.sqrt(square))
    return x * factor, y * factor, z * factor


@numba.njit(nogil=True, cache=True)
def light_vectors(point, lights, out):  # pragma: no cover
    """Write the light vectors of every light at one point to `out` (F, 3)."""
    for k in range(len(out)):
        out[k] = light_vector(k, point, lights)


@numba.njit(nogil=True, cache=True)
def normal_equations(vectors, values, used):  # pragma: no cover
    """Solve min_b sum over used of (v . b - m)^2; vectors (F, 3) float64, values (F,) float32, used (F,) bool.

    Returns x, y, z of b, zeros where singular, and whether the lights in use span space.
    """
    a = b = c = d = e = f = p = q = r = 0.0
    for i in range(len(values)):
        if used[i]:
            x, y, z, m = vectors[i, 0], vectors[i, 1], vectors[i, 2], values[i]
            a += x * x
            b += x * y
            c += x * z
            d += y * y
            e += y * z
            f += z * z
            p += x * m
            q += y * m
            r += z * m
    return solve_sums((a, b, c, d, e, f, p, q, r), SINGULAR)


@numba.njit(nogil=True, cache=True)
def lit_samples(values, valid, threshold, keys, room, lit):  # pragma: no cover
    """Write 1 to `lit` (F,) float32 for what is no clipped and no shadowed sample, else 0; return how many are.

    Shadowed is what lies under `threshold` times the pixel's own 75th percentile (not its maximum, which
    a highlight would lift). A pixel with fewer than four lit samples keeps all that are not clipped. `keys` (F,) int32
    become those of the values; `room` (1,) float32 is to work in.
    """
    keys_of(values, keys)
    limit = threshold * value_of(smallest_key(keys, int(0.75 * (len(values) - 1))), room)
    count = _above(values, valid, limit, lit)
    return count if count >= 4 else _above(values, valid, -np.inf, lit)


@numba.njit(nogil=True, cache=True, fastmath={"reassoc"})
def _above(values, valid, limit, out):  # pragma: no cover
    """Write 1 to `out` where a sample is valid and above the limit, else 0; return how many."""
    count = np.float32(0)
    for k in range(len(values)):
        out[k] = np.float32(valid[k] & (values[k] > limit))
        count += out[k]
    return int(count)


@numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract", "nsz"})
def weighted_sums(vectors, values, weights):  # pragma: no cover
    """Return the normal equations of min_b sum w (v . b - m)^2, nine floats: upper triangle, then right side.

    `vectors` are (3, F), by component, and the order of summation is left to the compiler: it makes vectors of it.
    """
    u, v, w = vectors[0], vectors[1], vectors[2]
    a = b = c = d = e = f = p = q = r = 0.0
    for k in range(len(values)):
        m = np.float64(values[k])
        weight = np.float64(weights[k])
        x, y, z = weight * u[k], weight * v[k], weight * w[k]
        a += x * u[k]
        b += x * v[k]
        c += x * w[k]
        d += y * v[k]
        e += y * w[k]
        f += z * w[k]
        p += x * m
        q += y * m
        r += z * m
    return a, b, c, d, e, f, p, q, r


@numba.njit(nogil=True, cache=True, inline="always")
def adjugate(a, b, c, d, e, f):  # pragma: no cover
    """Return determinant and adjugate of a symmetric matrix, upper triangles both."""
    x, y, z = d * f - e * e, c * e - b * f, b * e - c * d
    return a * x + b * y + c * z, (x, y, z, a * f - c * c, b * c - a * e, a * d - b * b)


@numba.njit(nogil=True, cache=True)
def solve_sums(sums, singular):  # pragma: no cover
    """Solve [[a b c] [b d e] [c e f]] (x, y, z) = (p, q, r) by the adjugate; return as `normal_equations`.

    `singular` is `SINGULAR` where weights are alike, `SINGULAR_WEIGHTED` where they span decades.
    """
    a, b, c, d, e, f, p, q, r = sums
    det, (ia, ib, ic, id_, ie, if_) = adjugate(a, b, c, d, e, f)
    trace = (a + d + f) / 3.0
    if det <= singular * trace * trace * trace or trace <= 0.0:
        return 0.0, 0.0, 0.0, False
    return (ia * p + ib * q + ic * r) / det, (ib * p + id_ * q + ie * r) / det, (ic * p + ie * q + if_ * r) / det, True


@numba.njit(nogil=True, cache=True, fastmath={"reassoc"})
def residuals_of(columns, values, lit, b, out):  # pragma: no cover
    """Write |m - v . b| of the `lit` samples to `out`, and NaN, whose key is last, of the others; return how many.

    All in float32: half the time, and closer than any sample is.
    """
    x, y, z = np.float32(b[0]), np.float32(b[1]), np.float32(b[2])
    bits, size = out.view(np.int32), np.float32(0)
    for k in range(len(values)):
        out[k] = abs(values[k] - (columns[0, k] * x + columns[1, k] * y + columns[2, k] * z))
        size += lit[k]
    for k in range(len(values)):
        bits[k] = bits[k] if lit[k] > 0 else NO_KEY
    return int(size)


@numba.njit(nogil=True, cache=True, fastmath={"reassoc"})
def agreeing(columns, values, lit, before, b, limit, out):  # pragma: no cover
    """Write 1 to `out` where a lit sample is within the limit of b and faces it; say how many, and if one changed."""
    x, y, z, limit = np.float32(b[0]), np.float32(b[1]), np.float32(b[2]), np.float32(limit)
    size = changed = np.float32(0)
    for k in range(len(values)):
        shade = columns[0, k] * x + columns[1, k] * y + columns[2, k] * z
        keep = np.float32((shade > 0) & (abs(values[k] - shade) <= limit)) * lit[k]
        out[k] = keep
        size += keep
        changed += abs(keep - before[k])
    return int(size), changed > 0
