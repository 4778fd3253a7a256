"""From highlights to lights, distant or near, robustly."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.lights.adjustment import Adjustment
from calibrate.lights.blocks import at_rest
from calibrate.lights.light_fit import LightFit, conclude
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
INLIER_SIGMAS, INLIER_PX = 5.0, 0.25
CONTRADICTION_PX = 1.0
"""Miss from which one of two balls is left out, which costs the light's range: a reflection of something else misses
by pixels, an undersampled highlight by a third of one."""
STATED = 3.0
"""How many residuals' worth the highlights' stated sigmas are believed, against their scatter."""
LEAST_SCALE = 0.3


def fit_lights(
    camera: Camera,
    spheres: list[Sphere],
    covariances: list[Array],
    highlights: Array,
    sigma_px: Array,
    reference: Array,
    *,
    near: bool,
    diameter_sigma: Array | None = None,
    extents_px: Array | None = None,
) -> LightFit:
    """Adjust lights, balls and camera to the highlights.

    Parameters
    ----------
    camera : Camera
        Its `focal_sigma` and `center_sigma_px` say how far it may move; 0: not at all.
    spheres, covariances : S balls and the (3, 3) covariance of their (u, v, radius), px^2
    highlights : (S, F, 2) float
        Pixels, NaN where unseen. Each frame needs one ball at least.
    sigma_px : (S, F) float
    reference : (3,) float
        Where the directions hold, mm.
    near : bool
        Fit a range per light too; needs diameters.
    diameter_sigma : (S,) float or None
        Relative standard deviation of the diameters; 0 or None: exact.
    extents_px : (S, F) float or None
        Half the size at which each ball shows the flash; None: flashes are points.

    Notes
    -----
    A highlight's residual is, to first order, its distance in the picture from where the light would be
    mirrored: the angle between the mirrored ray and the direction to the light, through the inverse of
    d(direction) / d(pixel). Minimising it in the picture weights small and slanted mirrors rightly
    [Ackermann2013]. The stated sigmas keep their proportions, but not their size: s^2 = (chi^2 + m) / (n + m), n the
    highlights' degrees of freedom, m = `STATED`. With a wrong model s is large, and the balls stay on their outlines.
    """
    problem = Adjustment(
        camera,
        spheres,
        covariances,
        highlights,
        sigma_px,
        reference,
        near=near,
        diameter_sigma=diameter_sigma,
        extents_px=extents_px,
    )
    x = problem.start()
    seen = np.isfinite(highlights[..., 0])
    for bend in (2.0, np.inf, np.inf, np.inf):
        x = at_rest(problem.residuals, problem.slopes, x, bend=bend)
        size = np.linalg.norm(problem.residual_pixels(x), axis=-1)
        scale = max(1.0, float(np.sqrt(np.nanmedian((size / sigma_px)[problem.used] ** 2) / 1.39)))
        least = np.where(seen.sum(0) < 3, CONTRADICTION_PX, INLIER_PX)
        good = np.isfinite(size) & (size < np.maximum(INLIER_SIGMAS * scale * sigma_px, least))
        for f in np.flatnonzero((seen & ~good).any(0)):
            good[:, f] = _agreeing(problem, x, int(f), np.flatnonzero(seen[:, f]))
        problem.used = good & seen
        problem.scale = _scale(problem, x)
        problem.sigma = sigma_px * problem.scale
    return conclude(problem, x)


def _scale(problem: Adjustment, x: Array) -> float:
    """Return by how much the highlights scatter more than stated."""
    rows = 2 * int(problem.used.sum())
    residual, slopes = problem.residuals(x)[:rows], problem.slopes(x)
    # What the unknowns took of the highlights' freedom; the priors carry the rest of them.
    taken = slopes.covariance().leverage(slopes)[:rows].sum()
    chi2 = float(residual @ residual) * problem.scale**2
    return max(LEAST_SCALE, float(np.sqrt((chi2 + STATED) / (max(rows - taken, 0.0) + STATED))))


def _agreeing(problem: Adjustment, x: Array, f: int, balls: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return (S,) which balls of a frame to believe: all but the one without which the others agree best.

    Of two that contradict each other nobody knows which is right: the surer one is kept.
    """
    keep = np.zeros(problem.balls, bool)
    if len(balls) < 3:
        keep[balls[problem.stated[balls, f].argmin()]] = True
        return keep
    column = problem.first_light + problem.per_light * f + np.arange(problem.per_light)
    misses = []
    for left_out in balls:
        others = balls[balls != left_out]

        def miss(light: Array, others: NDArray[np.intp] = others) -> Array:
            moved = x.copy()
            moved[column] = light
            return np.nan_to_num(problem.residual_pixels(moved)[others, f].ravel(), nan=1e3)

        misses.append(float(least_squares(miss, x[column], loss="soft_l1").cost))
    keep[balls] = True
    keep[balls[int(np.argmin(misses))]] = False
    return keep
