"""Calibrated lights against those that they are known to be, and whether their sigmas hold what they say."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights, known_median
from scene.normals import angular_error_deg

CHI2_95 = {1: 3.841, 2: 5.991, 3: 7.815}
"""95 % of a chi-squared variable with so many degrees of freedom lie below."""
DISHONEST = 0.75
"""Share of lights inside their 95 % region below which the sigmas are called too small: of 12 lights that are honest,
fewer than 9 are inside once in 500 times."""


def light_errors(
    lights: Lights, truth: Lights, position_covariance_mm2: NDArray | None, *, intensities: bool
) -> dict[str, Any]:
    """Return the errors of lights, and the share of them inside the 95 % region of their sigma; None where unknown.

    Of the same frames. position_covariance_mm2: (F, 3, 3) or None. intensities: they were measured, and are judged too.
    The keys' names say the units; positions' errors are relative to their distance; `lights` has a row a frame.
    """
    if lights.positions_mm is not None:
        # Sigmas hold at the rendering's own reference point: the truth is looked at from there.
        truth = truth.seen_from(lights.reference_point_mm)
    angle, sigma = angular_error_deg(lights.directions, truth.directions), lights.direction_sigma_deg
    columns: dict[str, NDArray] = {"direction_error_deg": angle, "direction_sigma_deg": sigma}
    result: dict[str, Any] = {
        "model": lights.model,
        "model_of_the_session": truth.model,
        "direction_error_deg_median": float(np.median(angle)),
        "direction_error_deg_p95": float(np.quantile(angle, 0.95)),
        "direction_sigma_deg_median": known_median(sigma),
        "directions_inside_95": _inside(angle**2 / sigma**2, 2),
    }
    if truth.positions_mm is not None and lights.positions_mm is not None:
        offset = lights.positions_mm - truth.positions_mm
        distance = np.linalg.norm(truth.positions_mm - truth.reference_point_mm, axis=1)
        columns["position_error_percent"] = 100 * np.linalg.norm(offset, axis=1) / distance
        result["position_error_percent_median"] = float(np.median(columns["position_error_percent"]))
        if position_covariance_mm2 is not None:
            scaled = np.linalg.solve(position_covariance_mm2, offset[..., None])[..., 0]
            result["positions_inside_95"] = _inside(np.einsum("fi,fi->f", offset, scaled), 3)
    if np.isfinite(lights.intensity_sigma).any() and intensities:
        relative = lights.intensities / truth.normalised().intensities - 1
        columns["intensity_error_percent"] = 100 * relative
        result["intensity_error_percent_rms"] = float(100 * np.sqrt(np.mean(relative**2)))
        result["intensity_sigma_percent_median"] = 100 * (known_median(lights.intensity_sigma) or 0.0)
        result["intensities_inside_95"] = _inside(relative**2 / lights.intensity_sigma[:, None] ** 2, 1)
    rows = zip(truth.names, *columns.values(), strict=True)
    result["lights"] = [dict(zip(("name", *columns), row, strict=True)) for row in rows]
    return result


def sigma_doubts(result: dict[str, Any]) -> list[str]:
    """Return what in `light_errors` of a rendering speaks against the session's model of lights or its sigmas."""
    warnings = []
    if result["model"] != result["model_of_the_session"]:
        warnings.append(
            f"the session's lights are {result['model_of_the_session']}, those of its rendering come out "
            f"{result['model']}: balls and noise like these can hardly tell."
        )
    for what in ("directions", "positions", "intensities"):
        share = result.get(f"{what}_inside_95")
        if share is not None and share < DISHONEST:
            warnings.append(
                f"only {share:.0%} of the recovered {what} lie in the 95 % region of their sigma: it is too small for "
                "balls and flashes like these. Trust the self-test's errors instead."
            )
    return warnings


def _inside(square: NDArray, freedom: int) -> float | None:
    """Return the share of squared, normalised errors inside the 95 % region; None where no sigma is known."""
    known = square[np.isfinite(square)]
    return float(np.mean(known <= CHI2_95[freedom])) if known.size else None
