"""A calibration ball that was scanned beside the object: it gives the scan its scale."""

import numpy as np
from numpy.typing import NDArray

ROUND = 0.01
"""A piece is a ball when its vertices keep to a sphere within this share of the radius, rms."""


def find_balls(vertices: NDArray[np.float64], faces: NDArray[np.int64], piece: NDArray) -> list[tuple[int, float]]:
    """Return the number and the radius of each piece that is a ball, at least half of it.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (T, 3) int64
    piece : (T,) int
        The piece that each face belongs to.
    """
    balls = []
    order = np.argsort(piece, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(piece[order])) + 1):
        if len(own) < 50:
            continue
        points = vertices[np.unique(faces[own])]
        middle, radius = _sphere(points)
        misfit = np.abs(np.linalg.norm(points - middle, axis=1) - radius)
        # The foot on the table and a rim of noise are no part of the ball.
        near = misfit < max(4 * float(np.median(misfit)), 1e-3 * radius)
        middle, radius = _sphere(points[near])
        misfit = np.linalg.norm(points - middle, axis=1) - radius
        wide = np.ptp(points, axis=0).max() > 1.8 * radius
        if wide and near.mean() > 0.9 and np.sqrt((misfit**2).mean()) < ROUND * radius:
            balls.append((int(piece[own[0]]), radius))
    return balls


def _sphere(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return middle (3,) and radius of the sphere through points (N, 3): |p|^2 = 2 p . m + r^2 - |m|^2, linear."""
    shift = points.mean(0)
    scale = np.ptp(points, axis=0).max()
    local = (points - shift) / scale
    rows = np.column_stack([2 * local, np.ones(len(local))])
    solution = np.linalg.lstsq(rows, (local**2).sum(1), rcond=None)[0]
    radius = np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0))
    return solution[:3] * scale + shift, float(radius * scale)
