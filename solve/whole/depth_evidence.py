"""What the shading itself says of a pixel's depth: near a light, moving along the ray turns and dims the light."""

import numba
import numpy as np

from solve.pixelwise.kernels import NOTHING, SINGULAR, light_vector, solve_sums, with_sample


@numba.njit(nogil=True, cache=True)
def depth_evidence(samples, b, way):  # pragma: no cover
    """Linearise the fit b (P, 3) of every pixel in its place on its ray.

    `samples.valid` are the samples that b is fitted to, `way` (P, 3) how the point moves with the unknown t.

    Returns slope and information (P,): the best step is slope / information, its variance that of a sample over the
    information; the sum of the squared residuals (P,); and how many samples are used (P,).

    Notes
    -----
    m_f = l_f(t) . b with l = reach (q - p) / |q - p|^3; j_f = (dl_f / dt) . b. What b can follow of j is taken out
    (L the used light vectors): j' = j - L (L^T L)^-1 L^T j; slope = j' . r, information = j' . j'.
    """
    gray, used, points, geometry = samples
    positions, reach = geometry.positions, geometry.reach
    pixels, lights = gray.shape
    slope, information = np.zeros(pixels), np.zeros(pixels)
    squares, count = np.zeros(pixels), np.zeros(pixels, np.int64)
    for i in range(pixels):
        sums = NOTHING
        along = across = p = q = r = 0.0
        for k in range(lights):
            if not used[i, k]:
                continue
            x, y, z = light_vector(k, points[i], geometry)
            gap = gray[i, k] - (x * b[i, 0] + y * b[i, 1] + z * b[i, 2])
            u = positions[k, 0] - points[i, 0]
            v = positions[k, 1] - points[i, 1]
            w = positions[k, 2] - points[i, 2]
            square = u * u + v * v + w * w
            toward = 3.0 * (u * way[i, 0] + v * way[i, 1] + w * way[i, 2]) / square
            step = reach[k] / (square * np.sqrt(square)) * (
                b[i, 0] * (toward * u - way[i, 0]) + b[i, 1] * (toward * v - way[i, 1])
                + b[i, 2] * (toward * w - way[i, 2])
            )  # fmt: skip
            sums = with_sample(sums, x, y, z, step)
            p += x * gap
            q += y * gap
            r += z * gap
            along += step * step
            across += step * gap
            squares[i] += gap * gap
            count[i] += 1
        x, y, z, well = solve_sums(sums, SINGULAR)
        if well:
            information[i] = max(along - (x * sums[6] + y * sums[7] + z * sums[8]), 0.0)
            slope[i] = across - (x * p + y * q + z * r)
    return slope, information, squares, count
