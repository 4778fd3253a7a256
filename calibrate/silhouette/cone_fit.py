"""A sphere's cone fitted to the profiles across its silhouette edge, to hundredths of a pixel.

The steepest place of a blurred silhouette edge is not the outline. A matte ball's shading falls as the cosine towards
its edge, with infinite slope at the very end, and a mirror squeezes half of the room into its last pixels; both draw
the steepest place inward by up to a quarter of a pixel. So the profile across the outline is fitted with the shading
that the ball has there, blurred:

    matte   inside a n_t + b n_z,               outside d + e s
    mirror  inside k d + b n_z (+ c n_z^2),     outside d (+ e s)

s: distance from the outline; n_t, n_z: what of the sphere's normal points outward and towards the camera there. A ray
that just touches a mirror goes on to what lies behind it, which so continues on the ball, dimmed by the reflectance k.
The amplitudes are each frame's and each direction's own (variable projection [Golub1973]); the outline, the blur and k
are what all of them share.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.silhouette.outline import BINS, SECTOR, SINGULAR, binned_jacobian, binned_outline, moved, robust_step
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
MATTE = ("tangent", "facing", "beyond", "slope")
MIRROR = ("beyond", "facing", "slope")
MIRROR_CLOSE = ("beyond", "facing", "facing squared")
MIRROR_FREE = ("constant", "facing", "beyond")
MIRROR_START = 0.7  # reflectance to begin with: polished steel
REFLECTANCE = 0.2, 0.97
"""What a mirror shows at its edge is dimmer than what lies behind it. Where it is brighter, the ball's own shadow lies
beside it and is mirrored in less than a pixel."""
PROFILE_PX = 0.1  # what a single profile errs by, however little noise it has: the edge is never quite the model's
TUKEY_SIGMAS = 4.0  # from here on a profile is not believed; `FIRST_REACH` times farther at first, halved each turn
FIRST_REACH = 4
TURNS, LEAST_TURNS = 10, 4
FEWEST_SECTORS = 5  # for a covariance of three unknowns


class EdgeModel(NamedTuple):
    """Which profiles a silhouette edge is made of."""

    terms: tuple[str, ...]
    radius_px: float
    blur_px: float  # standard deviation
    mirror: float = 0.0  # reflectance: the share of what lies behind the ball that continues on it; 0 for a matte ball

    def basis(self, offsets: Array, blur_px: float | None = None) -> Array:
        """Return (M, K), the blurred profiles at offsets (M,) outward of the outline."""
        blur = self.blur_px if blur_px is None else blur_px
        s = offsets + curvature_shift_px(blur, self.radius_px)
        depth = np.arange(0.5 * FINE_PX, max(-s.min(), 0) + 5 * blur, FINE_PX)
        outward = 1 - depth / self.radius_px
        facing = np.sqrt(np.maximum(1 - outward**2, 0))
        kernel = np.exp(-0.5 * ((s[:, None] + depth) / blur) ** 2) * (FINE_PX / (blur * np.sqrt(2 * np.pi)))
        beyond = ndtr(s / blur)
        columns = {
            "constant": 1 - beyond,
            "tangent": kernel @ outward,
            "facing": kernel @ facing,
            "facing squared": kernel @ facing**2,
            "beyond": beyond + self.mirror * (1 - beyond),
            "slope": blurred_ramp(s, blur),
        }
        return np.stack([columns[term] for term in self.terms], -1)


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


def fit_cone(read: Reader, camera: Camera, sphere: Sphere, model: EdgeModel, *, free_blur: bool) -> ConeFit | None:
    """Move the outline, and the blur if it is free, until the edge's profiles fit.

    The start lies within a blur's width of the outline. None where the profiles do not determine it, or lead away.
    """
    for turn in range(TURNS):
        model = model._replace(radius_px=sphere.radius_px)
        strips, offsets, jacobian = _profiles(read, camera, sphere, model)
        model, shifts, believed = _measure(strips, offsets, model)
        variance = PROFILE_PX**2 + 1 / np.maximum(shifts.information, 1e-12)
        reach = TUKEY_SIGMAS * np.sqrt(variance)
        step = robust_step(jacobian, shifts.offset, believed / variance, reach * max(1, FIRST_REACH * 0.5**turn))
        if step is None or np.abs(step).max() > 2 * model.blur_px + 1:
            return None
        sphere = moved(sphere, step)
        change = shifts.blur_px / model.blur_px - 1 if free_blur else 0.0
        model = model._replace(blur_px=model.blur_px * (1 + change))
        if turn == TURNS - 1 or (turn >= LEAST_TURNS and np.abs(step).max() < 1e-3 and abs(change) < 2e-3):
            residual = shifts.offset - jacobian @ step
            covariance = _covariance(jacobian, residual, believed / variance * tukey(residual, reach))
            return None if covariance is None else ConeFit(sphere, model, covariance, shifts.log_variance)
    return None


def _profiles(read: Reader, camera: Camera, sphere: Sphere, model: EdgeModel) -> tuple[Strips, Array, Array]:
    """Return binned strips (F, `BINS`, M), their offsets (M,) and the Jacobian (F * `BINS`, 3)."""
    points, normals = binned_outline(camera, sphere)
    outward = inward = 2.6 * model.blur_px + 2
    if model.mirror:  # what a mirror shows farther in is no longer what lies around the ball
        share, blurs = (0.12, 2.0) if "slope" in model.terms else (0.06, 1.5)
        inward = min(outward, max(share * sphere.radius_px, blurs * model.blur_px + 0.5))
    offsets = np.arange(-inward, outward + 0.01, STEP_PX)
    strips = read(points, normals, offsets)
    grouped = strips.reshape(len(strips), BINS, -1, len(offsets))
    known = np.isfinite(grouped).all(-1, keepdims=True)
    number = known.sum(2)
    total = np.where(known, grouped, 0).sum(2)
    binned = np.where(number > 0.5 * grouped.shape[2], total / np.maximum(number, 1), np.nan)
    return binned.astype(np.float32), offsets, np.tile(binned_jacobian(camera, sphere), (len(strips), 1))


def _measure(strips: Strips, offsets: Array, model: EdgeModel) -> tuple[EdgeModel, "Shifts", Array]:
    """Return the model with its reflectance as the strips show it, the shifts, and which of them (P,) to believe."""
    if not model.mirror:
        shifts = measure_shifts(strips, offsets, model)
        # A matte ball's edge is lit, or dark, up to the outline; where n.l turns negative within the strip the
        # profile has another corner.
        believed = shifts.amplitudes[:, 0] > -0.02 * np.abs(shifts.amplitudes[:, 1])
    else:
        free = measure_shifts(strips, offsets, model._replace(terms=MIRROR_FREE, mirror=0.0))
        ratio = free.amplitudes[:, 0] / np.maximum(free.amplitudes[:, 2], 1e-4)
        believed = (ratio > REFLECTANCE[0]) & (ratio < REFLECTANCE[1]) & (free.information > 0)
        calm = believed & (free.misfit < 2)
        if calm.mean() > 0.1:
            model = model._replace(mirror=float(np.median(ratio[calm])))
        shifts = measure_shifts(strips, offsets, model)
    if believed.mean() < 0.2:
        believed = np.ones(len(believed), bool)
    return model, shifts, believed.astype(np.float64)


class Shifts(NamedTuple):
    """What each of P = F N profiles says of the outline."""

    offset: Array  # (P,) how far outward of where it was looked for the outline lies, px
    information: Array  # (P,) 1 / variance of `offset`, px^-2; 0 where the profile does not show it
    amplitudes: Array  # (P, K) of the model's profiles
    misfit: Array  # (P,) residual over the median one of its frame
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
    return Shifts(
        offset, information, amplitudes, np.sqrt(variance / noise), log_variance, float(max(blur, SHARPEST_PX))
    )


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
