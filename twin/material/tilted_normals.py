"""Each pixel's normal as its photographs want it, held to the scan's by how much that errs."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.material.fit_material import PAYS, MaterialFit, robust
from twin.material.material_noise import student_weights
from twin.material.material_samples import FEWEST, Samples
from twin.material.reflection_models import reflected

Array = NDArray[np.float64]

STEP = 1e-3
"""Radians, of the finite differences."""
ROUNDS = 2
"""Of Gauss and Newton: the leans are small."""


def likeliest_normals(samples: Samples, fit: MaterialFit, sigma_deg: NDArray | float) -> NDArray[np.float32]:
    """Return the normals (P, 3) that photographs and scan together make the likeliest.

    sigma_deg, (P,) or one: Of the scan's normals, one axis; what the fit's residuals say of them, where that is less.

    A pixel's normal leans by d along two tangents: sum of w (e - J d)^2 + |d|^2 / sigma^2 is least, with e what the fit
    leaves, w Student's weights, J the prediction's change; the albedo is eliminated [Golub1973].
    """
    # What tilts explain is no longer noise.
    noise = replace(fit.noise, tilt_deg=0.0)
    held = np.radians(np.clip(np.nan_to_num(sigma_deg), 1e-3, max(fit.noise.tilt_deg, 1e-3)))
    pull = np.broadcast_to(1 / held**2, len(samples))
    scan, axes = samples.normals.astype(np.float64), np.stack(tangents(samples.normals), -1)
    lean = np.zeros((len(samples), 2))
    normals = samples.normals
    for _ in range(ROUNDS):
        now = replace(samples, normals=normals)
        values, _, variance, albedo = robust(now, fit, noise)
        weights = student_weights(now, values, variance).astype(np.float64)[..., None]
        design = now.irradiance * reflected(fit.surface, normals, now.views, now.toward)[0][..., None]
        tilted = [change(now, fit, albedo, turned(normals, axes[..., k]), now.toward) for k in (0, 1)]
        # Albedo first, then the two leans.
        columns = np.stack([design, *tilted], -1).astype(np.float64)
        square = np.einsum("pfck,pfcl->pckl", weights * columns, columns)
        right = np.einsum("pfck,pfc->pck", weights * columns, (now.values - values).astype(np.float64))
        own, cross = np.maximum(square[..., 0, 0], 1e-300), square[..., 1:, 0]
        inner = (square[..., 1:, 1:] - cross[..., None] * cross[..., None, :] / own[..., None, None]).sum(1)
        wanted = (right[..., 1:] - cross * (right[..., :1] / own[..., None])).sum(1)
        inner += pull[:, None, None] * np.eye(2)
        lean += np.linalg.solve(inner, (wanted - pull[:, None] * lean)[..., None])[..., 0]
        moved = scan + np.einsum("pik,pk->pi", axes, lean)
        normals = (moved / np.linalg.norm(moved, axis=1, keepdims=True)).astype(np.float32)
    return normals


def foretells_better(samples: Samples, fit: MaterialFit, sigma_deg: NDArray | float) -> tuple[bool, str]:
    """Return whether normals that every second frame tells foretell the others better, and the words for it."""
    given = np.arange(samples.usable.shape[1]) % 2 == 0
    enough = (samples.usable & given).sum(1) >= 3
    every = samples.only(enough)
    if len(every) < FEWEST:
        return False, "too few frames to judge other normals by"
    if isinstance(sigma_deg, np.ndarray):
        sigma_deg = sigma_deg[enough]
    half, held = replace(every, usable=every.usable & given), every.usable & ~given
    missed = []
    for normals in (every.normals, likeliest_normals(half, fit, sigma_deg)):
        values = robust(replace(half, normals=normals), fit, fit.noise)[0]
        missed.append(float(np.linalg.norm((every.values - values)[held]) / np.linalg.norm(every.values[held])))
    words = f"the error in frames not fitted to is {100 * missed[0]:.1f} % with the scan's, {100 * missed[1]:.1f} %"
    return missed[1] < (1 - PAYS) * missed[0], f"{words} with those that the photographs tell"


def change(samples: Samples, fit: MaterialFit, albedo: NDArray, normals: NDArray, toward: NDArray) -> Array:
    """Return the prediction's change (P, F, 3) over `STEP`, from the samples' own normals and lights to others."""
    body, gloss = reflected(fit.surface, samples.normals, samples.views, samples.toward)
    moved = normals.astype(np.float32), samples.views, np.ascontiguousarray(toward, np.float32)
    after, shine = reflected(fit.surface, *moved)
    light = np.where(samples.usable[..., None], samples.irradiance, 0).astype(np.float64)
    diffuse = albedo.astype(np.float64)[:, None] * (after - body)[..., None]
    return light * (diffuse + fit.strength * (shine - gloss)[..., None]) / STEP


def tangents(vectors: NDArray) -> tuple[Array, Array]:
    """Return two unit vectors across unit vectors (..., 3), that change slowly with them."""
    x, y, z = np.moveaxis(vectors.astype(np.float64), -1, 0)
    first = np.stack([z, 0 * x, -x], -1)
    first /= np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-9)
    return first, np.cross(np.stack([x, y, z], -1), first)


def turned(vectors: NDArray, tangent: Array) -> Array:
    """Return unit vectors (..., 3) turned by `STEP` toward a tangent."""
    moved = vectors + STEP * tangent
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)
