"""How other tools turn a ball into a light: written from what is known of their models, run on the same photographs.

Each is given what its user would give it, and a little more: outlines as good as patient clicks or a faultless
detector, a picture developed without tone curve, white balanced so that a clipped highlight is white. What none of
them gets is what none of them uses. Directions are in the camera frame; NaN where a tool finds no highlight.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
TOWARD_CAMERA = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Patch:
    """One ball's box in every frame: white-balanced linear RGB (F, h, w, 3) in 0..1, and its first column and row."""

    values: NDArray[np.float32]
    left: int
    top: int

    @property
    def grid(self) -> tuple[Array, Array]:
        v, u = np.mgrid[0 : self.values.shape[1], 0 : self.values.shape[2]].astype(float)
        return u + self.left, v + self.top

    @property
    def eight_bits(self) -> NDArray[np.uint8]:
        """Gray, linear, as an 8-bit file without gamma holds it."""
        return np.round(255 * self.values.mean(-1)).astype(np.uint8)


def patch_of(frames: Frames, camera: Camera, sphere: Sphere, neutral: tuple[float, float, float]) -> Patch:
    """Cut out a ball with a margin of three pixels."""
    outline = sphere.outline(camera)
    left, top = np.maximum(np.floor(outline.min(0)).astype(int) - 3, 0)
    right, bottom = np.ceil(outline.max(0)).astype(int) + 4
    values = frames.read(slice(top, bottom), columns=slice(left, right)) / np.array(neutral, np.float32)
    return Patch(np.clip(values, 0, 1), int(left), int(top))


def clicks(camera: Camera, sphere: Sphere, rng: np.random.Generator, *, count: int, sigma_px: float) -> Array:
    """Return (count, 2) points that a user clicks on the ball's outline."""
    outline = sphere.outline(camera, 3600)
    start = rng.uniform(0, 3600 / count)
    chosen = (start + np.arange(count) * 3600 / count).astype(int) % 3600
    return outline[chosen] + rng.normal(0, sigma_px, (count, 2))


def circle_through(points: Array) -> tuple[float, float, float]:
    """Return centre and radius of the circle that fits points best."""
    matrix = np.column_stack([2 * points, np.ones(len(points))])
    a, b, c = np.linalg.lstsq(matrix, np.sum(points**2, 1), rcond=None)[0]
    start = [a, b, np.sqrt(c + a * a + b * b)]
    return tuple(least_squares(lambda p: np.hypot(*(points - p[:2]).T) - p[2], start).x)


def _orthographic(pixels: Array, circle: tuple[float, float, float]) -> Array:
    """Return the light (F, 3) by the law of the mirror: the normal of a disc's pixel, the view along the axis."""
    x, y = (pixels - circle[:2]).T / circle[2] * [[1.0], [-1.0]]
    with np.errstate(invalid="ignore"):
        normal = np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
    return 2 * (normal @ TOWARD_CAMERA)[:, None] * normal - TOWARD_CAMERA


def psbox(patch: Patch, camera: Camera, sphere: Sphere, rng: np.random.Generator) -> Array:
    """Orthographic: a circle through 12 good clicks (half a pixel), the median pixel of 250 and more of 255."""
    circle = circle_through(clicks(camera, sphere, rng, count=12, sigma_px=0.5))
    u, v = patch.grid
    inside = np.hypot(u - circle[0], v - circle[1]) < circle[2]
    out = np.full((len(patch.values), 2), np.nan)
    for f, image in enumerate(patch.eight_bits):
        bright = inside & (image >= 250)
        if bright.any():
            out[f] = np.median(u[bright]), np.median(v[bright])
    return _orthographic(out, circle)


def meshroom(patch: Patch, camera: Camera, sphere: Sphere) -> Array:
    """Orthographic: a faultless detector's box, r = min(w, h) / 2; the brightest pixel after a triangle filter."""
    outline = sphere.outline(camera)
    low, high = np.round(outline.min(0)), np.round(outline.max(0))
    circle = (*((low + high) / 2), float((high - low).min() / 2))
    u, v = patch.grid
    inside = np.hypot(u - circle[0], v - circle[1]) < circle[2]
    triangle = np.array([1, 2, 3, 2, 1], np.float32) / 9
    out = np.empty((len(patch.values), 2))
    for f, image in enumerate(patch.values.mean(-1)):
        smooth = np.where(inside, cv2.sepFilter2D(image, -1, triangle, triangle), -1)
        # A clipped highlight has many brightest pixels: their middle, kinder than the first of them.
        row, column = np.round(np.mean(np.nonzero(smooth > smooth.max() - 1e-4), axis=1))
        out[f] = column + patch.left, row + patch.top
    return _orthographic(out, circle)


def relightlab(patch: Patch, camera: Camera, sphere: Sphere, rng: np.random.Generator) -> tuple[Array, Array]:
    """Perspective: the sphere by 6 clicks (one pixel), a thresholded centroid in 8-bit sRGB.

    The clicks are fitted by the ellipses that a sphere can have, three numbers: kinder than a free ellipse. Returns
    points on the ball (F, 3) and directions (F, 3).
    """
    fitted = _clicked_sphere(camera, clicks(camera, sphere, rng, count=6, sigma_px=1.0), sphere)
    pixels = _thresholded_centroids(patch, fitted)
    normals, points = fitted.normals(camera, pixels)
    view = -points / np.linalg.norm(points, axis=1, keepdims=True)
    return points, 2 * np.sum(normals * view, 1, keepdims=True) * normals - view


def _clicked_sphere(camera: Camera, points: Array, like: Sphere) -> Sphere:
    def sphere(p: Array) -> Sphere:
        return Sphere("chrome", p[:2], float(p[2]), like.diameter_mm)

    def off(p: Array) -> Array:
        # Pixels between a click and the outline: the angle to the axis against the cone's half angle.
        center = sphere(p).center_mm(camera)
        _, rays = camera.rays(points)
        angle = np.arccos(np.clip(rays @ center / np.linalg.norm(center), -1, 1))
        return (angle - np.arcsin(sphere(p).radius_mm / np.linalg.norm(center))) * camera.fx

    return sphere(least_squares(off, circle_through(points)).x)


def _thresholded_centroids(patch: Patch, sphere: Sphere) -> Array:
    """Lower a threshold from 240 by tens until 0.5 % of the inner box is found; then halve a window six times.

    The threshold stops at 127, where the tool says "shadow": a small flash never fills 0.5 %, and lower down everything
    is found.
    """
    half = int(sphere.radius_px * np.sin(np.deg2rad(50)))
    column, row = (int(c) for c in np.round(sphere.center_px - [patch.left, patch.top]))
    rows, columns = slice(max(row - half, 0), row + half + 1), slice(max(column - half, 0), column + half + 1)
    out = np.full((len(patch.values), 2), np.nan)
    for f, image in enumerate(patch.values):
        gray = image[rows, columns].mean(-1)
        coded = np.round(255 * np.where(gray <= 0.0031308, 12.92 * gray, 1.055 * gray ** (1 / 2.4) - 0.055))
        if coded.max() < 127:
            continue
        threshold = 240
        while (coded > threshold).mean() < 0.005 and threshold > 130:
            threshold -= 10
        v, u = np.nonzero(coded > threshold)
        at, size = np.array([u.mean(), v.mean()]), float(half)
        for _ in range(6):
            near = (np.abs(u - at[0]) <= size) & (np.abs(v - at[1]) <= size)
            if not near.any():
                break
            at = np.array([u[near].mean(), v[near].mean()])
            size /= 2
        out[f] = at + [columns.start + patch.left, rows.start + patch.top]
    return out


def intersected(points: Array, directions: Array) -> Array:
    """Return the lights (F, 3) nearest to every ball's ray, points and directions (S, F, 3); then RelightLab's rule:

    what stands more than 10 % nearer or farther than the median light is moved to the median distance.
    """
    out = np.full(points.shape[1:], np.nan)
    for f in range(points.shape[1]):
        good = np.isfinite(directions[:, f]).all(-1)
        if good.sum() >= 2:
            p, d = points[good, f], directions[good, f]
            across = np.eye(3) - d[:, :, None] * d[:, None, :]
            out[f] = np.linalg.solve(across.sum(0), np.einsum("sij,sj->i", across, p))
    middle = np.nanmean(points, axis=(0, 1))
    distance = np.linalg.norm(out - middle, axis=1)
    median = np.nanmedian(distance)
    wrong = np.abs(distance / median - 1) > 0.1
    out[wrong] = middle + (out[wrong] - middle) * (median / distance[wrong])[:, None]
    return out


def white_ball(patch: Patch, camera: Camera, sphere: Sphere) -> tuple[Array, Array]:
    """Distant light by least squares on 0.2 < I < 0.8 of white, r < 0.95, no ambient: directions and RGB (F, 3)."""
    outline = sphere.outline(camera)
    low, high = np.round(outline.min(0)), np.round(outline.max(0))
    center, radius = (low + high) / 2, float((high - low).min() / 2)
    u, v = patch.grid
    x, y = (u - center[0]) / radius, -(v - center[1]) / radius
    inside = np.hypot(x, y) < 0.95
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], -1)[inside]
    values = patch.values[:, inside]
    top = np.quantile(values, 0.9999, axis=(0, 1))
    directions, strengths = np.full((len(values), 3), np.nan), np.full((len(values), 3), np.nan)
    for f, samples in enumerate(values / top):
        total = np.zeros(3)
        for c in range(3):
            used = (samples[:, c] > 0.2) & (samples[:, c] < 0.8)
            if used.sum() > 10:
                light = np.linalg.lstsq(normals[used], samples[used, c], rcond=None)[0]
                strengths[f, c] = np.linalg.norm(light)
                total += light
        directions[f] = total / np.linalg.norm(total) if total.any() else np.nan
    return directions, strengths / np.nanmean(strengths, 0)
