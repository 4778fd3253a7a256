"""A sphere's cone fitted to the profiles across its limb, all frames and directions together."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.edge_profile import MIRROR_FREE, STEP_PX, Limb, Shifts, measure
from calibrate.silhouette.outline import moved, offset_jacobian, outline_with_normals
from calibrate.silhouette.static_circle import robust_step
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
Reader = Callable[[Array, Array, Array], NDArray[np.float32]]
"""Takes points (N, 2), normals (N, 2) and offsets (M,) to strips (F, N, M)."""
BINS = 72
"""Profiles along the outline, each a mean of neighbours: amplitudes may be averaged, a shift read in noise may not."""
SECTORS = 24
"""Errors along an outline come in arcs (a shadow, a reflection): an arc counts as one observation."""
PROFILE_PX = 0.1
"""What a single profile errs by, however little noise it has: the limb is never quite the model's."""
TUKEY = 4.0
"""Standard deviations from which on a profile is not believed."""


@dataclass(frozen=True)
class Settled:
    """An outline with the limb that fits best, the covariance (3, 3) of (u, v, radius), and the limb's `doubt`."""

    sphere: Sphere
    limb: Limb
    covariance: Array
    doubt: float


def settle(read: Reader, camera: Camera, sphere: Sphere, limb: Limb, *, free_blur: bool) -> Settled | None:
    """Move the outline, and the blur if it is free, until the limb's profiles fit.

    Parameters
    ----------
    read : Reader
    camera : Camera
    sphere : Sphere
        The start, within a blur's width of the outline.
    limb : Limb
        The start.
    free_blur : bool

    Returns
    -------
    Settled or None
        None where the profiles do not determine the outline, or lead away from it.
    """
    for turn in range(10):
        limb = replace(limb, radius_px=sphere.radius_px)
        strips, offsets, jacobian = _look(read, camera, sphere, limb)
        limb, shifts, believed = _measure(strips, offsets, limb)
        variance = PROFILE_PX**2 + 1 / np.maximum(shifts.information, 1e-12)
        reach = TUKEY * np.sqrt(variance)
        step = robust_step(jacobian, shifts.offset, believed / variance, reach * max(1, 4 * 0.5**turn))
        if step is None or np.abs(step).max() > 2 * limb.blur_px + 1:
            return None
        sphere = moved(sphere, step)
        change = shifts.blur_px / limb.blur_px - 1 if free_blur else 0.0
        limb = replace(limb, blur_px=limb.blur_px * (1 + change))
        if turn == 9 or (turn >= 4 and np.abs(step).max() < 1e-3 and abs(change) < 2e-3):
            residual = shifts.offset - jacobian @ step
            weight = believed / variance * np.maximum(1 - (residual / reach) ** 2, 0) ** 2
            covariance = _clustered_covariance(jacobian, residual, weight)
            return None if covariance is None else Settled(sphere, limb, covariance, shifts.doubt)
    return None


def _look(read: Reader, camera: Camera, sphere: Sphere, limb: Limb) -> tuple[NDArray[np.float32], Array, Array]:
    """Return binned strips (F, `BINS`, M), their offsets (M,) and the Jacobian (F * `BINS`, 3)."""
    count = BINS * int(np.clip(np.ceil(2 * np.pi * sphere.radius_px / BINS), 2, 12))
    points, normals = outline_with_normals(camera, sphere, count)
    outward = inward = 2.6 * limb.blur_px + 2
    if limb.mirror:  # what a mirror shows farther in is no longer what lies around the ball
        share, blurs = (0.12, 2.0) if "slope" in limb.terms else (0.06, 1.5)
        inward = min(outward, max(share * sphere.radius_px, blurs * limb.blur_px + 0.5))
    offsets = np.arange(-inward, outward + 0.01, STEP_PX)
    strips = read(points, normals, offsets)
    grouped = strips.reshape(len(strips), BINS, -1, len(offsets))
    known = np.isfinite(grouped).all(-1, keepdims=True)
    number = known.sum(2)
    total = np.where(known, grouped, 0).sum(2)
    binned = np.where(number > 0.5 * grouped.shape[2], total / np.maximum(number, 1), np.nan)
    jacobian = offset_jacobian(camera, sphere, points, normals).reshape(BINS, -1, 3).mean(1)
    return binned.astype(np.float32), offsets, np.tile(jacobian, (len(strips), 1))


def _measure(strips: NDArray[np.float32], offsets: Array, limb: Limb) -> tuple[Limb, Shifts, Array]:
    """Return the limb with its reflectance as the strips show it, the shifts, and which of them (P,) to believe."""
    if not limb.mirror:
        shifts = measure(strips, offsets, limb)
        # A matte ball's limb is lit, or dark, up to the outline; where n.l turns negative within the strip the
        # profile has another corner.
        believed = shifts.amplitudes[:, 0] > -0.02 * np.abs(shifts.amplitudes[:, 1])
    else:
        free = measure(strips, offsets, replace(limb, terms=MIRROR_FREE, mirror=0.0))
        # What a mirror shows at its limb is dimmer than what lies behind it. Where it is brighter, the ball's own
        # shadow lies beside it and is mirrored in less than a pixel.
        ratio = free.amplitudes[:, 0] / np.maximum(free.amplitudes[:, 2], 1e-4)
        believed = (ratio > 0.2) & (ratio < 0.97) & (free.information > 0)
        calm = believed & (free.misfit < 2)
        if calm.mean() > 0.1:
            limb = replace(limb, mirror=float(np.median(ratio[calm])))
        shifts = measure(strips, offsets, limb)
    if believed.mean() < 0.2:
        believed = np.ones(len(believed), bool)
    return limb, shifts, believed.astype(np.float64)


def _clustered_covariance(jacobian: Array, residual: Array, weight: Array) -> Array | None:
    """Return the (3, 3) covariance of a weighted fit whose errors agree within a sector.

    Notes
    -----
    The sandwich H^-1 (sum_s g_s g_s^T) H^-1, g_s = sum over the sector's edges of w r J, times S / (S - 3).
    Hundreds of profiles on one outline are not hundreds of observations: the same arc errs alike in all frames.
    """
    sector = np.tile(np.arange(BINS) * SECTORS // BINS, len(weight) // BINS)
    normal = jacobian.T @ (weight[:, None] * jacobian)
    scores = weight[:, None] * residual[:, None] * jacobian
    sums = np.stack([scores[sector == s].sum(0) for s in range(SECTORS) if weight[sector == s].any()])
    if len(sums) < 5 or np.linalg.cond(normal) > 1e8:
        return None
    inverse = np.linalg.inv(normal)
    return inverse @ (sums.T @ sums) @ inverse * len(sums) / (len(sums) - 3)
