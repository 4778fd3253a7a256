"""Our camera as a Mitsuba sensor: the part of the picture that holds the object, and what Mitsuba's camera lacks.

Mitsuba's camera has square pixels and no distortion. What ours has beyond that is made by rendering without it and
resampling.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError

Array = NDArray[np.float64]

ROWS = 64
"""Of the picture, whose rays are made at a time."""


@dataclass(frozen=True)
class Film:
    """What is rendered, and where it goes in the picture.

    Parameters
    ----------
    camera : Camera
        The session's.
    rows, columns : slice
        The box of the picture that holds the object, in the session's pixels.
    rendered : Camera
        What Mitsuba renders: without distortion, square pixels. The session's own camera where that suffices.
    window : tuple of 4 int
        First row, first column, height and width of what is rendered, in pixels of `rendered`.
    pixels : (h, w, 2) float32 or None
        Where in `window` each pixel of the box is found; None: it is the box.
    """

    camera: Camera
    rows: slice
    columns: slice
    rendered: Camera
    window: tuple[int, int, int, int]
    pixels: NDArray[np.float32] | None

    @classmethod
    def of_pinhole(cls, camera: Camera, rows: slice, columns: slice) -> "Film":
        """Return a box of the picture of a camera with square pixels and no distortion."""
        window = rows.start, columns.start, rows.stop - rows.start, columns.stop - columns.start
        return cls(camera, rows, columns, camera, window, None)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the box."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    def bands(self, samples_per_band: int, samples_per_pixel: int) -> list[tuple[int, int]]:
        """Return (first row, height) of bands of the window that hold at most so many samples."""
        top, _, height, width = self.window
        step = max(1, min(height, samples_per_band // max(1, width * samples_per_pixel)))
        return [(row, min(step, top + height - row)) for row in range(top, top + height, step)]

    def place(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the rendered window (h, w, 3) as the box's pixels."""
        if self.pixels is None:
            return image
        import cv2

        placed = cv2.remap(image, self.pixels[..., 0], self.pixels[..., 1], cv2.INTER_LINEAR)
        return np.asarray(placed, np.float32)

    def whole(self, box: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the camera's whole pictures (..., H, W, 3) of those of the box (..., h, w, 3); black around it."""
        out = np.zeros((*box.shape[:-3], self.camera.height, self.camera.width, 3), np.float32)
        out[..., self.rows, self.columns, :] = box
        return out


def film_for(camera: Camera, points: Array) -> Film:
    """Return the film that holds points (P, 3), mm, camera frame; the whole picture where one is behind the camera.

    Raises RenderError: No point lies before the camera and inside the picture.
    """
    pixels = camera.project(points)
    seen = pixels[np.isfinite(pixels).all(-1)]
    size = np.array([camera.width, camera.height])
    if not len(seen):
        raise RenderError(
            f"the camera sees nothing of the mesh: all of it lies behind the camera (z from {points[:, 2].min():.0f} "
            f"to {points[:, 2].max():.0f} mm, expected below 0). Check the pose and scan_unit."
        )
    low = np.maximum(np.floor(seen.min(0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(seen.max(0)).astype(int) + 2, size)
    if np.any(low >= high):
        raise RenderError(
            f"the camera sees nothing of the mesh: it projects to u {seen[:, 0].min():.0f} .. {seen[:, 0].max():.0f}, "
            f"v {seen[:, 1].min():.0f} .. {seen[:, 1].max():.0f} px, outside {camera.width} x {camera.height}. "
            "Check the pose, the camera and scan_unit."
        )
    if len(seen) < len(pixels):
        low, high = np.zeros(2, int), size
    (left, top), (right, bottom) = low.tolist(), high.tolist()
    rows, columns = slice(top, bottom), slice(left, right)
    if camera.fx == camera.fy and not any(camera.distortion):
        return Film.of_pinhole(camera, rows, columns)
    plain = replace(camera, fy=camera.fx, distortion=(0.0,) * 5)
    wanted = np.empty((bottom - top, right - left, 2))
    for start in range(top, bottom, ROWS):
        band = slice(start, min(start + ROWS, bottom))
        origins, directions = camera.rays(camera.grid(band)[:, columns])
        wanted[start - top : band.stop - top] = plain.project(origins + 1000 * directions)
    # The rendered window, one pixel wider all round for the interpolation, becomes a picture of its own.
    corner = np.floor(wanted.min((0, 1))).astype(int) - 1
    width, height = (np.ceil(wanted.max((0, 1))).astype(int) + 2 - corner).tolist()
    plain = replace(plain, width=width, height=height, cx=plain.cx - corner[0], cy=plain.cy - corner[1])
    wanted -= corner
    return Film(camera, rows, columns, plain, (0, 0, height, width), wanted.astype(np.float32))


def sensor_description(film: Film, points: Array, first_row: int, height: int) -> dict:
    """Return Mitsuba's description of the sensor that renders `height` rows of the window from `first_row` on.

    look_at(target=(0, 0, -1), up=(0, 1, 0)) is our camera frame; fov = 2 atan(W / 2 fx); a principal point that is
    off centre takes the opposite sign, -(c - (size - 1) / 2) / size. Orthographic: half the width is W / 2 fx mm, and
    the sensor stands where the picture's middle lies.
    """
    import mitsuba as mi

    camera = film.rendered
    off = np.array([camera.cx - (camera.width - 1) / 2, camera.cy - (camera.height - 1) / 2])
    transform = mi.ScalarTransform4f
    _, left, _, width = film.window
    common = {
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "crop_offset_x": left,
            "crop_offset_y": first_row,
            "crop_width": width,
            "crop_height": height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "multijitter"},
    }
    near, far = float(points[:, 2].max()), float(points[:, 2].min())
    if camera.is_orthographic:
        margin = 1.0 + 0.1 * (near - far)
        origin = np.array([-off[0] / camera.fx, off[1] / camera.fx, near + margin])
        half_width = camera.width / (2 * camera.fx)
        place = transform().look_at(origin=origin.tolist(), target=(origin - [0, 0, 1]).tolist(), up=[0, 1, 0])
        return {
            "type": "orthographic",
            "to_world": place @ transform().scale([half_width, half_width, 1.0]),
            "near_clip": 0.1 * margin,
            "far_clip": 2 * margin + near - far,
            **common,
        }
    return {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(camera.width / (2 * camera.fx)))),
        "principal_point_offset_x": -off[0] / camera.width,
        "principal_point_offset_y": -off[1] / camera.height,
        "to_world": transform().look_at(origin=[0, 0, 0], target=[0, 0, -1], up=[0, 1, 0]),
        "near_clip": 0.5 * max(-near, 1e-3 * -far),
        "far_clip": -2 * far,
        **common,
    }
