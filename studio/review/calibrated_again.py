"""What calibrating again with corrected balls gives, and what that changes. Nothing is written into the folder."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere
from scene.store import Store
from studio.review.corrections import Outlines, specs_of
from studio.review.folder import Review
from studio.review.mirror import residuals_px, rms_px

Array = NDArray[np.float64]


def calibrate_again(review: Review, balls: Outlines, *, progress: Callable[[int, int], None] | None = None) -> Any:
    """Return the `Calibration` that the step `calibrate` makes of the session with these balls.

    Raises SceneError: there is no session or no frames, or the balls do not give lights.
    """
    from calibrate.calibrate import calibrate
    from capture.session.requests import sphere_requests

    frames, store = review.material.frames, review.store
    if review.session is None or frames is None:
        raise SceneError(review.why_no_session or f"frames: {review.missing['frames']}")
    camera = Store(store.path("frames")).load_camera()
    session = replace(review.session, spheres=specs_of(review.session, balls, camera))
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
    old, camera = review.lights, review.material.camera
    turned = None
    if old is not None and len(old) == len(found.lights):
        new = found.lights.seen_from(old.reference_point_mm)
        turned = np.asarray(angular_error_deg(new.directions, old.directions), np.float64)
    before, sigma = float("nan"), float("nan")
    if old is not None and camera is not None:
        sigma = _median(old.direction_sigma_deg)
        if review.highlights_px is not None:
            before = _misfit(camera, review.spheres, old, review.highlights_px)
    assert camera is not None
    after = _misfit(found.camera or camera, found.spheres, found.lights, found.highlights_px)
    return Change(
        turned,
        (sigma, _median(found.lights.direction_sigma_deg)),
        (before, after),
        tuple(found.spheres),
        tuple(found.warnings),
    )


def _misfit(camera: Camera, spheres: Any, lights: Lights, highlights_px: Array) -> float:
    rows = [
        residuals_px(camera, sphere, lights, seen)
        for sphere, seen in zip(spheres, highlights_px, strict=True)
        if sphere.kind == "chrome"
    ]
    return rms_px(np.concatenate(rows)) if rows else float("nan")


def _median(values: Array) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")
