"""Where a ball ends, to hundredths of a pixel: a step between what lies behind it and how its own limb darkens.

The steepest place of a blurred limb is not the outline. A matte ball's shading falls as the cosine towards its limb,
with infinite slope at the very end, and a mirror squeezes half of the room into its last pixels; both draw the
steepest place inward by up to a quarter of a pixel. So the profile across the outline is fitted with the limb that
it has, blurred:

    matte   inside a n_t + b n_z,               outside d + e s
    mirror  inside k d + b n_z (+ c n_z^2),     outside d (+ e s)

s: distance from the outline; n_t, n_z: what of the sphere's normal points outward and towards the camera there. A ray
that just touches a mirror goes on to what lies behind it, which so continues on the ball, dimmed by the reflectance k.
The amplitudes are each frame's and each direction's own (variable projection [Golub1973]); the outline, the blur and k
are what all of them share.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Array = NDArray[np.float64]
STEP_PX = 0.5
"""Spacing of the samples across the outline: finer ones are no news, the sensor's pixels are 1 px."""
SHARPEST_PX = 0.45
"""Blur's standard deviation that pixel area and interpolation alone make."""
FINE_PX = 0.02
MATTE = ("tangent", "facing", "beyond", "slope")
MIRROR = ("beyond", "facing", "slope")
MIRROR_CLOSE = ("beyond", "facing", "facing squared")
MIRROR_FREE = ("constant", "facing", "beyond")


@dataclass(frozen=True)
class Limb:
    """Which profiles a limb is made of.

    Parameters
    ----------
    terms : tuple of str
    radius_px : float
    blur_px : float
        Standard deviation of the blur.
    mirror : float
        Reflectance: the share of what lies behind the ball that continues on it; 0 for a matte ball.
    """

    terms: tuple[str, ...]
    radius_px: float
    blur_px: float
    mirror: float = 0.0

    def basis(self, offsets: Array, blur_px: float | None = None) -> Array:
        """Return (M, K), the blurred profiles at offsets (M,) outward of the outline."""
        blur = self.blur_px if blur_px is None else blur_px
        # A blurred disc's edge lies inside the disc's: diffusion along the curvature shifts it by sigma^2 / 2 r.
        s = offsets + blur**2 / (2 * self.radius_px)
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
            "slope": s * beyond + np.exp(-0.5 * (s / blur) ** 2) * (blur / np.sqrt(2 * np.pi)),
        }
        return np.stack([columns[term] for term in self.terms], -1)


@dataclass(frozen=True)
class Shifts:
    """What each of P = F N profiles says of the outline.

    Parameters
    ----------
    offset : (P,) float64
        How far outward of where it was looked for the outline lies, px.
    information : (P,) float64
        1 / variance of `offset`, px^-2; 0 where the profile tells nothing.
    amplitudes : (P, K) float64
        Of the limb's profiles.
    misfit : (P,) float64
        Residual over the median one of its frame.
    doubt : float
        Mean logarithm of the residuals' variance: the lower, the better the outline.
    blur_px : float
        The blur under which the profiles fit better.
    """

    offset: Array
    information: Array
    amplitudes: Array
    misfit: Array
    doubt: float
    blur_px: float


def measure(profiles: NDArray[np.float32], offsets: Array, limb: Limb) -> Shifts:
    """Return the outline's shift in each profile.

    Parameters
    ----------
    profiles : (F, N, M) float32
        Linear values of F frames along N normals at `offsets`; a profile with a NaN is not used.
    offsets : (M,) float64
    limb : Limb

    Notes
    -----
    One Gauss-Newton step of variable projection: with Q an orthonormal basis of the limb's profiles, the residual
    y - Q Q^T y is regressed on what of d(model)/d(shift) the basis cannot imitate.
    """
    basis = limb.basis(offsets)
    d = 0.05
    by_shift = (limb.basis(offsets - d) - limb.basis(offsets + d)) / (2 * d)
    by_blur = (limb.basis(offsets, float(np.sqrt(limb.blur_px**2 + d))) - basis) / d
    q, r = np.linalg.qr(basis)
    values = profiles.reshape(-1, len(offsets)).astype(np.float64)
    usable = np.all(np.isfinite(values), axis=1)
    values = np.where(usable[:, None], values, 0)
    coefficients = values @ q
    residual = values - coefficients @ q.T
    amplitudes = coefficients @ np.linalg.inv(r).T
    free = np.eye(len(offsets)) - q @ q.T
    shift_slope, blur_slope = amplitudes @ (by_shift.T @ free), amplitudes @ (by_blur.T @ free)
    ss, bb = np.einsum("ij,ij->i", shift_slope, shift_slope), np.einsum("ij,ij->i", blur_slope, blur_slope)
    sy, by = np.einsum("ij,ij->i", shift_slope, residual), np.einsum("ij,ij->i", blur_slope, residual)
    offset = np.where(ss > 0, sy / np.maximum(ss, 1e-300), 0)
    left = np.maximum(np.einsum("ij,ij->i", residual, residual) - offset * sy, 0)
    variance = left / (len(offsets) - basis.shape[1] - 1)
    by_frame = np.where(usable, variance, np.nan).reshape(profiles.shape[:2])
    by_frame[np.isnan(by_frame).all(1)] = 1.0
    noise = np.repeat(np.maximum(np.nanmedian(by_frame, axis=1), 1e-12), profiles.shape[1])
    # Samples at half a pixel share their noise with their neighbours.
    information = np.where(usable, STEP_PX * ss / (variance + noise), 0)
    weight = np.where(usable & (variance < 4 * noise), bb / (variance + noise), 0)
    wanted = by / np.maximum(bb, 1e-300)
    weight[np.abs(wanted) > 4 * limb.blur_px**2] = 0
    change = np.sum(weight * wanted) / max(weight.sum(), 1e-300)
    square = limb.blur_px**2
    blur = np.sqrt(square + np.clip(change, -0.5 * square, square))
    doubt = float(np.log(variance[usable] + 1e-12).mean()) if usable.any() else np.inf
    return Shifts(offset, information, amplitudes, np.sqrt(variance / noise), doubt, float(max(blur, SHARPEST_PX)))
