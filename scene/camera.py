"""The camera: pixels to rays and back.

The only file that knows OpenCV's frame. CAMERA frame: x right, y up, z toward the viewer;
right-handed; millimetres; origin at the centre of projection, so that what is seen has z < 0.
PIXELS: (u, v) = (column, row), 0-based, integers are pixel centres, v down.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import SessionError

FROM_OPENCV = np.diag([1.0, -1.0, -1.0])
"""Takes a vector of OpenCV's camera frame (x right, y down, z forward) to ours. Its own inverse."""

Array = NDArray[np.float64]
SAME = 0.01  # relative, of focal lengths and of pictures' sides, where nothing else is known of them


def to_opencv(vectors: ArrayLike) -> Array:
    """Return vectors (..., 3) of the camera frame in OpenCV's; the same turn leads back."""
    # Plus nothing: -0.0 in a file makes people look for a fault.
    return np.asarray(vectors, np.float64) @ FROM_OPENCV + 0.0


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with lens distortion, or an orthographic one.

    Parameters
    ----------
    width, height : int
        Image size in pixels.
    fx, fy : float
        Focal length in pixels. Orthographic: pixels per millimetre (1 where the scale is unknown).
    cx, cy : float
        Principal point in pixels, integers are pixel centres.
    distortion : tuple of 5 float
        OpenCV's k1, k2, p1, p2, k3.
    projection : {"perspective", "orthographic"}
    source : str
        Where the numbers came from, for the report: "session.toml", "EXIF", "assumed".
    focal_sigma : float
        Relative standard deviation of the focal length; 0 where it is taken as exact.
    center_sigma_px : float
        Standard deviation of the principal point, one axis.

    Notes
    -----
    Perspective: u = cx + fx x / -z, v = cy - fy y / -z (then distorted).
    Orthographic: u = cx + fx x, v = cy - fy y.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    projection: Literal["perspective", "orthographic"] = "perspective"
    source: str = "session.toml"
    focal_sigma: float = 0.0
    center_sigma_px: float = 0.0

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1 or min(self.fx, self.fy) <= 0:
            raise SessionError(
                f"camera: size {self.width} x {self.height} px, focal length {self.fx}, {self.fy} px; "
                "all must be positive."
            )
        numbers = (self.width, self.height, self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not np.isfinite(numbers).all():
            raise SessionError(f"camera: found {numbers}; all must be finite numbers.")
        if len(self.distortion) != 5:
            raise SessionError(f"camera.distortion: found {len(self.distortion)} numbers, expected 5 (k1 k2 p1 p2 k3).")

    def __repr__(self) -> str:
        unit = "px per mm" if self.is_orthographic else "px"
        lens = ", distorting lens" if any(self.distortion) else ""
        return (
            f"{self.projection} camera, {self.width} x {self.height} px, fx {self.fx:.1f}, fy {self.fy:.1f} {unit}, "
            f"principal point ({self.cx:.1f}, {self.cy:.1f}) px{lens}, from {self.source}"
        )

    @classmethod
    def orthographic(cls, width: int, height: int, *, source: str = "assumed") -> "Camera":
        """Return the camera that is assumed when nothing is known: 1 px = 1 mm, centred."""
        return cls(width, height, 1.0, 1.0, (width - 1) / 2, (height - 1) / 2, projection="orthographic", source=source)

    @property
    def is_orthographic(self) -> bool:
        return self.projection == "orthographic"

    @property
    def matrix(self) -> Array:
        """(3, 3) OpenCV's camera matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def difference(self, usual: "Camera") -> str:
        """Return in words how a perspective camera differs from the usual one, at any size; empty: not by 3 sigma."""
        if self.is_orthographic or usual.is_orthographic:
            return ""
        longer = self.fx / self.width / (usual.fx / usual.width)
        if abs(np.log(longer)) > max(SAME, 3 * np.hypot(self.focal_sigma, usual.focal_sigma)):
            return f"its focal length is {longer:.3f} times the usual one"
        is_same = abs(self.width * usual.height / (self.height * usual.width) - 1) < SAME
        return "" if is_same else f"it has {self.width} x {self.height} px, not {usual.width} x {usual.height}"

    def rays(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Return the viewing ray of each pixel.

        Parameters
        ----------
        pixels : (..., 2) float
            (u, v).

        Returns
        -------
        origins : (..., 3) float64
            A point on each ray, mm: the centre of projection, or on the plane z = 0 if orthographic.
        directions : (..., 3) float64
            Unit vectors away from the camera (z < 0).
        """
        pixels = np.asarray(pixels, np.float64)
        x = (pixels[..., 0] - self.cx) / self.fx
        y = (pixels[..., 1] - self.cy) / self.fy
        x, y = self._undistort(x, y)
        zero = np.zeros_like(x)
        if self.is_orthographic:
            return np.stack([x, -y, zero], -1), np.stack([zero, zero, zero - 1.0], -1)
        directions = np.stack([x, -y, zero - 1.0], -1)
        return np.zeros_like(directions), directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def project(self, points: ArrayLike) -> Array:
        """Return the pixels (..., 2) at which points (..., 3), mm, are seen; NaN for z >= 0 if perspective."""
        points = np.asarray(points, np.float64)
        x, y = points[..., 0], -points[..., 1]
        if not self.is_orthographic:
            depth = np.where(points[..., 2] < 0, -points[..., 2], np.nan)
            x, y = x / depth, y / depth
        x, y = self._distort(x, y)
        return np.stack([self.cx + self.fx * x, self.cy + self.fy * y], -1)

    def points_at_depth(self, pixels: ArrayLike, z_mm: float | Array) -> Array:
        """Return the points (..., 3), mm, where the pixels' rays meet the plane z = `z_mm`; (..., 1), one for each."""
        origins, directions = self.rays(pixels)
        return origins + directions * ((z_mm - origins[..., 2:]) / directions[..., 2:])

    def grid(self, rows: slice = slice(None)) -> Array:
        """Return (h, width, 2) float64, the (u, v) of every pixel of the given rows."""
        v, u = np.mgrid[rows.indices(self.height)[0] : rows.indices(self.height)[1], 0 : self.width]
        return np.stack([u, v], -1).astype(np.float64)

    def halved(self) -> "Camera":
        """Return the camera of 2 x 2 superpixels: pixel centre u becomes (u - 0.5) / 2."""
        return self.scaled(self.width // 2, self.height // 2, 0.5, 0.5)

    def scaled(self, width: int, height: int, across: float, down: float) -> "Camera":
        """Return the camera of a picture scaled by `across`, `down`: pixel centre u becomes (u + 0.5) across - 0.5."""
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * across,
            fy=self.fy * down,
            cx=(self.cx + 0.5) * across - 0.5,
            cy=(self.cy + 0.5) * down - 0.5,
            center_sigma_px=self.center_sigma_px * float(np.sqrt(across * down)),
        )

    def every(self, step: int) -> "Camera":
        """Return the camera whose pixels are every n-th one, from the first on: pixel u becomes u / n."""
        smaller = self.scaled(-(-self.width // step), -(-self.height // step), 1 / step, 1 / step)
        return replace(smaller, cx=self.cx / step, cy=self.cy / step)

    def _distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Apply Brown's model as OpenCV writes it, on normalised coordinates with y down."""
        if not any(self.distortion):
            return x, y
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def _undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Invert `_distort` by fixed-point iteration: quadratic lenses converge in a few steps."""
        if not any(self.distortion):
            return x, y
        xu, yu = x, y
        for _ in range(50):
            xd, yd = self._distort(xu, yu)
            xu, yu = xu + (x - xd), yu + (y - yd)
            if np.nanmax(np.abs(np.stack([x - xd, y - yd])), initial=0.0) < 1e-12:
                break
        return xu, yu
