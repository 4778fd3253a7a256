"""How large the doubts of lights and ground truth are beside the error, and whether the object itself must make it."""

import math
from typing import Any

from compare.report.facts import Summary, all_warnings, best_method, stated_of_lights
from draw.readable import is_number

SIGMAS = 3
"""A doubt counts as this many of its standard deviations: hardly anything lies farther off."""
SHARE = 0.1
"""Of the squared error. Errors add in squares: without a part that makes less, the error would be under 5 % smaller."""
BEND_DEG = 40.0
"""Of normals, for the whole of a light's intensity: 5 % bends them by 2 degrees."""
MISFIT = 0.2
"""Of the photographs, rms, that a fitted material leaves unexplained: paint, glaze and stone 0.06 to 0.13, bronzes as
plastic 0.4 to 0.7 (Blender's, seven scenes)."""
HELPFUL = {"Twin": ("near", "reflectance"), "Object": ("metal",)}
"""Methods to be tried, by what makes the error. On seven other bronzes `metal` errs by 5 to 24 degrees, `iterative`
by 25 to 48."""


def doubts_deg(summary: Summary) -> dict[str, float]:
    """Return how far lights and ground truth may turn the normals, degrees, by what is stated; infinite: nothing is.

    `SIGMAS` standard deviations, or what was measured if that is more: how far chrome balls, and the white one's
    shading, disagree; a pose that fits nearly as well. An outline's residual counts as on a ball that is as large in
    the picture. A warning has no size.
    """
    lights, compared = stated_of_lights(summary), summary.get("compare") or {}
    align, truth = summary.get("align") or compared.get("pose") or {}, compared.get("truth") or {}
    fit = align.get("fit") or {}
    sigma, relative = lights["direction_sigma_deg_median"], lights["intensity_sigma_median"]
    of_lights = [lights.get("white_ball_deg"), (lights.get("cross_validation") or {}).get("difference_deg")]
    of_truth = [truth.get("sigma_deg_median"), align.get("sigma_deg")]
    if is_number(residual := align.get("residual_px")) and (pixels := truth.get("pixels")):
        of_truth.append(math.degrees(residual / math.sqrt(pixels / math.pi)))
    is_open = is_number(fit.get("second_deviations")) and fit["second_deviations"] < SIGMAS
    return {
        "Lights": _most([sigma, BEND_DEG * relative if is_number(relative) else None], of_lights, needed=sigma),
        "Ground truth": _most(of_truth, [fit.get("second_angle_deg")] if is_open else [], needed=truth.get("pixels")),
    }


def _most(sigmas: list[Any], measured: list[Any], *, needed: Any) -> float:
    known = [*(SIGMAS * value for value in sigmas if is_number(value)), *filter(is_number, measured)]
    return max(known, default=math.inf) if is_number(needed) else math.inf


def explains(part: str, summary: Summary) -> bool:
    """Tell whether the stated doubt of `Lights` or `Ground truth` is large enough to make a part of the error.

    The error is the best method's median; without ground truth what the photographs are missed by, as an angle.
    """
    compared, trust = summary.get("compare") or {}, summary.get("trust") or {}
    row = (compared.get("methods") or {}).get(best_method(summary)) or {}
    error = (row.get("real") or {}).get("median_deg")
    if not compared.get("has_truth") and is_number(trust.get("relative_rmse")):
        error = math.degrees(trust["relative_rmse"])
    return not is_number(error) or doubts_deg(summary)[part] ** 2 >= SHARE * error**2


def is_its_own_doing(summary: Summary) -> bool:
    """Tell whether only the object's own reflectance is left to make the error.

    It is a metal, or no fitted material explains the photographs; the doubts of lights and of ground truth are small;
    and balls have confirmed the lights, where `calibrate` warned.
    """
    lights, compared = stated_of_lights(summary), summary.get("compare") or {}
    is_checked = bool(lights.get("cross_validation")) or is_number(lights.get("white_ball_deg"))
    is_checked |= not any(step == "calibrate" for step, _ in all_warnings(summary))
    if explains("Lights", summary) or not is_checked:
        return False
    if not compared.get("has_truth"):
        return bool((summary.get("trust") or {}).get("doubts"))
    material = (summary.get("twin") or {}).get("material") or {}
    left = material.get("relative_rmse")
    is_odd = material.get("model") == "metal" or (is_number(left) and left >= MISFIT)
    return is_odd and not explains("Ground truth", summary)
