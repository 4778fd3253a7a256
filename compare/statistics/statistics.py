"""Angular errors in numbers: statistics, how alike two error maps are, what a flip or a bas-relief would explain."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg, unit

Array = NDArray[np.float64]
COVERAGE = {"real": "coverage", "twin": "twin_coverage"}
"""Under which key a method's row says which share of the true pixels it answered."""
ALBEDO = tuple(f"albedo_{name}_percent" for name in ("min", "max", "mean", "median", "std"))
LOW_RANK = ("rpca", *UNCALIBRATED)
"""They all start from a factorisation of the samples, which leaves a linear ambiguity to be settled: they are measured
in four ways, and so are other programs: whether these were told the lights' directions is not known."""
MIRROR = np.array([-1.0, -1.0, 1.0])
MOST_PIXELS = 4000
"""Transforms are fitted to every so many pixels, to have at most about these, and measured on all."""


def angular_statistics(error_deg: NDArray) -> dict[str, float | int]:
    """Return the statistics of an error map.

    Parameters
    ----------
    error_deg : (...) float
        Degrees, NaN where unknown (left out).

    Returns
    -------
    dict
        mean_deg, median_deg, std_deg, min_deg, q1_deg, q3_deg, max_deg in degrees; under_5_deg and
        under_10_deg, the share (0 to 1) of the pixels whose error is less than 5 and 10 degrees; pixels, how many
        counted. Without any pixel all but `pixels` are NaN.

    Notes
    -----
    std is that of the population (division by N). Quartiles interpolate linearly between order statistics,
    type 7 of [Hyndman1996]. The seed's table has min, max, mean, median and std.
    """
    error = np.asarray(error_deg)
    error = error[np.isfinite(error)].astype(np.float64)
    pixels = int(error.size)
    if pixels == 0:
        error = np.array([np.nan])
    low, q1, median, q3, high = np.quantile(error, [0, 0.25, 0.5, 0.75, 1])
    under_5, under_10 = (np.mean(error < bar) if pixels else np.nan for bar in (5, 10))
    found = {
        "mean_deg": error.mean(), "median_deg": median, "std_deg": error.std(), "min_deg": low, "q1_deg": q1,
        "q3_deg": q3, "max_deg": high, "under_5_deg": under_5, "under_10_deg": under_10,
    }  # fmt: skip
    return {**{name: float(value) for name, value in found.items()}, "pixels": pixels}


def albedo_statistics(found: NDArray, truth: NDArray, *, is_scaled: bool = True) -> dict[str, float]:
    """Return the statistics of the error of an albedo, percent: |found / true - 1| over pixels and channels.

    found, truth (P, C) float; NaN where unknown, and what truth has at 0, is left out. is_scaled: a channel of the
    albedo is known up to a factor; the one that makes the channel's median right is put in. albedo_min_percent, max,
    mean, median and std (of the population); NaN of nothing.
    """
    errors = []
    for channel in range(truth.shape[1]):
        known = np.isfinite(found[:, channel]) & (truth[:, channel] > 0)
        ratio = found[known, channel].astype(np.float64) / truth[known, channel]
        middle = np.median(ratio) if is_scaled and ratio.size else 1.0
        errors.append(np.abs(ratio / (middle if middle > 0 else 1.0) - 1))
    percent = 100 * np.concatenate(errors)
    if not percent.size:
        percent = np.array([np.nan])
    numbers = (of(percent) for of in (np.min, np.max, np.mean, np.median, np.std))
    return {name: float(number) for name, number in zip(ALBEDO, numbers, strict=True)}


def error_correlation(real_error: NDArray, twin_error: NDArray) -> dict[str, float | int]:
    """Return how alike two error maps of one shape are, over the pixels that are not NaN in either.

    pearson and spearman, -1 to 1: do the two fail at the same pixels, by value and by rank (ties share their mean
    rank); NaN with fewer than three pixels or where a map is constant. median_difference_deg: median of the real errors
    minus that of the twin's. pixels: how many counted. r = cov(a, b) / (std(a) std(b)); Spearman's is the same of the
    ranks [Spearman1904]. Neighbouring pixels are not independent, so that no p-value follows from `pixels`.
    """
    from scipy.stats import rankdata

    real_error, twin_error = np.asarray(real_error), np.asarray(twin_error)
    both = np.isfinite(real_error) & np.isfinite(twin_error)
    real, twin = real_error[both].astype(np.float64), twin_error[both].astype(np.float64)
    apart = float(np.median(real) - np.median(twin)) if real.size else np.nan
    found = {"pearson": _pearson(real, twin), "spearman": _pearson(rankdata(real), rankdata(twin))}
    return {**found, "median_difference_deg": apart, "pixels": int(real.size)}


def _pearson(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    # A map that varies by rounding alone has no pattern to share.
    has_pattern = a.size > 2 and a.std() * b.std() > 1e-12
    return float(np.corrcoef(a, b)[0, 1]) if has_pattern else float("nan")


def statistics_rows(compared: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the table of the methods' errors, a row for each method and each of real and twin.

    Parameters
    ----------
    compared : dict
        What `compare.compare.compare` returns: the part `compare` of summary.json. It may be empty.

    Returns
    -------
    list of dict
        method; frames: real or twin; what `angular_statistics` says; coverage: share (0 to 1) of the pixels with a
        truth that were answered; what `albedo_statistics` says, None where the true albedo is not known. The methods
        in their order; none where there is no truth.
    """
    rows = []
    for name, row in (compared.get("methods") or {}).items():
        for kind, coverage in COVERAGE.items():
            if found := row.get(kind):
                angles = {key: value for key, value in found.items() if key not in ALBEDO}
                albedo = {key: found.get(key) for key in ALBEDO}
                rows.append({"method": name, "frames": kind, **angles, "coverage": row.get(coverage), **albedo})
    return rows


def four_ways(normals: NDArray, truth: NDArray, mask: NDArray[np.bool_] | None) -> dict[str, float | bool]:
    """Measure a normal map against the truth in four ways.

    Parameters
    ----------
    normals, truth : (H, W, 3) float
        Unit, NaN where unknown.
    mask : (H, W) bool or None
        Pixels that count, None for all; those where either is unknown do not.

    Returns
    -------
    dict
        Mean angular errors, degrees, NaN where no pixel counts; only `raw_deg` may enter a table beside calibrated
        methods. raw_deg: with the method's own sign, 0 to 180. best_sign_deg: of (n1, n2, n3) and (-n1, -n2, n3), the
        better: convex and concave give the same pictures. oracle_relief_deg: after the bas-relief transform that suits
        the truth best: what any choice of mu, nu, lambda could reach. oracle_linear_deg: after the 3 x 3 matrix that
        suits the truth best: what is left is not the ambiguity's fault. Each includes the one before. mirrored: the
        better sign is not the method's.

    Notes
    -----
    n G with G = [1 0 0; 0 1 0; mu nu lambda] is all that normals under integrability leave open [Belhumeur1999]; the
    albedo changes its length only. Both oracles minimise the sum of |unit(n T) - truth|, not of its square: a few
    wrong pixels do not steer them. An angle is never folded by |cos|.
    """
    known = np.isfinite(normals[..., 0]) & np.isfinite(truth[..., 0])
    if mask is not None:
        known &= mask
    keys = ("raw_deg", "best_sign_deg", "oracle_relief_deg", "oracle_linear_deg")
    if not known.any():
        return {**dict.fromkeys(keys, np.nan), "mirrored": False}
    n, t = normals[known].astype(np.float64), truth[known].astype(np.float64)
    raw, other = _mean(n, t), _mean(n * MIRROR, t)
    start = np.diag(MIRROR) if other < raw else np.eye(3)
    some = slice(None, None, max(1, len(n) // MOST_PIXELS))
    # One of convex and one of concave.
    reliefs = [_fit(n[some], t[some], _relief, np.array([0.0, 0.0, depth])) for depth in (1.0, -1.0)]
    best, relief = min([(_mean(n @ matrix, t), matrix) for matrix in (start, *reliefs)], key=lambda each: each[0])
    linear = [relief, np.asarray(np.linalg.lstsq(n[some], t[some], rcond=None)[0], np.float64)]
    linear = [_fit(n[some], t[some], lambda numbers: numbers.reshape(3, 3), each.ravel()) for each in linear]
    least = min([best, *(_mean(n @ matrix, t) for matrix in linear)])
    return {**dict(zip(keys, (raw, min(raw, other), best, least), strict=True)), "mirrored": other < raw}


def _mean(n: Array, truth: Array) -> float:
    return float(np.mean(angular_error_deg(unit(n), truth)))


def _relief(numbers: Array) -> Array:
    """Return G, with the sign that keeps normals facing the camera."""
    mu, nu, depth = numbers
    return np.sign(depth or 1.0) * np.array([[1, 0, 0], [0, 1, 0], [mu, nu, depth]])


def _fit(n: Array, truth: Array, matrix, start: Array) -> Array:
    """Return the matrix(numbers) for which unit(n matrix) is nearest to the truth."""
    from scipy.optimize import least_squares

    def off(numbers: Array) -> Array:
        turned = n @ matrix(numbers)
        chord = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12) - truth
        # soft_l1 of the chord's length, not of its three components.
        return np.linalg.norm(chord, axis=1)

    # lsmr: decomposing tall matrices wakes all the linear algebra's threads, which then wait for each other.
    return matrix(least_squares(off, start, loss="soft_l1", f_scale=0.02, max_nfev=60, tr_solver="lsmr").x)
