"""The judgement of a tile's pixels from the sums over their lights: normal, albedo, condition number, sigma.

The same as `solve.assess`, for `solve.pixelwise.ls_tiles`; rows and indices as in `solve.pixelwise.tile_sums`.
"""

import numba
import numpy as np

from solve.assess import condition_and_inverse
from solve.codes import tile_at
from solve.pixelwise.kernels import SINGULAR, solve_sums
from solve.pixelwise.tile_sums import TILE, WORD

MATRIX_ROWS, RESULT_ROWS = 8, 8
_u = np.uint64


@numba.njit(nogil=True, cache=True)
def matrices(bits, directions, of_all, n, out):  # pragma: no cover
    """Write inverse normal matrix and condition number of each pixel's lights, and how many they are.

    Only what differs from the pixel before is added and taken away; `of_all` begins with the matrix of all lights. A
    pixel whose lights do not span space has 0 lights.
    """
    lights = len(directions)
    before = np.empty(len(bits) // TILE, np.int32)
    xx, xy, xz, yy, yz, zz = of_all
    size, well = lights, True
    found, (ia, ib, ic, id_, ie, if_) = condition_and_inverse(xx, xy, xz, yy, yz, zz)
    for word in range(len(before)):
        there = min(lights - word * WORD, WORD)
        before[word] = np.int32(np.int64(-1) if there == WORD else (np.int64(1) << there) - 1)
    for i in range(n):
        changed = False
        for word in range(len(before)):
            other = bits[_u(word * TILE + i)] ^ before[word]
            if other == 0:
                continue
            changed = True
            for k in range(word * WORD, min(word * WORD + WORD, lights)):
                bit = np.int32(1) << np.int32(k % WORD)
                if other & bit:
                    sign = 1 if bits[_u(word * TILE + i)] & bit else -1
                    x, y, z = directions[k, 0], directions[k, 1], directions[k, 2]
                    size += sign
                    xx += sign * x * x
                    xy += sign * x * y
                    xz += sign * x * z
                    yy += sign * y * y
                    yz += sign * y * z
                    zz += sign * z * z
            before[word] = bits[_u(word * TILE + i)]
        if changed:
            well = size >= 3 and solve_sums((xx, xy, xz, yy, yz, zz, 0.0, 0.0, 0.0), SINGULAR)[3]
            found, (ia, ib, ic, id_, ie, if_) = condition_and_inverse(xx, xy, xz, yy, yz, zz)
        out[_u(i)], out[_u(TILE + i)], out[_u(2 * TILE + i)], out[_u(3 * TILE + i)] = ia, ib, ic, id_
        out[_u(4 * TILE + i)], out[_u(5 * TILE + i)], out[_u(6 * TILE + i)] = ie, if_, found
        out[_u(7 * TILE + i)] = size if well else 0.0


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def fit_and_judge(total, matrix, weights, n, out):  # pragma: no cover
    """Write normal, albedo, sigma and the length of b of a tile's pixels; see `solve.assess.sigma_deg`."""
    red, green, blue = weights
    degrees = 180.0 / np.pi
    for i in range(n):
        ia, ib, ic = matrix[_u(i)], matrix[_u(TILE + i)], matrix[_u(2 * TILE + i)]
        id_, ie, if_ = matrix[_u(3 * TILE + i)], matrix[_u(4 * TILE + i)], matrix[_u(5 * TILE + i)]
        size = matrix[_u(7 * TILE + i)]
        rx, ry, rz = total[_u(i)], total[_u(TILE + i)], total[_u(2 * TILE + i)]
        gx, gy, gz = total[_u(3 * TILE + i)], total[_u(4 * TILE + i)], total[_u(5 * TILE + i)]
        bx, by, bz = total[_u(6 * TILE + i)], total[_u(7 * TILE + i)], total[_u(8 * TILE + i)]
        p = red * rx + green * gx + blue * bx
        q = red * ry + green * gy + blue * by
        r = red * rz + green * gz + blue * bz
        x, y, z = ia * p + ib * q + ic * r, ib * p + id_ * q + ie * r, ic * p + ie * q + if_ * r
        explained = x * p + y * q + z * r
        square = x * x + y * y + z * z
        length = np.sqrt(square)
        inverse = 1.0 / length
        x, y, z = x * inverse, y * inverse, z * inverse
        # b' A b = b . (right side), A being the normal matrix: what the samples' shading squared adds up to.
        share = square / explained
        squares = max(total[_u(9 * TILE + i)] - explained, 0.0)
        along = x * (ia * x + 2.0 * (ib * y + ic * z)) + y * (id_ * y + 2.0 * ie * z) + z * z * if_
        across = max(ia + id_ + if_ - along, 0.0) * squares / (size - 3.0)
        sigma = min(degrees * np.sqrt(0.5 * across) * inverse, 90.0)
        out[_u(i)], out[_u(TILE + i)], out[_u(2 * TILE + i)] = np.float32(x), np.float32(y), np.float32(z)
        out[_u(3 * TILE + i)] = np.float32((rx * x + ry * y + rz * z) * share)
        out[_u(4 * TILE + i)] = np.float32((gx * x + gy * y + gz * z) * share)
        out[_u(5 * TILE + i)] = np.float32((bx * x + by * y + bz * z) * share)
        out[_u(6 * TILE + i)] = np.float32(sigma if size > 3.0 else np.nan)
        out[_u(7 * TILE + i)] = np.float32(length)


@numba.njit(nogil=True, cache=True)
def albedo_of_facing(band, where, lights, bits, total, normal, albedo):  # pragma: no cover
    """Write a pixel's `albedo` (3,) without its kept samples whose light is behind the `normal`; those do not count.

    `where`: its row, its column and its place in the tile. `lights`: directions (F, 3), and what one code is divided
    by the intensities (F, 3).
    """
    codes, shape, ambient, black, unit = band.codes, band.shape, band.ambient, band.black, band.unit
    (row, column, i), (directions, factors) = where, lights
    x, y, z = normal[0], normal[1], normal[2]
    bottom = 0.0
    for c in range(3):
        at = 3 * c * TILE + i
        albedo[c] = total[at] * x + total[at + TILE] * y + total[at + 2 * TILE] * z
    for k in range(shape[0]):
        if bits[k // WORD * TILE + i] & (np.int32(1) << np.int32(k % WORD)):
            shade = directions[k, 0] * x + directions[k, 1] * y + directions[k, 2] * z
            if shade > 0.0:
                bottom += shade * shade
                continue
            at, below = tile_at(shape, k, row, column), tile_at(shape, 0, row, column)
            for c in range(3):
                value = np.float32(codes[at + c]) - black
                if len(ambient):
                    value -= ambient[below + c] / unit[k]
                albedo[c] -= value * factors[k, c] * shade
    for c in range(3):
        albedo[c] = albedo[c] / bottom if bottom > 0.0 else np.nan


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _cone(result, n):  # pragma: no cover
    """Return an axis near all normals of a tile, and how far along it a light must be to be before each of them."""
    u = v = w = np.float32(0)
    for i in range(n):
        u, v, w = u + result[_u(i)], v + result[_u(TILE + i)], w + result[_u(2 * TILE + i)]
    length = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    least = np.float32(1)
    for i in range(n):
        least = min(least, u * result[_u(i)] + v * result[_u(TILE + i)] + w * result[_u(2 * TILE + i)])
    return u, v, w, np.sqrt(1.0 - least * least) + 1e-3 if least > 0.0 else np.inf


@numba.njit(nogil=True, cache=True)
def _add_behind(light, bits, word, bit, result, n, behind):  # pragma: no cover
    """Note in `behind` the pixels that keep a sample whose light (three floats) is behind the normal."""
    u, v, w = light
    for i in range(n):
        shade = u * result[_u(i)] + v * result[_u(TILE + i)] + w * result[_u(2 * TILE + i)]
        behind[_u(i)] |= (bits[_u(word * TILE + i)] & bit) if shade <= np.float32(0) else np.int32(0)


@numba.njit(nogil=True, cache=True)
def find_behind(directions, bits, result, n, behind):  # pragma: no cover
    """Write to `behind` (n,) whether a pixel keeps a sample whose light is behind its normal."""
    behind[:] = 0
    u, v, w, enough = _cone(result, n)
    for k in range(len(directions)):
        x, y, z = np.float32(directions[k, 0]), np.float32(directions[k, 1]), np.float32(directions[k, 2])
        if not x * u + y * v + z * w > enough:
            _add_behind((x, y, z), bits, k // WORD, np.int32(1) << np.int32(k % WORD), result, n, behind)
