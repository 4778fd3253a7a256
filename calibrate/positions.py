"""From highlights to lights, distant or near, robustly."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.adjustment import INLIER_PX, INLIER_SIGMAS, Adjustment, LightFit
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]


def fit_lights(
    camera: Camera,
    spheres: list[Sphere],
    covariances: list[Array],
    highlights: Array,
    sigma_px: Array,
    reference: Array,
    *,
    near: bool,
) -> LightFit:
    """Adjust lights and balls to the highlights.

    Parameters
    ----------
    camera : Camera
    spheres, covariances : S balls and the (3, 3) covariance of their (u, v, radius), px^2
    highlights : (S, F, 2) float
        Pixels, NaN where unseen. Each frame needs one ball at least.
    sigma_px : (S, F) float
    reference : (3,) float
        Where the directions hold, mm.
    near : bool
        Fit a range per light too; needs diameters.

    Notes
    -----
    A highlight's residual is, to first order, its distance in the picture from where the light would be
    mirrored: the angle between the mirrored ray and the direction to the light, through the inverse of
    d(direction) / d(pixel). Minimising it in the picture weights small and slanted mirrors rightly
    [Ackermann2013].
    """
    problem = Adjustment(camera, spheres, covariances, highlights, sigma_px, reference, near)
    start = problem.start()
    used = np.isfinite(highlights[..., 0])
    solution = None
    for loss in ("soft_l1", "linear", "linear"):
        problem.used = used
        solution = least_squares(
            problem.residuals,
            start,
            problem.jacobian,  # pyright: ignore[reportArgumentType]: the stub knows only the names of differences
            loss=loss,
            f_scale=2.0,
            x_scale="jac",
            max_nfev=60,
        )
        start = solution.x
        pixels = problem.residual_pixels(solution.x)
        size = np.linalg.norm(pixels, axis=-1)
        scale = max(1.0, float(np.sqrt(np.nanmedian((size / sigma_px)[used] ** 2) / 1.39)))
        good = np.isfinite(size) & (size < np.maximum(INLIER_SIGMAS * scale * sigma_px, INLIER_PX))
        seen = np.isfinite(highlights[..., 0])
        for f in np.flatnonzero((seen & ~good).any(0)):
            good[:, f] = problem.agreeing(solution.x, int(f), np.flatnonzero(seen[:, f]))
        used = good & seen
    assert solution is not None
    problem.used = used
    return problem.result(solution.x)
