"""Sums over samples that a material's fit is made of: each pixel's albedo eliminated, one pass for one coat."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from twin.material.material_samples import Samples
from twin.material.reflection_models import Coat, shade

TILT = 1e-3
"""Radians, of the finite differences."""


@numba.njit(nogil=True, cache=True)
def _reduce(
    normals, views, toward, irradiance, values, weights, spread, roughness, index, transmittance, body, covered
):
    count, frames = toward.shape[:2]
    out = np.zeros((count, 3, 3))
    for p in range(count):
        rough = np.sqrt(roughness * roughness + spread[p])
        sums = np.zeros((3, 6))
        for f in range(frames):
            if weights[p, f, 0] == 0 and weights[p, f, 1] == 0 and weights[p, f, 2] == 0:
                continue
            d, s = shade(
                normals[p, 0], normals[p, 1], normals[p, 2], views[p, 0], views[p, 1], views[p, 2],
                toward[p, f, 0], toward[p, f, 1], toward[p, f, 2], rough, index, transmittance, body, covered
            )  # fmt: skip
            for c in range(3):
                w, e, v = weights[p, f, c], irradiance[p, f, c], values[p, f, c]
                a, b = e * d, e * s
                sums[c, 0] += w * a * a
                sums[c, 1] += w * a * b
                sums[c, 2] += w * b * b
                sums[c, 3] += w * a * v
                sums[c, 4] += w * b * v
                sums[c, 5] += w * v * v
        for c in range(3):
            dd, ds, ss, dv, sv, vv = sums[c]
            if dd > 0:
                out[p, c, 0] = ss - ds * ds / dd
                out[p, c, 1] = sv - ds * dv / dd
                out[p, c, 2] = vv - dv * dv / dd
    return out


def reduced(samples: Samples, weights: NDArray[np.float32], surface: Coat) -> NDArray[np.float64]:
    """Return (P, 3 channels, 3): A, B, C of each pixel's squared residual C - 2 k B + k^2 A at the strength k.

    The albedo that is best for each k is eliminated [Golub1973]. `weights` (P, F, 3): 1 / variance, 0 where unused.
    """
    return _spread(_reduce, _arrays(samples, weights), surface.numbers)


def _arrays(samples: Samples, weights: NDArray[np.float32]) -> tuple[NDArray, ...]:
    return (
        samples.normals, samples.views, samples.toward, samples.irradiance, samples.values, weights, samples.spread,
    )  # fmt: skip


def _spread(kernel: Callable, arrays: tuple[NDArray, ...], rest: tuple) -> Any:
    """Run a kernel on pieces of the pixels, on all cores; return its answers put together."""
    pieces = np.array_split(np.arange(len(arrays[0])), os.cpu_count() or 1)
    slices = [slice(piece[0], piece[-1] + 1) for piece in pieces if len(piece)]
    with ThreadPoolExecutor(len(slices)) as pool:
        found = list(pool.map(lambda part: kernel(*(array[part] for array in arrays), *rest), slices))
    if isinstance(found[0], tuple):
        return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
    return np.concatenate(found)


@numba.njit(nogil=True, cache=True)
def _predict(
    normals,
    views,
    toward,
    irradiance,
    values,
    weights,
    spread,
    strength,
    roughness,
    index,
    transmittance,
    body,
    covered,
):
    count, frames = toward.shape[:2]
    predicted, slope = np.empty((count, frames, 3), np.float32), np.empty((count, frames, 3), np.float32)
    albedo = np.zeros((count, 3), np.float32)
    for p in range(count):
        rough = np.sqrt(roughness * roughness + spread[p])
        nx, ny, nz = normals[p]
        vx, vy, vz = views[p]
        # Two tangents: along the smallest component's cross product, and across.
        if abs(nz) < 0.9:
            tx, ty, tz = -ny, nx, 0.0 * nz
        else:
            tx, ty, tz = 0.0 * nx, -nz, ny
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / length, ty / length, tz / length
        ux, uy, uz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        body_of, coat_of = np.empty((frames, 3)), np.empty((frames, 3))
        for f in range(frames):
            lx, ly, lz = toward[p, f]
            body_of[f, 0], coat_of[f, 0] = shade(
                nx, ny, nz, vx, vy, vz, lx, ly, lz, rough, index, transmittance, body, covered
            )
            body_of[f, 1], coat_of[f, 1] = shade(
                nx + TILT * tx, ny + TILT * ty, nz + TILT * tz, vx, vy, vz, lx, ly, lz,
                rough, index, transmittance, body, covered
            )  # fmt: skip
            body_of[f, 2], coat_of[f, 2] = shade(
                nx + TILT * ux, ny + TILT * uy, nz + TILT * uz, vx, vy, vz, lx, ly, lz,
                rough, index, transmittance, body, covered
            )  # fmt: skip
        for c in range(3):
            top, bottom = 0.0, 0.0
            for f in range(frames):
                a = irradiance[p, f, c] * body_of[f, 0]
                top += weights[p, f, c] * a * (values[p, f, c] - irradiance[p, f, c] * strength[p, c] * coat_of[f, 0])
                bottom += weights[p, f, c] * a * a
            own = max(top / bottom, 0.0) if bottom > 0 else 0.0
            albedo[p, c] = own
            for f in range(frames):
                e = irradiance[p, f, c]
                here = own * body_of[f, 0] + strength[p, c] * coat_of[f, 0]
                one = own * body_of[f, 1] + strength[p, c] * coat_of[f, 1] - here
                two = own * body_of[f, 2] + strength[p, c] * coat_of[f, 2] - here
                predicted[p, f, c] = e * here
                slope[p, f, c] = e * np.sqrt((one * one + two * two) / 2) / TILT
    return predicted, slope, albedo


def predicted(
    samples: Samples, weights: NDArray[np.float32], surface: Coat, strength: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return what the material gives back (P, F, 3), its change (P, F, 3) for a radian's tilt along one axis of the
    normal (root mean square over the two), and the albedo (P, 3).

    `strength` (P, 3): of the coat; the albedo is each pixel's best.
    """
    arrays = (*_arrays(samples, weights), np.ascontiguousarray(strength, np.float64))
    return _spread(_predict, arrays, surface.numbers)
