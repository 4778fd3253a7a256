"""Uncalibrated normals by the least total variation of the depth.

Looks at all pixels at once. Memory: 9 bytes a sample beside the samples themselves.
"""

import numpy as np

from solve.uncalibrated.entropy import plainest_depth
from solve.uncalibrated.equal_lights import depth_of_equal_lights
from solve.uncalibrated.front_end import family
from solve.uncalibrated.normals_and_lights import finish

WHOLE = True
CALIBRATED = False

SETTINGS = {"robust": True, "sign": "outline", "smooth_px": 2.0}
SEED_SETTINGS = SETTINGS | {"robust": False, "sign": "arbitrary"}
"""The plain reading: no cleaning of the samples, no rescue of the sign. Of the authors' four variants the benchmark
names none."""

UNEQUAL = 0.15


def fit_whole(gray, valid, points, geometry, mask, *, robust, sign, smooth_px):
    """Fit b = albedo x normal, and the lights.

    Parameters
    ----------
    gray : (P, F) float32
    valid : (P, F) bool
        Not clipped.
    points, geometry
        Not used.
    mask : (H, W) bool
        Of P pixels.
    robust, smooth_px
        See `front_end.family`.
    sign : str
        See `finish.finish`.

    Returns
    -------
    Whole

    Notes
    -----
    (mu, nu) = argmin sum |(b1 / b3 + mu, b2 / b3 + nu)|, the total variation of the depth [Queau2015]: minus the
    geometric median of the slopes. lambda from lights of one intensity: L1^2 + L2^2 + (L3 - mu L1 - nu L2)^2 / lambda^2
    is the same for all. Intensities that were calibrated are divided out before. Where they are not alike, lambda is
    that of the least entropy of the albedo, the authors' variant.

    Do not believe it where slopes do not balance: a leaning object, half a ball, a mask that ends where the object
    does not; nor under unequal intensities that nobody has measured.
    """
    found = family(gray, valid, mask, robust=robust, smooth_px=smooth_px)
    slopes = found.b[:, :2] / np.where(np.abs(found.b[:, 2:]) > 1e-12, found.b[:, 2:], np.nan)
    mu, nu = -geometric_median(slopes[np.isfinite(slopes).all(1)])
    depth, spread = depth_of_equal_lights(found.lights, mu, nu)
    doubts = []
    if depth is None or spread > UNEQUAL:
        doubts.append(
            "no depth of the relief gives the lights one intensity (they would differ by "
            f"{'any amount' if depth is None else f'{spread:.0%}'}, expected under {UNEQUAL:.0%}): it comes from the "
            "entropy of the albedo instead."
        )
        depth = plainest_depth(found.b, mu, nu)
    return finish(found, mu, nu, depth, mask, sign, doubts)


def geometric_median(points, tolerance=1e-10, rounds=500):
    """Return the point (2,) with the least sum of distances to points (P, 2).

    Notes
    -----
    [Weiszfeld1937]: the mean with weights 1 / distance, again and again.
    """
    center = np.median(points, axis=0)
    scale = float(np.median(np.linalg.norm(points - center, axis=1))) or 1.0
    for _ in range(rounds):
        weight = 1 / np.maximum(np.linalg.norm(points - center, axis=1), 1e-9 * scale)
        new = weight @ points / weight.sum()
        moved, center = float(np.linalg.norm(new - center)), new
        if moved < tolerance * scale:
            break
    return center
