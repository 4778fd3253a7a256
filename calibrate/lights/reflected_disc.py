"""The flash's disc as a mirror ball shows it: blurred, clipped, bent by the ball, on a slanting background.

What is wanted is the pixel that mirrors the flash's centre. A lens blurs alike to all sides in the picture, a ball
bends what it mirrors: its disc is a circle among directions, not among pixels. Both are one model here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.lights.directions import mirrored_rays
from scene.camera import Camera
from scene.robust import spread
from scene.spheres import Sphere

Array = NDArray[np.float64]
UNMODELLED = 0.05  # share of a pixel's value by which a lens's true blur differs from the model's
FLOOR_PX = 0.025
"""What the best fit still errs by: 0.006 to 0.016 px on ideal discs of all sizes, blurs and clippings; a lens's
asymmetry, an undersampled flash and a ball's dust are not ideal."""
LARGEST_LEVERAGE = 0.95  # from which a pixel's own residual says nothing
OUTLIER = 3  # spreads at which a pixel counts less: another spot nearby, the edge of something mirrored
BLURS, CLIPPED_BLURS, LEAST_SKIRT_PX = 1.5, 3.0, 0.3  # blur of a disc, in its skirt's widths, unclipped and clipped
CLIPPED_HEIGHT = 5.0  # of a clipped spot, in whites, to begin with
LEAST_NOISE, RIM_PX = 1e-3, 2  # of the spot's height; read in the outermost pixels
STRAYED_PX, STRAYED = 1.0, 0.5  # px, and radii, that the centre may lie from the centroid, whichever is more
SIDES = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
SIDE_PX = 0.01  # of the differences by the pixel
# Deviations allowed from the start: log height, log widths (2), shear, log of the profile's exponent, background
# (level, slopes: of the height, per pixel), share of the bending.
LOOSE = np.array([2.0, 1.0, 1.0, 0.5, 0.5, 0.3, 0.1, 0.1, 0.25])


class Patch(NamedTuple):
    """The pixels around a bright spot."""

    pixels: Array  # (P, 2) as (u, v); only samples that were measured, none that was interpolated
    values: Array  # (P,) 0 around the spot, 1 at its peak or white; where clipped, what it was clipped to
    clipped: NDArray[np.bool_]  # (P,)


def fit_disc(
    camera: Camera, sphere: Sphere, patch: Patch, start: Array, *, radius_px: float, skirt_px: float
) -> tuple[Array, float] | None:
    """Return the pixel (2,) that mirrors the flash's centre, and its standard deviation along one axis.

    `start`: the spot's centroid; `radius_px` of the spot where it is at a third of its height; `skirt_px` from there to
    where it is at four fifths.

    Notes
    -----
    I = h exp(-(x^T E x)^g) + plane, at x = W(p) - x0: h, E (an ellipse) and g free, so that a disc, a
    blurred point and a halo's skirt are all of the family; the centre hangs on the symmetry alone. A clipped pixel
    says only that the model is not below white. W(p) = p + b (A^+ (d(p) - d(c)) - (p - c)), d the mirrored direction
    and A its derivative at the centroid c: b = 0 is symmetric in the picture, b = 1 among directions; how much of the
    radius is disc and how much blur says b, within a prior. The sigma adds to the fit's own that of the sandwich with
    each pixel's residual over 1 - leverage: honest about a few steep pixels [MacKinnon1985].
    """
    offset = patch.pixels - start
    seen = mirrored_rays(camera, sphere, np.concatenate([start + SIDE_PX * SIDES, start[None], patch.pixels]))[1]
    along = np.stack([seen[0] - seen[1], seen[2] - seen[3]], -1) / (2 * SIDE_PX)
    if not np.isfinite(along).all():
        return None
    flatten = np.linalg.pinv(along)
    bend = (seen[5:] - seen[4]) @ flatten.T - offset
    good = np.isfinite(bend[:, 0])
    offset, bend, clipped, values = offset[good], bend[good], patch.clipped[good], patch.values[good]
    blur = (CLIPPED_BLURS if clipped.any() else BLURS) * max(skirt_px, LEAST_SKIRT_PX)
    width = np.log(0.8 * radius_px + 0.3)
    share = (max(0.0, radius_px - blur) / radius_px) ** 2
    height = np.log(CLIPPED_HEIGHT) if clipped.any() else 0.1
    x = np.array([0.0, 0.0, height, width, width, 0.0, 0.0, 0.0, 0.0, 0.0, share])
    if np.count_nonzero(~clipped) < len(x):
        return None
    middle = x[2:].copy()
    away = np.hypot(*offset.T)
    rim = values[away > away.max() - RIM_PX]
    noise = max(1.5 * float(np.median(np.abs(rim - np.median(rim)))), LEAST_NOISE)
    weight = np.ones(len(values))
    expected = np.clip(values, 0, 1)
    priors = np.concatenate([np.zeros((len(LOOSE), 2)), np.diag(1 / LOOSE)], 1)
    for _ in range(3):
        scale = weight / np.hypot(noise, UNMODELLED * expected)

        def both(x: Array, scale: Array = scale) -> tuple[Array, Array]:
            image, slopes = _image(x, offset, bend)
            off = image - values
            # White is a floor for what is clipped, not a value.
            scale = np.where(clipped & (off > 0), 0.0, scale)
            return (
                np.concatenate([scale * off, (x[2:] - middle) / LOOSE]),
                np.concatenate([scale[:, None] * slopes, priors]),
            )

        x = least_squares(
            lambda x, both=both: both(x)[0],
            x,
            lambda x, both=both: both(x)[1],  # pyright: ignore[reportArgumentType]: the stub knows only names
            method="lm",
            ftol=1e-4,
            xtol=1e-4,
            max_nfev=40,
        ).x
        residual, slopes = both(x)
        expected = np.clip(_image(x, offset, bend)[0] - x[7], 0, 1)
        size = np.abs(residual[: len(values)]) / np.maximum(weight, 1e-9)
        weight = 1 / np.sqrt(1 + (size / (OUTLIER * max(1.0, spread(size[~clipped])))) ** 2)
    if np.hypot(x[0], x[1]) > max(STRAYED_PX, STRAYED * radius_px):
        return None
    inverse = np.linalg.pinv(slopes.T @ slopes)
    leverage = np.minimum(np.einsum("ij,jk,ik->i", slopes, inverse, slopes), LARGEST_LEVERAGE)
    scores = (slopes @ inverse[:, :2]) * (residual / (1 - leverage))[:, None]
    sandwich = scores[: len(values)].T @ scores[: len(values)]
    sigma = np.sqrt((np.trace(inverse[:2, :2]) + np.trace(sandwich)) / 2)
    center = start + x[:2]
    for _ in range(3):
        here = mirrored_rays(camera, sphere, center)[1]
        center = center + x[:2] - (center - start) - x[10] * (flatten @ (here - seen[4]) - (center - start))
    if not np.isfinite(center).all():
        return None
    return center, float(np.hypot(sigma, FLOOR_PX))


def _image(x: Array, offset: Array, bend: Array) -> tuple[Array, Array]:
    """Return the model (P,) and its derivatives (P, 11)."""
    u, v, height, wide, high, shear, exponent, level, across, down, share = x
    du, dv = (offset + share * bend - [u, v]).T
    e, f, g = np.exp(np.clip([-wide, -high, exponent], -7, 2.3))
    first, second = e * du, f * (dv + shear * du)
    square = np.minimum(first * first + second * second + 1e-12, 1e4)
    power = np.minimum(square**g, 80.0)
    spot = np.exp(np.minimum(height, 20.0) - power)
    fall = -spot * g * power / square
    of_u = -2 * fall * (first * e + second * f * shear)
    of_v = -2 * fall * second * f
    slopes = [
        of_u,
        of_v,
        spot,
        -2 * fall * first * first,
        -2 * fall * second * second,
        2 * fall * second * f * du,
        -spot * power * np.log(square) * g,
        np.ones_like(du),
        offset[:, 0],
        offset[:, 1],
        -of_u * bend[:, 0] - of_v * bend[:, 1],
    ]
    return spot + level + across * offset[:, 0] + down * offset[:, 1], np.stack(slopes, -1)
