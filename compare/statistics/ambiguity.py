"""How a normal map is wrong: what of its error a flip, a bas-relief or a linear map would explain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import family
from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg, unit

Array = NDArray[np.float64]
LOW_RANK = ("rpca", *UNCALIBRATED)
"""They all start from a factorisation of the samples, which leaves a linear ambiguity to be settled."""
MIRROR = np.array([-1.0, -1.0, 1.0])
MOST_PIXELS = 4000
"""Transforms are fitted to every so many pixels, to have at most about these, and measured on all."""


@dataclass(frozen=True)
class FourWays:
    """Mean angular errors, degrees, of one normal map; only `raw` may enter a table beside calibrated methods.

    `raw_deg`: with the method's own sign, 0 to 180. `best_sign_deg`: of (n1, n2, n3) and (-n1, -n2, n3), the better:
    convex and concave give the same pictures. `oracle_relief_deg`: after the bas-relief transform that suits the truth
    best: what any choice of mu, nu, lambda could reach. `oracle_linear_deg`: after the 3 x 3 matrix that suits the
    truth best: what is left is not the ambiguity's fault. `mirrored`: the better sign is not the method's.
    """

    raw_deg: float
    best_sign_deg: float
    oracle_relief_deg: float
    oracle_linear_deg: float
    mirrored: bool


def is_measured_so(method: str) -> bool:
    """Tell whether a method's result is measured in four ways: those of `LOW_RANK`, and other programs.

    Whether another program was told the lights' directions is not known here.
    """
    return method in LOW_RANK or family(method) == "external"


def four_ways(normals: NDArray, truth: NDArray, mask: NDArray[np.bool_] | None) -> FourWays:
    """Measure a normal map against the truth in four ways.

    Parameters
    ----------
    normals, truth : (H, W, 3) float
        Unit, NaN where unknown.
    mask : (H, W) bool or None
        Pixels that count, None for all; those where either is unknown do not.

    Returns
    -------
    FourWays
        NaN where no pixel counts. The errors fall from the first to the last: each way includes the one before.

    Notes
    -----
    n G with G = [1 0 0; 0 1 0; mu nu lambda] is all that normals under integrability leave open [Belhumeur1999]; the
    albedo changes its length only. Both oracles minimise the sum of |unit(n T) - truth|, not of its square: a few
    wrong pixels do not steer them. An angle is never folded by |cos|.
    """
    known = np.isfinite(normals[..., 0]) & np.isfinite(truth[..., 0])
    if mask is not None:
        known &= mask
    if not known.any():
        return FourWays(np.nan, np.nan, np.nan, np.nan, False)
    n, t = normals[known].astype(np.float64), truth[known].astype(np.float64)
    raw, other = _mean(n, t), _mean(n * MIRROR, t)
    start = np.diag(MIRROR) if other < raw else np.eye(3)
    some = slice(None, None, max(1, len(n) // MOST_PIXELS))
    reliefs = [(_mean(n @ g, t), g) for g in _reliefs(n[some], t[some])]
    best, relief = min([(min(raw, other), start), *reliefs], key=lambda each: each[0])
    linear = [relief, np.asarray(np.linalg.lstsq(n[some], t[some], rcond=None)[0], np.float64)]
    linear = [_square(_fit(n[some], t[some], _square, start.ravel())) for start in linear]
    least = min([best, *(_mean(n @ matrix, t) for matrix in linear)])
    return FourWays(raw, min(raw, other), best, least, other < raw)


def _mean(n: Array, truth: Array) -> float:
    return float(np.mean(angular_error_deg(unit(n), truth)))


def _reliefs(n: Array, truth: Array) -> list[Array]:
    """Return the bas-relief transforms that suit best, one of convex and one of concave."""
    return [_relief(_fit(n, truth, _relief, np.array([0.0, 0.0, depth]))) for depth in (1.0, -1.0)]


def _relief(numbers: Array) -> Array:
    """Return G, with the sign that keeps normals facing the camera."""
    mu, nu, depth = numbers
    return np.sign(depth or 1.0) * np.array([[1, 0, 0], [0, 1, 0], [mu, nu, depth]])


def _square(numbers: Array) -> Array:
    return numbers.reshape(3, 3)


def _fit(n: Array, truth: Array, matrix, start: Array) -> Array:
    """Return the numbers for which unit(n matrix(numbers)) is nearest to the truth."""
    from scipy.optimize import least_squares

    def off(numbers: Array) -> Array:
        turned = n @ matrix(numbers)
        chord = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12) - truth
        # soft_l1 of the chord's length, not of its three components.
        return np.linalg.norm(chord, axis=1)

    # lsmr: decomposing tall matrices wakes all the linear algebra's threads, which then wait for each other.
    return np.asarray(least_squares(off, start, loss="soft_l1", f_scale=0.02, max_nfev=60, tr_solver="lsmr").x)
