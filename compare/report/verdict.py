"""What was found and how far it can be trusted, in sentences made from the summary's numbers."""

from dataclasses import dataclass
from html import escape
from typing import Any

from compare.report.facts import warned_of
from compare.report.page import badge, is_number, number, percent, plain, verdict_section
from compare.report.ranking import COVERAGE_BAR, level_of, ranking, ranking_table

Summary = dict[str, Any]

DIRECTION_SIGMA_BARS_DEG = (1.0, 3.0)
TRUTH_SIGMA_BARS_DEG = (1.0, 3.0)
RESIDUAL_BARS_PX = (1.0, 3.0)
CORRELATION_BARS = (0.3, 0.6)
TILT_BAR_DEG = 1.0


@dataclass(frozen=True)
class Statement:
    """One sentence or two about one topic; `level` is a key of `page.LEVELS`, `html` is escaped already."""

    topic: str
    level: str
    html: str

    @property
    def text(self) -> str:
        return plain(self.html)


def verdict_box(summary: Summary, warnings: int) -> str:
    """Return the box on top: one line a topic, its badge, its sentence; the methods' table after the first."""
    lines = [(f"{escape(s.topic)} {badge(s.level)}", s.html) for s in verdict(summary)]
    if warnings:
        counted = "1 warning" if warnings == 1 else f"{warnings} warnings"
        link = f'<a href="#warnings">{counted}</a>: read them before using the results.'
        lines.append((f"Warnings {badge('care')}", link))
    else:
        lines.append(("Warnings", "No step gave a warning."))
    return verdict_section("What was found", lines, wide=ranking_table(summary))


def verdict(summary: Summary) -> list[Statement]:
    """Return what the summary's numbers say of each result, the most important first.

    Any part of the summary may be missing, and what is missing is said to be unknown. Bars: normals are called good up
    to 5 degrees median error, not to be relied on beyond 10; light directions 1 and 3 degrees (one sigma);
    registration 1 and 3 pixels; the error patterns of real frames and twin are called alike from a Pearson correlation
    of 0.6, unlike below 0.3. No result is called good beside a warning of the step that made it.
    """
    compared = summary.get("compare") or {}
    methods = compared.get("methods") or {}
    judged = [name for name, row in methods.items() if row.get("real")]
    best = min(judged, key=lambda name: methods[name]["real"]["median_deg"], default=None)
    statements = [
        _normals(summary, compared),
        _truth(summary, compared, None if best is None else methods[best]["real"]["median_deg"]),
        None if best is None else _tilt(best, methods[best]),
        _twin(summary, methods),
        _lights(summary, compared),
        _camera(summary.get("camera") or {}),
        _ambient(summary.get("capture") or {}),
    ]
    return [statement for statement in statements if statement is not None]


def _normals(summary: Summary, compared: Summary) -> Statement:
    best = next((method for method in ranking(summary) if method.row.get("real")), None)
    level = "unknown" if best is None else best.level
    if best is not None:
        row, coverage = best.row["real"], best.row.get("coverage")
        text = (
            f"The best normals of the photographs are those of <b>{escape(best.name)}</b>: against the ground truth "
            f"half of the {number(row['pixels'])} pixels are within {number(row['median_deg'], 1, '°')}, three "
            f"quarters within {number(row['q3_deg'], 1, '°')}, and {percent(row['under_10_deg'])} within 10°."
        )
        if is_number(coverage) and coverage < COVERAGE_BAR:
            text += f" It answers only {percent(coverage)} of the object; the rest is unknown."
        if best.doubts:
            text += f" It doubts itself: {escape(' '.join(best.doubts).replace('`', ''))}"
    elif not compared.get("methods"):
        text = "No normals were computed in this folder."
    elif compared.get("has_truth"):
        text = "There is ground truth, but no normals of the photographs to judge by it."
    else:
        text = (
            "Normals were computed, but nothing independent was given to judge them by (no scan, no known normals): "
            "<b>how accurate they are is not known</b>."
        )
        if pairs := compared.get("between_methods"):
            pair = max(pairs, key=lambda row: row["median_deg"])
            text += (
                f" The methods that differ most, {escape(pair['a'])} and {escape(pair['b'])}, disagree by "
                f"{number(pair['median_deg'], 1, '°')} at half of the pixels, by more than "
                f"{number(pair['q3_deg'], 1, '°')} at a quarter: there at least one of them is wrong. Agreement would "
                "not prove that they are right."
            )
    return Statement("Normals", level, text)


def _truth(summary: Summary, compared: Summary, least_deg: float | None) -> Statement | None:
    align = summary.get("align") or compared.get("pose") or {}
    if not compared.get("has_truth"):
        return None
    sigma, residual = (compared.get("truth") or {}).get("sigma_deg_median"), align.get("residual_px")
    parts = []
    if is_number(residual):
        parts.append(f"the scan's outline fits the photographs to {number(residual, 2, 'px')}")
    if is_number(align.get("sigma_deg")):
        parts.append(f"its pose is known to {number(align['sigma_deg'], 2, '°')}")
    if is_number(sigma):
        parts.append(f"its normals are uncertain by {number(sigma, 2, '°')} (median, one sigma)")
    if not parts:
        return Statement("Ground truth", "unknown", "Given, but nothing says how uncertain it is.")
    level = level_of(residual, RESIDUAL_BARS_PX) if is_number(residual) else level_of(sigma, TRUTH_SIGMA_BARS_DEG)
    text = ", ".join(parts) + "."
    if least_deg is not None and is_number(sigma) and sigma > 0.5 * least_deg:
        level = _lowered(level)
        text += " That is more than half of the smallest median error: part of the error may be the truth's own."
    level, text = _warned(summary, {"align": "registration"}, level, text)
    return Statement("Ground truth", level, text[0].upper() + text[1:])


def _tilt(name: str, row: Summary) -> Statement | None:
    """Say where one turn common to all normals explains much of the error: lights or pose, not the method."""
    turn, left = row.get("real_rotation_deg"), row.get("real_median_unrotated_deg")
    if not is_number(turn) or not is_number(left) or turn < TILT_BAR_DEG or left > 0.75 * row["real"]["median_deg"]:
        return None
    text = (
        f"One common turn of {number(turn, 1, '°')} explains much of the error of {escape(name)}: without it the "
        f"median would be {number(left, 1, '°')}. A turn shared by all pixels points to the lights' calibration or "
        "the scan's pose rather than to the method."
    )
    return Statement("Common tilt", "care", text)


def _twin(summary: Summary, methods: Summary) -> Statement | None:
    both = [name for name, row in methods.items() if row.get("real") and row.get("twin")]
    both = [name for name in both if is_number(methods[name].get("pearson"))]
    if not both:
        return None
    # The best method leaves the least for calibration and scan to hide behind.
    name = min(both, key=lambda name: methods[name]["real"]["median_deg"])
    row, r = methods[name], methods[name]["pearson"]
    level, word = "good", "are alike"
    if r < CORRELATION_BARS[0]:
        level, word = "bad", "do not resemble each other"
    elif r < CORRELATION_BARS[1]:
        level, word = "care", "resemble each other in part"
    real, twin = row["real"]["median_deg"], row["twin"]["median_deg"]
    text = (
        f"The error patterns of {escape(name)} on the photographs and on their rendered twin {word} "
        f"(Pearson {number(r, 2)}, Spearman {number(row.get('spearman'), 2)}); median "
        f"{number(real, 1, '°')} real, {number(twin, 1, '°')} twin."
    )
    lacking = _lacking(summary.get("twin") or {})
    if level != "good":
        text += f" What the twin lacks ({lacking}) makes errors of its own kind: do not read the object's "
        text += "failures off the twin."
    elif real > 2 * twin and real - twin > 1:
        level = "care"
        text += (
            f" The twin fails where the object does, but less: {number(row.get('median_difference_deg'), 1, '°')} of "
            f"the median comes from what the twin lacks ({lacking})."
        )
    else:
        text += " The twin fails where the object does, and may be used to ask why."
    return Statement("Twin", level, text)


def _lacking(twin: Summary) -> str:
    """Return what a twin does not have of the photographs it is of."""
    left = (twin.get("material") or {}).get("relative_rmse")
    unfitted = f"the {100 * left:.1f} % that its material leaves unexplained" if is_number(left) else ""
    noise = "" if twin.get("sensor") else "noise"
    return ", ".join(filter(None, (noise, unfitted or "material", "errors of calibration and registration")))


def _lights(summary: Summary, compared: Summary) -> Statement:
    calibrate, lights = summary.get("calibrate") or {}, compared.get("lights") or {}
    if not calibrate and not lights:
        return Statement("Lights", "unknown", "No calibrated lights are in this folder.")
    sigma, relative = (
        calibrate[key] if is_number(calibrate.get(key)) else lights.get(key)
        for key in ("direction_sigma_deg_median", "intensity_sigma_median")
    )
    model, count = calibrate.get("model") or lights.get("model") or "unknown", lights.get("count")
    text = f"{number(count)} lights, model “{escape(str(model))}”." if is_number(count) else ""
    if not is_number(sigma):
        text += " Nothing says how uncertain their directions are."
    else:
        text += f" Their directions are known to {number(sigma, 2, '°')} (median, one sigma along one axis)"
        text += f", their intensities to {percent(relative, 1)}." if is_number(relative) else "."
    level = level_of(sigma, DIRECTION_SIGMA_BARS_DEG)
    if flagged := [row["name"] for row in lights.get("frames") or [] if row.get("flags")]:
        level = _lowered(level)
        text += f" Suspicious: {escape(', '.join(flagged[:8]))}{' …' if len(flagged) > 8 else ''}."
    # Sigmas tell how far noise moves a direction; a frame that moved, or a lone ball, moves it further unseen.
    return Statement("Lights", *_warned(summary, {"check": "check", "calibrate": "calibration"}, level, text.strip()))


def _lowered(level: str) -> str:
    return "care" if level == "good" else level


def _warned(summary: Summary, steps: dict[str, str], level: str, text: str) -> tuple[str, str]:
    """Return level and text, lowered and longer where one of the steps warned; `steps` gives each its word."""
    for step, word in steps.items():
        # What `check` says of the camera is a topic of its own.
        if any(not (step == "check" and warning.startswith("camera:")) for warning in warned_of(summary, step)):
            level = _lowered(level)
            text += f' The {word} warned: see <a href="#warnings">below</a>.'
    return level, text


def _camera(camera: Summary) -> Statement | None:
    if camera.get("projection") == "orthographic":
        text = (
            "The camera is taken as orthographic (no focal length is known): away from the image's centre the "
            "directions of view, and with them balls and normals, are off by up to half the angle of view."
        )
    elif camera.get("source") in {"EXIF", "assumed"}:
        text = f"Its focal length is from “{escape(camera['source'])}”, not calibrated."
    else:
        return None
    return Statement("Camera", "care", text)


def _ambient(capture: Summary) -> Statement | None:
    if capture.get("ambient") is not False:
        return None
    text = "No frame without flash was given: constant light of the room is not subtracted."
    return Statement("Ambient light", "care", text)
