"""A sphere's cone fitted to the profiles across its silhouette edge, to hundredths of a pixel.

The steepest place of a blurred silhouette edge is not the outline. A matte ball's shading falls as the cosine towards
its edge, with infinite slope at the very end, and draws the steepest place inward by up to a quarter of a pixel. So the
profile across the outline is fitted with the shading that the ball has there, blurred:

    inside a n_t + b n_z,     outside d + e s

s: distance from the outline; n_t, n_z: what of the sphere's normal points outward and towards the camera there. The
amplitudes are each frame's and each direction's own (variable projection [Golub1973]); the outline and the blur are
what all of them share.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.silhouette.outline import BINS, SECTOR, SINGULAR, binned_outline, moved, robust_step
from scene.camera import Camera
from scene.robust import cluster_sums, tukey
from scene.spheres import Sphere

Array = NDArray[np.float64]
Strips = NDArray[np.float32]
Reader = Callable[[Array, Array, Array], Strips]
"""Takes points (N, 2), normals (N, 2) and offsets (M,) to strips (F, N, M)."""
STEP_PX = 0.5  # spacing of the samples across the outline: finer ones are no news, the sensor's pixels are 1 px
SHARPEST_PX = 0.45  # blur's standard deviation that pixel area and interpolation alone make
FINE_PX = 0.02  # step of the integrals over the ball's depth
PROFILE_PX = 0.1  # what a single profile errs by, however little noise it has: the edge is never quite the model's
TUKEY_SIGMAS = 4.0  # from here on a profile is not believed; `FIRST_REACH` times farther at first, halved each turn
FIRST_REACH = 4
TURNS, LEAST_TURNS = 10, 4
FEWEST_SECTORS = 5  # for a covariance of three unknowns


class EdgeModel(NamedTuple):
    """The profile of a matte ball's silhouette edge."""

    radius_px: float
    blur_px: float  # standard deviation

    def basis(self, offsets: Array, blur_px: float | None = None) -> Array:
        """Return (M, 4), the blurred profiles of n_t, n_z, d and e at offsets (M,) outward of the outline."""
        blur = self.blur_px if blur_px is None else blur_px
        s = offsets + curvature_shift_px(blur, self.radius_px)
        depth = np.arange(0.5 * FINE_PX, max(-s.min(), 0) + 5 * blur, FINE_PX)
        outward = 1 - depth / self.radius_px
        facing = np.sqrt(np.maximum(1 - outward**2, 0))
        kernel = np.exp(-0.5 * ((s[:, None] + depth) / blur) ** 2) * (FINE_PX / (blur * np.sqrt(2 * np.pi)))
        return np.stack([kernel @ outward, kernel @ facing, ndtr(s / blur), blurred_ramp(s, blur)], -1)


def curvature_shift_px(blur_px: float, radius_px: float) -> float:
    """Return how far inside a disc's edge its blurred edge lies: diffusion along the curvature, sigma^2 / 2 r."""
    return blur_px**2 / (2 * radius_px)


def blurred_ramp(s: Array, blur_px: float) -> Array:
    """Return max(s, 0) under a Gaussian blur."""
    return s * ndtr(s / blur_px) + np.exp(-0.5 * (s / blur_px) ** 2) * (blur_px / np.sqrt(2 * np.pi))


class ConeFit(NamedTuple):
    """An outline with the edge model that fits best."""

    sphere: Sphere
    model: EdgeModel
    covariance: Array  # (3, 3) of (u, v, radius), px^2
    misfit: float  # mean logarithm of the residuals' variance: the lower, the better the outline


def fit_cone(read: Reader, camera: Camera, sphere: Sphere, model: EdgeModel) -> ConeFit | None:
    """Move the outline, and the blur, until the edge's profiles fit.

    The start lies within a blur's width of the outline. None where the profiles do not determine it, or lead away.
    """
    for turn in range(TURNS):
        model = model._replace(radius_px=sphere.radius_px)
        strips, offsets, jacobian = _profiles(read, camera, sphere, model)
        shifts = measure_shifts(strips, offsets, model)
        # The ball is lit, or dark, up to the outline; where n.l turns negative within the strip the profile has another
        # corner.
        believed = shifts.amplitudes[:, 0] > -0.02 * np.abs(shifts.amplitudes[:, 1])
        believed = np.ones(len(believed)) if believed.mean() < 0.2 else believed.astype(np.float64)
        variance = PROFILE_PX**2 + 1 / np.maximum(shifts.information, 1e-12)
        reach = TUKEY_SIGMAS * np.sqrt(variance)
        step = robust_step(jacobian, shifts.offset, believed / variance, reach * max(1, FIRST_REACH * 0.5**turn))
        if step is None or np.abs(step).max() > 2 * model.blur_px + 1:
            return None
        sphere = moved(sphere, step)
        change = shifts.blur_px / model.blur_px - 1
        model = model._replace(blur_px=model.blur_px * (1 + change))
        if turn == TURNS - 1 or (turn >= LEAST_TURNS and np.abs(step).max() < 1e-3 and abs(change) < 2e-3):
            residual = shifts.offset - jacobian @ step
            covariance = _covariance(jacobian, residual, believed / variance * tukey(residual, reach))
            return None if covariance is None else ConeFit(sphere, model, covariance, shifts.log_variance)
    return None


def _profiles(read: Reader, camera: Camera, sphere: Sphere, model: EdgeModel) -> tuple[Strips, Array, Array]:
    """Return binned strips (F, `BINS`, M), their offsets (M,) and the Jacobian (F * `BINS`, 3)."""
    points, normals, jacobian = binned_outline(camera, sphere)
    reach = 2.6 * model.blur_px + 2
    offsets = np.arange(-reach, reach + 0.01, STEP_PX)
    strips = read(points, normals, offsets)
    grouped = strips.reshape(len(strips), BINS, -1, len(offsets))
    known = np.isfinite(grouped).all(-1, keepdims=True)
    number = known.sum(2)
    total = np.where(known, grouped, 0).sum(2)
    binned = np.where(number > 0.5 * grouped.shape[2], total / np.maximum(number, 1), np.nan)
    return binned.astype(np.float32), offsets, np.tile(jacobian, (len(strips), 1))


class Shifts(NamedTuple):
    """What each of P = F N profiles says of the outline."""

    offset: Array  # (P,) how far outward of where it was looked for the outline lies, px
    information: Array  # (P,) 1 / variance of `offset`, px^-2; 0 where the profile does not show it
    amplitudes: Array  # (P, K) of the model's profiles
    log_variance: float  # mean over the profiles
    blur_px: float  # the blur under which the profiles fit better


def measure_shifts(profiles: Strips, offsets: Array, model: EdgeModel) -> Shifts:
    """Return the outline's shift in each profile (F, N, M); a profile with a NaN is not used.

    One Gauss-Newton step of variable projection: with Q an orthonormal basis of the model's profiles, the residual
    y - Q Q^T y is regressed on what of d(model)/d(shift) the basis cannot imitate.
    """
    basis = model.basis(offsets)
    d = 0.05  # px, or px^2 of the blur's variance
    by_shift = (model.basis(offsets - d) - model.basis(offsets + d)) / (2 * d)
    by_blur = (model.basis(offsets, float(np.sqrt(model.blur_px**2 + d))) - basis) / d
    q, r = np.linalg.qr(basis)
    values = profiles.reshape(-1, len(offsets)).astype(np.float64)
    usable = np.all(np.isfinite(values), axis=1)
    values = np.where(usable[:, None], values, 0)
    coefficients = values @ q
    residual = values - coefficients @ q.T
    amplitudes = coefficients @ np.linalg.inv(r).T
    free = np.eye(len(offsets)) - q @ q.T
    shift_slope, blur_slope = amplitudes @ (by_shift.T @ free), amplitudes @ (by_blur.T @ free)
    ss, bb, sy, by, yy = (
        np.einsum("ij,ij->i", a, b)
        for a, b in (
            (shift_slope, shift_slope),
            (blur_slope, blur_slope),
            (shift_slope, residual),
            (blur_slope, residual),
            (residual, residual),
        )
    )
    offset = np.where(ss > 0, sy / np.maximum(ss, 1e-300), 0)
    variance = np.maximum(yy - offset * sy, 0) / (len(offsets) - basis.shape[1] - 1)
    by_frame = np.where(usable, variance, np.nan).reshape(profiles.shape[:2])
    by_frame[np.isnan(by_frame).all(1)] = 1.0
    noise = np.repeat(np.maximum(np.nanmedian(by_frame, axis=1), 1e-12), profiles.shape[1])
    # Samples at half a pixel share their noise with their neighbours.
    information = np.where(usable, STEP_PX * ss / (variance + noise), 0)
    weight = np.where(usable & (variance < 4 * noise), bb / (variance + noise), 0)
    wanted, square = by / np.maximum(bb, 1e-300), model.blur_px**2
    weight[np.abs(wanted) > 4 * square] = 0
    change = np.sum(weight * wanted) / max(weight.sum(), 1e-300)
    blur = np.sqrt(square + np.clip(change, -0.5 * square, square))
    log_variance = float(np.log(variance[usable] + 1e-12).mean()) if usable.any() else np.inf
    return Shifts(offset, information, amplitudes, log_variance, float(max(blur, SHARPEST_PX)))


def _covariance(jacobian: Array, residual: Array, weight: Array) -> Array | None:
    """Return the (3, 3) covariance of a weighted fit whose errors agree within a sector.

    The sandwich H^-1 (sum_s g_s g_s^T) H^-1, g_s = sum over the sector's edges of w r J, times S / (S - 3).
    Hundreds of profiles on one outline are not hundreds of observations: the same arc errs alike in all frames.
    """
    normal = jacobian.T @ (weight[:, None] * jacobian)
    some = weight > 0
    sector = np.tile(SECTOR, len(weight) // BINS)
    sums = cluster_sums((weight * residual)[some, None] * jacobian[some], sector[some])
    if len(sums) < FEWEST_SECTORS or np.linalg.cond(normal) > SINGULAR:
        return None
    inverse = np.linalg.inv(normal)
    return inverse @ (sums.T @ sums) @ inverse * len(sums) / (len(sums) - 3)
