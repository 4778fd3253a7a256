"""Calibrating again with corrected balls, and what that changes; where a ball must mirror each flash.

Nothing is written into the folder.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere
from scene.store import Store
from studio.photograph.outlines import Outlines
from studio.review.corrections import specs_of
from studio.review.folder import Review

Array = NDArray[np.float64]


def mirrored_px(camera: Camera, sphere: Sphere, lights: Lights) -> Array:
    """Return (N, 2), the pixels at which a mirror ball shows each light.

    At the point p = c + R n the normal halves the angle between the way to the camera and the way to the light, n = (v
    + l) / |v + l|. Solved by repetition: p moves by R at most, which turns v and l by little where both are many radii
    away, and each round shrinks the error by that factor.
    """
    center, radius = sphere.center_mm(camera), sphere.radius_mm
    near = lights.positions_mm is not None and sphere.diameter_mm and not camera.is_orthographic
    normals = np.tile([0.0, 0.0, 1.0], (len(lights), 1))
    for _ in range(60):
        points = center + radius * normals
        view = np.array([[0.0, 0.0, 1.0]]) if camera.is_orthographic else unit(-points)
        toward = unit(lights.positions_mm - points) if near and lights.positions_mm is not None else lights.directions
        normals, before = unit(view + toward), normals
        if np.abs(normals - before).max() < 1e-12:
            break
    if camera.is_orthographic:
        return sphere.center_px + sphere.radius_px * normals[:, :2] * [1.0, -1.0]
    return camera.project(center + radius * normals)


def residuals_px(camera: Camera, sphere: Sphere, lights: Lights, highlights_px: Array) -> Array:
    """Return (N, 2): highlights as seen (N, 2) less where they must be; NaN where none was seen or believed."""
    return highlights_px - mirrored_px(camera, sphere, lights)


def rms_px(residuals: Array) -> float:
    """Return the root mean square length of residuals (..., 2), NaN left out; NaN where there are none."""
    lengths = np.linalg.norm(residuals, axis=-1)
    return float(np.sqrt(np.nanmean(lengths**2))) if np.isfinite(lengths).any() else float("nan")


def calibrate_again(review: Review, balls: Outlines, *, progress: Callable[[int, int], None] | None = None) -> Any:
    """Return the `Calibration` that the step `calibrate` makes of the session with these balls.

    Raises SceneError: there is no session or no frames, or the balls do not give lights.
    """
    from calibrate.calibrate import calibrate
    from capture.session.requests import sphere_requests

    store = review.store
    session, frames = review.need("session", "frames")
    camera = Store(store.path("frames")).load_camera()
    session = replace(session, spheres=specs_of(session, balls, camera))
    with TemporaryDirectory() as folder:
        # Photographs of balls that were shot apart are decoded beside the frames, whose place this is not.
        (Path(folder) / "frames").symlink_to(store.path("frames").resolve())
        requests, _ = sphere_requests(session, Store(Path(folder)))
        return calibrate(frames, camera, requests, progress=progress)


@dataclass(frozen=True)
class Change:
    """What calibrating again changed.

    turned_deg (F,): Of each light's direction at the reference point of the old ones; None where there were no lights
    before.
    sigma_deg: Median of the directions', before and after; NaN where nothing is known of it.
    rms_px: Of the chrome balls' highlights beside where they must be, before and after.
    spheres: As fitted from the corrected outlines.
    """

    turned_deg: Array | None
    sigma_deg: tuple[float, float]
    rms_px: tuple[float, float]
    spheres: tuple[Sphere, ...]
    warnings: tuple[str, ...]


def change_of(review: Review, found: Any) -> Change:
    """Compare a new `Calibration` with what is in the folder."""
    (camera,), old = review.need("camera"), review.lights
    turned, before, sigma = None, float("nan"), float("nan")
    if old is not None and len(old) == len(found.lights):
        new = found.lights.seen_from(old.reference_point_mm)
        turned = np.asarray(angular_error_deg(new.directions, old.directions), np.float64)
    if old is not None:
        sigma = _median(old.direction_sigma_deg)
        if review.highlights_px is not None:
            before = _misfit(camera, review.spheres, old, review.highlights_px)
    after = _misfit(found.camera or camera, found.spheres, found.lights, found.highlights_px)
    sigmas = sigma, _median(found.lights.direction_sigma_deg)
    return Change(turned, sigmas, (before, after), tuple(found.spheres), tuple(found.warnings))


def _misfit(camera: Camera, spheres: Any, lights: Lights, highlights_px: Array) -> float:
    rows = [
        residuals_px(camera, sphere, lights, seen)
        for sphere, seen in zip(spheres, highlights_px, strict=True)
        if sphere.kind == "chrome"
    ]
    return rms_px(np.concatenate(rows)) if rows else float("nan")


def _median(values: Array) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")
