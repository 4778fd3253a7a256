"""Compiled kernels: normal equations of one pixel, and the albedo given a normal.

float64 accumulation and a 3 x 3 closed form: no Python and no allocation per pixel.
"""

import numba
import numpy as np

SINGULAR = 1e-6
"""det / (trace / 3)^3 of the 3 x 3 normal matrix under which a pixel's lit lights lie in a plane."""


@numba.njit(nogil=True, cache=True, inline="always")
def light_vector(light, point, directions, positions, reach, is_near):  # pragma: no cover
    """Return the light vector (3 floats) of one light at one point; see `Lights.toward`."""
    if not is_near:
        return directions[light, 0], directions[light, 1], directions[light, 2]
    x = positions[light, 0] - point[0]
    y = positions[light, 1] - point[1]
    z = positions[light, 2] - point[2]
    square = x * x + y * y + z * z
    factor = reach[light] / (square * np.sqrt(square))
    return x * factor, y * factor, z * factor


@numba.njit(nogil=True, cache=True)
def normal_equations(vectors, values, used):  # pragma: no cover
    """Solve min_b sum over used of (v . b - m)^2.

    Parameters
    ----------
    vectors : (F, 3) float64
    values : (F,) float32
    used : (F,) bool

    Returns
    -------
    x, y, z : float
        b = albedo x normal; zeros where singular.
    well : bool
        The lights in use span space.
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
    # Adjugate of the symmetric [[a b c] [b d e] [c e f]].
    ia, ib, ic = d * f - e * e, c * e - b * f, b * e - c * d
    id_, ie, if_ = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * ia + b * ib + c * ic
    trace = (a + d + f) / 3.0
    if det <= SINGULAR * trace * trace * trace or trace <= 0.0:
        return 0.0, 0.0, 0.0, False
    return (ia * p + ib * q + ic * r) / det, (ib * p + id_ * q + ie * r) / det, (ic * p + ie * q + if_ * r) / det, True


@numba.njit(nogil=True, cache=True)
def albedo_given_normal(
    color, used, points, normals, directions, positions, reach, is_near, intensities
):  # pragma: no cover
    """Return (P, 3) float32, per channel sum(m s) / sum(s^2) over used samples, s = max(0, v . n).

    m is the sample divided by its light's intensity, as in the fit of the normal: how strong a flash
    was changes nothing.
    """
    pixels, lights = used.shape
    albedo = np.full((pixels, 3), np.nan, np.float32)
    for i in range(pixels):
        if np.isnan(normals[i, 0]):
            continue
        top = np.zeros(3)
        bottom = np.zeros(3)
        for k in range(lights):
            if not used[i, k]:
                continue
            x, y, z = light_vector(k, points[i], directions, positions, reach, is_near)
            shade = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
            if shade <= 0.0:
                continue
            for channel in range(3):
                top[channel] += color[i, k, channel] / intensities[k, channel] * shade
                bottom[channel] += shade * shade
        for channel in range(3):
            if bottom[channel] > 0.0:
                albedo[i, channel] = top[channel] / bottom[channel]
    return albedo
