"""Is the lights' stated doubt right: what each chrome ball says alone, against every other one."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import CrossValidation
from calibrate.lights.adjustment import ObservedSpots
from calibrate.lights.directions import mirrored_rays, two_across
from calibrate.lights.positions import LightFit, fit_lights
from scene.normals import unit

Array = NDArray[np.float64]
LEAST = 3  # differences from which on their size is called a measurement


def cross_validate(seen: ObservedSpots, fit: LightFit) -> CrossValidation | None:
    """Compare what the chrome balls say, each alone; None with one ball, or where nobody knows where they stand.

    Notes
    -----
    The balls share no pixel. Each gives a ray from where it mirrors the flash, with the sigma of its outline and of
    its highlights, these with the scatter that the fit of all states. Rays to a distant light are parallel; two rays to
    a near light meet: then their difference counts across the plane through both balls and the light. The ratio is
    rms(difference) / rms(summed sigma).
    """
    near, camera = fit.is_near, seen.camera
    is_placed = all(sphere.diameter_mm for sphere in seen.spheres)
    if len(seen.spheres) < 2 or not (is_placed or camera.is_orthographic):
        return None
    highlights = np.where(fit.used[..., None], seen.highlights, np.nan)
    points, directions = (np.full((*fit.used.shape, 3), np.nan) for _ in range(2))
    variance = np.full(fit.used.shape, np.nan)
    for i, shown in ((i, shown) for i, shown in enumerate(fit.used) if shown.any()):
        one = slice(i, i + 1)
        own = replace(
            seen,
            spheres=seen.spheres[one],
            covariances=seen.covariances[one],
            highlights=highlights[one, shown],
            sigma_px=fit.scale * seen.sigma_px[one, shown],
            diameter_sigma=None,
            shading=None,
        )
        alone = fit_lights(own, near=False)
        points[i, shown], directions[i, shown] = mirrored_rays(alone.camera, alone.spheres[0], own.highlights[0])
        variance[i, shown] = np.deg2rad(alone.direction_sigma_deg) ** 2
    squares, allowed = [], []
    for i, j in combinations(range(len(seen.spheres)), 2):
        middle = unit(directions[i] + directions[j])
        axes = [unit(np.cross(points[i] - points[j], middle))] if near else two_across(middle)
        for axis in axes:
            squares.append(np.sum(axis * (directions[i] - directions[j]), axis=-1) ** 2)
            allowed.append(variance[i] + variance[j])
    known = np.isfinite(squares)
    if known.sum() < LEAST:
        return None
    found, stated = (float(np.rad2deg(np.sqrt(np.mean(np.stack(each)[known])))) for each in (squares, allowed))
    return CrossValidation(found, stated, found / stated, len(seen.spheres))
