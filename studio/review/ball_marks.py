"""The balls on the photograph: outlines to drag, highlights, and by how much they miss where a mirror shows them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import mirrored_at
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from scene.spheres import Sphere
from studio.photograph.outline_marks import KNOB as MOVED
from studio.photograph.outline_marks import OutlineMarks, add_crop, closed
from studio.photograph.outlines import Outline
from studio.photograph.plane import Plane, add_lines
from studio.review.review_window import ReviewWindow
from studio.widgets import Layers

Array = NDArray[np.float64]
FITTED, WAITING = (60, 220, 90), (170, 170, 170)
"""Of a ball that was found; of one that was not, and waits to be put in its place."""
SEEN, MISSES = (255, 235, 60), (255, 70, 200)


class BallMarks:
    """What is drawn of the balls."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._view, self._layers = window, window.client.scene, Layers()
        self._outlines = OutlineMarks(window, self._colour)

    def refresh(self, plane: Plane) -> None:
        """Draw the window's balls."""
        window, draw = self._window, self._layers.draw
        now, count = (window.reading, window.ball), len(window.outlines)
        self._outlines.refresh(plane)
        draw("crop", (now, count), lambda: self._add_crop(plane))
        draw("highlights", (now, window.frame, count), lambda: self._add_highlights(plane))

    def _colour(self, ball: Outline) -> tuple[int, int, int] | None:
        if ball.is_moved or self._window.review.spheres:
            return MOVED if ball.is_moved else FITTED
        return WAITING if self._window.tab == "Balls" else None

    def _add_crop(self, plane: Plane) -> list[Any]:
        """Show the chosen ball by all photographs together, in full resolution."""
        window, material = self._window, self._window.review.material
        if window.ball is None or material.frames is None or material.exposure is None:
            return []
        return [add_crop(window, plane, material.frames, material.exposure, window.outlines[window.ball])]

    def _add_highlights(self, plane: Plane) -> list[Any]:
        """Draw the chosen ball's highlights, and by how much they miss, drawn larger."""
        window, review, index = self._window, self._window.review, self._window.ball
        seen, lights, camera = review.highlights_px, review.lights, review.material.camera
        if index is None or seen is None or lights is None or camera is None or index >= len(review.spheres):
            return []
        sphere, known = review.spheres[index], np.isfinite(seen[index]).all(-1)
        if not known.any():
            return []
        arm = 0.03 * sphere.radius_px * plane.per_px
        arms = arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        at = plane.place(seen[index], lift=0.0024)
        crosses = (at[known, None, None] + arms).reshape(-1, 2, 3)
        misses, start = residuals_px(camera, sphere, lights, seen[index]), mirrored_px(camera, sphere, lights)
        ends = np.stack([start, start + magnification(rms_px(misses), sphere.radius_px) * misses], 1)[known]
        handles = [
            add_lines(self._view, "seen", crosses, SEEN, 2.0),
            add_lines(self._view, "misses", plane.place(ends, lift=0.0027), MISSES, 3.0),
        ]
        if known[window.frame]:
            angle = np.linspace(0, 2 * np.pi, 32, endpoint=False)
            ring = 2 * arm * np.stack([np.cos(angle), np.sin(angle), np.zeros(32)], -1) + at[window.frame]
            handles.append(add_lines(self._view, "this_frame", closed(ring), SEEN, 3.0))
        return handles


def magnification(rms: float, radius_px: float) -> float:
    """Return 1, 10, 100 or 1000: so much larger may misses be drawn and stay under a fifth of the radius, rms."""
    if not np.isfinite(rms) or rms <= 0:
        return 1.0
    return float(10 ** np.clip(np.floor(np.log10(0.2 * radius_px / rms)), 0, 3))


def mirrored_px(camera: Camera, sphere: Sphere, lights: Lights) -> Array:
    """Return (N, 2), the pixels at which a mirror ball shows each light."""
    positions = None if camera.is_orthographic or not sphere.diameter_mm else lights.positions_mm
    return mirrored_at(
        camera, sphere, lambda points: lights.directions if positions is None else unit(positions - points)
    )


def residuals_px(camera: Camera, sphere: Sphere, lights: Lights, highlights_px: Array) -> Array:
    """Return (N, 2): highlights as seen (N, 2) less where they must be; NaN where none was seen or believed."""
    return highlights_px - mirrored_px(camera, sphere, lights)


def rms_px(residuals: Array) -> float:
    """Return the root mean square length of residuals (..., 2), NaN left out; NaN where there are none."""
    lengths = np.linalg.norm(residuals, axis=-1)
    return float(np.sqrt(np.nanmean(lengths**2))) if np.isfinite(lengths).any() else float("nan")
