"""Compiled kernels of one pixel: the k-th smallest sample, which are lit, normal equations, which samples agree.

float64 accumulation and a 3 x 3 closed form: no Python and no allocation per pixel. Where the light comes from is a
`solve.samples.Geometry`.

float32 numbers are ordered as their bits are, read as integers, once the negative ones are turned round. A search by
halves over these keys counts how many are no larger, until one is left: each count is a handful of vector instructions,
where sorting or partitioning waits for mispredicted branches.
"""

import numba
import numpy as np

from scene.robust import MAD

NO_KEY = np.int32(2**31 - 1)
"""Larger than the key of any number: for what is left out."""
SINGULAR = 1e-6
"""det / (trace / 3)^3 of the 3 x 3 normal matrix under which a pixel's lit lights lie in a plane."""
SINGULAR_WEIGHTED = 1e-12
"""The same where a few samples may outweigh the rest a thousandfold: what float64 still solves."""
NOTHING = (0.0,) * 9
"""Normal equations without any sample."""


@numba.njit(nogil=True, cache=True)
def keys_of(values, keys):  # pragma: no cover
    """Write the keys of float32 `values` (n,) to `keys` (n,) int32: ordered as the values are."""
    bits = values.view(np.int32)
    for i in range(len(bits)):
        keys[i] = bits[i] ^ ((bits[i] >> np.int32(31)) & NO_KEY)


@numba.njit(nogil=True, cache=True)
def value_of(key, room):  # pragma: no cover
    """Return the float32 of a key; `room` (1,) float32 is to work in."""
    key = np.int32(key)
    room.view(np.int32)[0] = key ^ ((key >> np.int32(31)) & NO_KEY)
    return room[0]


@numba.njit(nogil=True, cache=True)
def _at_most(keys, limit):  # pragma: no cover
    count = np.int32(0)
    for i in range(len(keys)):
        count = np.int32(count + np.int32(keys[i] <= limit))
    return count


@numba.njit(nogil=True, cache=True)
def _largest_until(keys, limit):  # pragma: no cover
    largest = np.int32(-(2**31))
    for i in range(len(keys)):
        largest = max(largest, keys[i] if keys[i] <= limit else np.int32(-(2**31)))
    return largest


@numba.njit(nogil=True, cache=True)
def smallest_key(keys, k):  # pragma: no cover
    """Return the k-th smallest key, k from 0; keys that are `NO_KEY` come last."""
    low = high = keys[0]
    for i in range(len(keys)):
        low, high = min(low, keys[i]), max(high, keys[i])
    low, high = np.int64(low), np.int64(high)
    below, within = np.int64(0), np.int64(len(keys))
    while low < high and within > 1:
        middle = (low + high) >> 1
        count = np.int64(_at_most(keys, np.int32(middle)))
        if count > k:
            high, within = middle, count - below
        else:
            low, within, below = middle + 1, within + below - count, count
    return _largest_until(keys, np.int32(high))


@numba.njit(nogil=True, cache=True)
def median(keys, count, room):  # pragma: no cover
    """Return the median of the `count` values whose keys are not `NO_KEY`; the mean of the two in the middle."""
    lower = smallest_key(keys, (count - 1) // 2)
    low = np.float64(value_of(lower, room))
    if count % 2 or _at_most(keys, lower) > count // 2:
        return low
    upper = NO_KEY
    for i in range(len(keys)):
        upper = min(upper, keys[i] if keys[i] > lower else NO_KEY)
    return 0.5 * (low + np.float64(value_of(upper, room)))


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


@numba.njit(nogil=True, cache=True, inline="always")
def half_vector(x, y, z, view):  # pragma: no cover
    """Return the unit vector (3 floats) halfway between a light vector and the view, and the light vector's length."""
    length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length + view[0], y / length + view[1], z / length + view[2]
    # A light opposite to the view has no half vector.
    half = max(np.sqrt(x * x + y * y + z * z), 1e-9)
    return x / half, y / half, z / half, length


@numba.njit(nogil=True, cache=True)
def light_vectors(point, lights, out, rounded):  # pragma: no cover
    """Write the light vectors of every light at one point, by component, to `out` (3, F), and as float32."""
    for k in range(out.shape[1]):
        out[0, k], out[1, k], out[2, k] = light_vector(k, point, lights)
        rounded[0, k], rounded[1, k], rounded[2, k] = out[0, k], out[1, k], out[2, k]


@numba.njit(nogil=True, cache=True, inline="always")
def with_sample(sums, x, y, z, m):  # pragma: no cover
    """Return normal equations as `solve_sums` takes them, with one sample m under the light vector x, y, z more."""
    a, b, c, d, e, f, p, q, r = sums
    return a + x * x, b + x * y, c + x * z, d + y * y, e + y * z, f + z * z, p + x * m, q + y * m, r + z * m


@numba.njit(nogil=True, cache=True)
def least_squares(samples, used, spare):  # pragma: no cover
    """Return b (P, 3) of min_b sum over `used` (P, F) of (v . b - m)^2; zeros where the lights do not span space.

    Where those in use do not, `spare` (P, F) takes their place in `used`.
    """
    gray, _, points, geometry = samples
    b = np.zeros((len(gray), 3))
    for i in range(len(gray)):
        for attempt in range(2):
            sums = NOTHING
            for k in range(gray.shape[1]):
                if used[i, k]:
                    x, y, z = light_vector(k, points[i], geometry)
                    sums = with_sample(sums, x, y, z, gray[i, k])
            b[i, 0], b[i, 1], b[i, 2], well = solve_sums(sums, SINGULAR)
            if well or attempt:
                break
            used[i] = spare[i]
    return b


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
    """Solve [[a b c] [b d e] [c e f]] (x, y, z) = (p, q, r) by the adjugate; return b, and whether it is told.

    `singular` is `SINGULAR` where weights are alike, `SINGULAR_WEIGHTED` where they span decades.
    """
    a, b, c, d, e, f, p, q, r = sums
    det, (ia, ib, ic, id_, ie, if_) = adjugate(a, b, c, d, e, f)
    trace = (a + d + f) / 3.0
    if det <= singular * trace * trace * trace or trace <= 0.0:
        return 0.0, 0.0, 0.0, False
    return (ia * p + ib * q + ic * r) / det, (ib * p + id_ * q + ie * r) / det, (ic * p + ie * q + if_ * r) / det, True


@numba.njit(nogil=True, cache=True, fastmath={"reassoc"})
def limit_of(columns, values, lit, b, sigmas, floor, out, room):  # pragma: no cover
    """Return how far a sample may lie off b and agree: `sigmas` times the robust sigma of the `lit`, or the `floor`.

    Writes |m - v . b| of the lit ones to `out`, and NaN, whose key is last, of the others. All in float32: half the
    time, and closer than any sample is. `room` (1,) float32 is to work in.
    """
    x, y, z = np.float32(b[0]), np.float32(b[1]), np.float32(b[2])
    bits, size = out.view(np.int32), np.float32(0)
    for k in range(len(values)):
        out[k] = abs(values[k] - (columns[0, k] * x + columns[1, k] * y + columns[2, k] * z))
        size += lit[k]
    for k in range(len(values)):
        bits[k] = bits[k] if lit[k] > 0 else NO_KEY
    return sigmas * max(MAD * median(bits, int(size), room), floor)


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
