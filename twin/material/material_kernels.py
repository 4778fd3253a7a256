"""Sums over samples that a material's fit is made of: each pixel's albedo eliminated, one pass for one coat."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from scene.microfacets import VECTORS
from twin.material.material_samples import MaterialSamples
from twin.material.reflection_models import SHADED, Coat, shade, vector

Image = NDArray[np.float32]

WORTH_A_THREAD = 30_000
"""Samples, pixels times frames, below which to hand them over takes as long as what is done with them."""


@lru_cache(1)
def _pool(_process: int) -> ThreadPoolExecutor:
    """Return the threads of this process: to start them takes longer than what they do for one coat."""
    return ThreadPoolExecutor(os.cpu_count() or 1)


def _on_all_cores(kernel: Callable, samples: MaterialSamples, weights: Image, *rest: Any) -> Any:
    """Run a kernel on pieces of the pixels; return its answers put together."""
    count = min(os.cpu_count() or 1, samples.usable.size // WORTH_A_THREAD)
    if count < 2:
        return kernel(samples, weights, *rest)
    pieces = np.array_split(np.arange(len(weights)), count)
    slices = [slice(piece[0], piece[-1] + 1) for piece in pieces if len(piece)]
    # A forked process has none of its parent's threads.
    found = list(_pool(os.getpid()).map(lambda part: kernel(samples.only(part), weights[part], *rest), slices))
    if isinstance(found[0], tuple):
        return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
    return np.concatenate(found)


@numba.njit(**VECTORS)
def _reduce(pixels, weights, surface):
    count, frames = pixels.toward.shape[:2]
    out, shaded = np.zeros((count, 3, 3)), np.empty((SHADED, frames))
    for p in range(count):
        rough = np.sqrt(surface.roughness * surface.roughness + pixels.spread[p])
        shade(vector(pixels.normals[p]), vector(pixels.views[p]), pixels.toward[p], rough, surface, shaded)
        for c in range(3):
            dd, ds, ss, dv, sv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for f in range(frames):
                w, e, v = weights[p, f, c], pixels.irradiance[p, f, c], pixels.values[p, f, c]
                a, b = e * shaded[0, f], e * shaded[1, f]
                dd += w * a * a
                ds += w * a * b
                ss += w * b * b
                dv += w * a * v
                sv += w * b * v
                vv += np.float64(w) * v * v
            if dd > 0:
                out[p, c, 0] = ss - ds * ds / dd
                out[p, c, 1] = sv - ds * dv / dd
                out[p, c, 2] = vv - dv * dv / dd
    return out


def reduced(samples: MaterialSamples, weights: Image, surface: Coat) -> NDArray[np.float64]:
    """Return (P, 3 channels, 3): A, B, C of each pixel's squared residual C - 2 k B + k^2 A at the strength k.

    The albedo that is best for each k is eliminated [Golub1973]. `weights` (P, F, 3): 1 / variance, 0 where unused.
    """
    return _on_all_cores(_reduce, samples, weights, surface)


@numba.njit(**VECTORS)
def _predict(pixels, weights, strength, surface):
    count, frames = pixels.toward.shape[:2]
    found, albedo = np.empty((count, frames, 3), np.float32), np.zeros((count, 3), np.float32)
    shaded = np.empty((SHADED, frames))
    for p in range(count):
        rough = np.sqrt(surface.roughness * surface.roughness + pixels.spread[p])
        shade(vector(pixels.normals[p]), vector(pixels.views[p]), pixels.toward[p], rough, surface, shaded)
        for c in range(3):
            top, bottom = 0.0, 0.0
            for f in range(frames):
                e, w = pixels.irradiance[p, f, c], weights[p, f, c]
                a = e * shaded[0, f]
                top += w * a * (pixels.values[p, f, c] - e * strength[c] * shaded[1, f])
                bottom += w * a * a
            own = max(top / bottom, 0.0) if bottom > 0 else 0.0
            albedo[p, c] = own
            for f in range(frames):
                found[p, f, c] = pixels.irradiance[p, f, c] * (own * shaded[0, f] + strength[c] * shaded[1, f])
    return found, albedo


def predicted(
    samples: MaterialSamples, weights: Image, surface: Coat, strength: NDArray[np.float64]
) -> tuple[Image, Image]:
    """Return what the material gives back (P, F, 3), and the albedo (P, 3): each pixel's best.

    `strength` (3,): of the coat.
    """
    return _on_all_cores(_predict, samples, weights, np.ascontiguousarray(strength, np.float64), surface)
