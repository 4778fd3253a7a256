"""A ball's outline as a curve in the picture, and its first, rough fit to the coarse stack's standing edges."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]


def refine_on_edges(edges: NDArray[np.float32], camera: Camera, sphere: Sphere) -> Sphere:
    """Return the ball moved to the nearest circle of standing edges, with its score.

    `edges` (h, w, 2) is `candidates.static_edges` of the coarse stack, real and imaginary part: one map in place
    of all frames, so that dozens of candidates are cheap.
    """
    jacobian = None
    # Narrow windows: a mirror's outline and the rim of the table that it mirrors lie a tenth of the radius apart.
    for window in np.maximum(1.5, np.array([0.045, 0.04, 0.03, 0.0, 0.0]) * sphere.radius_px):
        points, normals = outline_with_normals(camera, sphere, 120)
        if jacobian is None:
            jacobian = offset_jacobian(camera, sphere, points, normals)  # hardly changes within a few pixels
        offsets = np.arange(-window - 0.5, window + 0.75, 0.5)
        evidence = _along_normals(edges, points, normals, offsets)
        # The nearest edge, not the strongest: the rim of what a mirror shows outshines its own outline.
        here = evidence[:, 1:-1]
        peak = (here >= evidence[:, :-2]) & (here > evidence[:, 2:]) & (here > 0.1)
        best = np.where(peak, np.abs(offsets[1:-1]), np.inf).argmin(1)
        weight = np.where(peak.any(1), np.clip(here[np.arange(len(best)), best], 0, 0.4), 0)
        shift = _solve(jacobian, offsets[1:-1][best], weight)
        if shift is None or np.abs(shift).max() > 0.25 * sphere.radius_px:
            return replace(sphere, score=0.0)
        sphere = moved(sphere, shift)
    points, normals = outline_with_normals(camera, sphere, 240)
    evidence = _along_normals(edges, points, normals, np.arange(-1.0, 1.1, 0.5)).max(1)
    inside = np.all((points > 1) & (points < [camera.width - 2, camera.height - 2]), axis=1)
    return replace(sphere, score=float(np.mean(np.clip(evidence / 0.3, 0, 1) * inside)))


def outline_with_normals(camera: Camera, sphere: Sphere, count: int) -> tuple[Array, Array]:
    """Return points (N, 2) on the outline and outward normals (N, 2)."""
    points = sphere.outline(camera, count)
    tangent = np.roll(points, -1, 0) - np.roll(points, 1, 0)
    normals = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(np.nanmean(np.sum(normals * (points - points.mean(0)), 1)))
    return points, normals


def offset_jacobian(camera: Camera, sphere: Sphere, points: Array, normals: Array) -> Array:
    """Return (N, 3), what the outline's offset along each normal changes by with u, v and radius."""
    step = 0.05
    shifted = [moved(sphere, shift).outline(camera, len(points)) for shift in np.eye(3) * step]
    return np.stack([np.sum((to - points) * normals, 1) / step for to in shifted], -1)


def moved(sphere: Sphere, shift: Array) -> Sphere:
    """Return the ball shifted by (u, v, radius), pixels."""
    return replace(sphere, center_px=sphere.center_px + shift[:2], radius_px=float(sphere.radius_px + shift[2]))


def _along_normals(edges: NDArray[np.float32], points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (N, M): how strongly standing edges run along the outline, shifted by each offset."""
    where = (points[:, None] + offsets[:, None] * normals[:, None]).astype(np.float32)
    sampled = cv2.remap(edges, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    # The real part of evidence times (n_u - i n_v)^2: edges across the outline count against it.
    along = (normals[:, 0] ** 2 - normals[:, 1] ** 2)[:, None] * sampled[..., 0]
    return np.asarray(along + (2 * normals[:, 0] * normals[:, 1])[:, None] * sampled[..., 1], np.float32)


def _solve(jacobian: Array, offset: Array, weight: Array) -> Array | None:
    """Return the (3,) shift that best explains the offsets, by a robust fit in two steps."""
    shift = None
    for scale in (4.0, 1.5):
        residual = offset if shift is None else offset - jacobian @ shift
        w = weight / (1 + (residual / scale) ** 2)
        normal = jacobian.T @ (w[:, None] * jacobian)
        if np.trace(normal) <= 0 or np.linalg.cond(normal) > 1e8:
            return None
        shift = np.linalg.solve(normal, jacobian.T @ (w * offset))
    return None if shift is None else np.asarray(shift, np.float64)
