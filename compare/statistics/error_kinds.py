"""How a normal map is wrong: what of its error a flip, a bas-relief, a turn or a lean would explain."""

import numpy as np
from numpy.typing import NDArray

from scene.normals import angular_error_deg, unit

Array = NDArray[np.float64]
ROUNDS = 10
"""Of least squares with weights one over the residual: nearly the least sum of absolute residuals."""
FLIP = np.array([-1.0, -1.0, 1.0])
NEAR_DEG = 1.0
"""Residuals below weigh alike."""
MOST_PIXELS = 4000
"""Transforms are fitted to every so many pixels, to have at most about these, and measured on all."""


def error_kinds(normals: NDArray, truth: NDArray) -> dict[str, float]:
    """Return what is left of the median angular error when one kind of error is taken away, by the truth.

    Parameters
    ----------
    normals, truth : (P, 3) float
        Unit, camera frame; NaN where unknown.

    Returns
    -------
    dict
        flip_deg: median error of (n1, n2, n3) or (-n1, -n2, n3), the better. relief_deg: after the bas-relief transform
        that suits best, or the flip. turn_deg: after the rotation that suits best. tilt_deg: median of the zenith
        angle found minus the true one: below 0 the surface comes out too flat, above too steep. tilt_spread_deg:
        half the range between its quartiles. NaN where nothing is known.

    Notes
    -----
    n G, G = [1 0 0; 0 1 0; mu nu lambda], is parallel to t where (n1 + mu n3) t3 = lambda n3 t1 and
    (n2 + nu n3) t3 = lambda n3 t2: linear in the three numbers [Belhumeur1999]. The rotation by singular values
    [Kabsch1976]. Both with weights that a few wrong pixels do not steer.
    """
    known = np.isfinite(normals[:, 0]) & np.isfinite(truth[:, 0])
    names = ("flip_deg", "relief_deg", "turn_deg", "tilt_deg", "tilt_spread_deg")
    if not known.any():
        return dict.fromkeys(names, np.nan)
    n, t = normals[known].astype(np.float64), truth[known].astype(np.float64)
    raw, flipped = _median(n, t), _median(n * FLIP, t)
    flip = min(raw, flipped)
    some = slice(None, None, -(-len(n) // MOST_PIXELS))
    reliefs = [_median(unit(each @ _relief(each[some], t[some])), t) for each in (n, n * FLIP)]
    turned = _median(n @ _turn(n[some], t[some]), t)
    tilt = _zenith_deg(n) - _zenith_deg(t)
    low, middle, high = np.quantile(tilt, [0.25, 0.5, 0.75])
    values = (flip, min(flip, *reliefs), min(raw, turned), middle, (high - low) / 2)
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _median(n: Array, t: Array) -> float:
    return float(np.nanmedian(angular_error_deg(n, t)))


def _zenith_deg(n: Array) -> Array:
    return np.degrees(np.arctan2(np.hypot(n[:, 0], n[:, 1]), n[:, 2]))


def _relief(n: Array, t: Array) -> Array:
    """Return the G (3, 3), its sign that of lambda, for which n G suits t best."""
    weights, matrix = np.ones(len(n)), np.eye(3)
    # mu, nu, lambda; two equations a pixel.
    product, none = n[:, 2] * t[:, 2], np.zeros(len(n))
    across = np.stack([product, none, -n[:, 2] * t[:, 0]], 1)
    down = np.stack([none, product, -n[:, 2] * t[:, 1]], 1)
    rows = np.concatenate([across, down])
    right = -np.concatenate([n[:, 0] * t[:, 2], n[:, 1] * t[:, 2]])
    for _ in range(ROUNDS):
        weighted = (rows * np.tile(weights, 2)[:, None]).T
        mu, nu, depth = np.linalg.lstsq(weighted @ rows, weighted @ right, rcond=None)[0]
        matrix = (1.0 if depth >= 0 else -1.0) * np.array([[1, 0, 0], [0, 1, 0], [mu, nu, depth]])
        moved = n @ matrix
        # The equations' residual is the sine times the length: take the length out, and weigh by the angle.
        off = np.maximum(np.nan_to_num(angular_error_deg(unit(moved), t), nan=180.0), NEAR_DEG)
        weights = 1 / (off * np.maximum(np.sum(moved**2, 1), 1e-6))
    return matrix


def _turn(n: Array, t: Array) -> Array:
    """Return the matrix (3, 3) for which n times it is n after the rotation that suits t best."""
    from compare.statistics.statistics import common_rotation

    weights, matrix = np.ones(len(n)), np.eye(3)
    for _ in range(ROUNDS):
        rotation = common_rotation((t * weights[:, None]).T @ n)
        if rotation is None:
            break
        matrix = rotation.T
        weights = 1 / np.maximum(angular_error_deg(n @ matrix, t), NEAR_DEG)
    return matrix
