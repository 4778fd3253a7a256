"""The linear image of pseudo-normals that is the normals of a surface, up to a bas-relief transform."""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUNDS = 15


def integrable(pseudo: Array, mask: NDArray[np.bool_], smooth_px: float) -> tuple[Array, float]:
    """Return (3, 3) T, with b = pseudo @ T integrable, and how well T is determined.

    `pseudo` (P, 3) is any linear image of albedo x normal of the mask's pixels, `smooth_px` the standard deviation of
    the Gaussian under the derivatives, within the mask. The third column of T is a convention: b G is as integrable for
    every bas-relief transform G. How well: the smallest eigenvalue as a share of the next; near 1, other surfaces
    explain the pictures as well.

    Notes
    -----
    d/dy (b1 / b3) = d/dx (b2 / b3), with b_i = p_i . e, is linear in the six numbers c = p3 x p2, d = p3 x p1:
    c . (e x e_x) - d . (e x e_y) = 0 [Yuille1999], whatever factor each e has. Weights 1 / |residual| make it a
    least-absolute fit: at occluding edges and shadows' borders it does not hold. Then T is the transposed
    inverse of [-c, d, g], g = c x d of their mean length.
    """
    # Whitened, so that no component counts more than another, and without the albedo, whose edges are no shape.
    moments = pseudo.T @ pseudo / len(pseudo)
    root = np.linalg.cholesky(moments + (1e-12 * np.trace(moments) + 1e-300) * np.eye(3))
    white = np.linalg.solve(root, pseudo.T).T
    length = np.linalg.norm(white, axis=1, keepdims=True)
    e, e_x, e_y = _derivatives(white / np.maximum(length, 1e-12), mask, smooth_px)
    rows = np.concatenate([np.cross(e, e_x), -np.cross(e, e_y)], 1)
    weights = np.ones(len(rows))
    values, vectors = np.ones(6), np.eye(6)
    for _ in range(ROUNDS):
        values, vectors = np.linalg.eigh((rows * weights[:, None]).T @ rows)
        residual = np.abs(rows @ vectors[:, 0])
        weights = 1 / np.maximum(residual, 0.5 * np.median(residual) + 1e-12)
    solution = vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0])
    c, d = solution[:3], solution[3:]
    across = np.cross(c, d)
    across *= np.sqrt(np.linalg.norm(c) * np.linalg.norm(d)) / max(float(np.linalg.norm(across)), 1e-300)
    inverse = np.stack([-c, d, across], 1)
    matrix = np.linalg.inv(root).T @ np.linalg.inv(inverse).T
    return matrix, float(values[0] / max(values[1], 1e-300))


def _derivatives(e: Array, mask: NDArray[np.bool_], smooth_px: float) -> tuple[Array, Array, Array]:
    """Return e, smoothed, and its derivatives along x (right) and y (up) where all four neighbours are in the mask."""
    field = np.zeros((*mask.shape, 3), np.float32)
    field[mask] = e
    share = mask.astype(np.float32)
    if smooth_px > 0:
        field = cv2.GaussianBlur(field, (0, 0), smooth_px, borderType=cv2.BORDER_CONSTANT)
        share = cv2.GaussianBlur(share, (0, 0), smooth_px, borderType=cv2.BORDER_CONSTANT)
    field = field.astype(np.float64) / np.maximum(share, 1e-6)[..., None]
    middle = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    e_x = (field[1:-1, 2:] - field[1:-1, :-2])[middle] / 2
    e_y = (field[:-2, 1:-1] - field[2:, 1:-1])[middle] / 2
    return field[1:-1, 1:-1][middle], e_x, e_y
