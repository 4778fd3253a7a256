"""What balls will tell of the lights, before a photograph is taken: the adjustment's covariance at its solution."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.adjustment import Adjustment, ObservedSpots
from calibrate.lights.directions import mirrored_at
from calibrate.lights.from_chrome import ROUND, SAMPLED_PX2
from calibrate.lights.reflected_disc import FLOOR_PX
from calibrate.silhouette.ball_silhouette import table_floor_px
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
INTENSITY_SIGMA, UNKNOWN_INTENSITY = 0.003, 0.1
"""Relative, one frame: what a white ball of 20 to 100 px leaves in virtual photographs; what hand-held flashes of one
setting vary by, where no white ball measures them."""
USUAL_BLUR_PX = 0.9
"""Standard deviation of a sharp picture's blur, its mosaic included."""


@dataclass(frozen=True)
class PredictedLights:
    """How well F lights will be known.

    Parameters
    ----------
    direction_sigma_deg : (F,) float64
        At the reference point, one tangent axis.
    range_sigma : (F,) float64
        Relative, of the distance to the reference point; about 0.7 where nothing tells it.
    position_covariance_mm2 : (F, 3, F, 3) float64
        Of all positions together: balls, diameters and camera move all lights alike.
    intensity_sigma : float
        Relative, one frame.
    """

    direction_sigma_deg: Array
    range_sigma: Array
    position_covariance_mm2: Array
    intensity_sigma: float


def predict_lights(camera: Camera, spheres: Sequence[Sphere], positions: Array, reference: Array) -> PredictedLights:
    """Return how well balls will tell lights at positions (F, 3), mm, with the errors that `calibrate` states.

    Parameters
    ----------
    camera : Camera
        Perspective; its `focal_sigma` and `center_sigma_px` count.
    spheres : sequence of Sphere
        Where the balls will stand, of known diameter; one of chrome at least. White ones give the intensities.
    positions : (F, 3) float
    reference : (3,) float
        Where directions are wanted: the object's middle, mm.

    Raises
    ------
    CalibrationError
        No chrome ball, balls so small that they tell nothing, or an orthographic camera.

    Notes
    -----
    (J^T J)^-1 of `Adjustment`, at the true lights, with exact highlights: outlines to `table_floor_px` and `ROUND`,
    highlights to `FLOOR_PX` and `SAMPLED_PX2`.
    """
    chrome = [sphere for sphere in spheres if sphere.kind == "chrome"]
    if not chrome:
        raise CalibrationError(
            f"balls: {len(spheres)} white ones and none of chrome. Chrome balls tell where the flashes are: take two "
            "or more."
        )
    if camera.is_orthographic or not all(sphere.diameter_mm for sphere in chrome):
        raise CalibrationError(
            "lights: without the camera's focal length and the balls' diameters nothing can be said of the flashes' "
            "places. State [camera] and diameter_mm in session.toml."
        )
    radius = np.array([sphere.radius_px for sphere in chrome])
    sigma = np.hypot(FLOOR_PX, SAMPLED_PX2 / radius)
    seen = ObservedSpots(
        camera,
        chrome,
        [(table_floor_px(r, USUAL_BLUR_PX) ** 2 + (ROUND * r) ** 2) * np.eye(3) for r in radius],
        np.stack([mirrored_at(camera, sphere, lambda points: unit(positions - points)) for sphere in chrome]),
        np.repeat(sigma[:, None], len(positions), 1),
        np.asarray(reference, np.float64),
        diameter_sigma=np.array([sphere.diameter_sigma for sphere in chrome]),
    )
    problem = Adjustment(seen, near=True)
    x = problem.start(positions)
    slopes = problem.slopes(x)
    try:
        covariance = np.linalg.inv(slopes.T @ slopes)
    except np.linalg.LinAlgError:
        raise CalibrationError(
            f"balls: of {radius.min():.3g} to {radius.max():.3g} px in radius, they tell nothing of flashes at "
            f"{np.linalg.norm(positions - problem.reference, axis=1).max():.3g} mm. Take balls of 20 px or more."
        ) from None
    columns = problem.first_light + np.arange(3 * len(positions))
    own = np.sqrt(np.diag(covariance)[columns].reshape(-1, 3))
    flat = problem.position_slopes(x).reshape(-1, len(x))
    joint = (flat @ covariance @ flat.T).reshape(len(positions), 3, len(positions), 3)
    intensity = INTENSITY_SIGMA if any(sphere.kind == "white" for sphere in spheres) else UNKNOWN_INTENSITY
    turn = np.degrees(np.sqrt((own[:, 0] ** 2 + own[:, 1] ** 2) / 2))
    return PredictedLights(turn, own[:, 2], joint, intensity)
