"""What was found and how far it can be trusted, in sentences made from the summary's numbers."""

from dataclasses import dataclass
from html import escape
from typing import Any

from compare.report.page import is_number, number, percent, plain
from compare.report.warned import warned_of
from compare.statistics.ranking import COVERAGE_BAR, level_of, ranking

DIRECTION_SIGMA_BARS_DEG = (1.0, 3.0)
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


def verdict(summary: dict[str, Any]) -> list[Statement]:
    """Return what the summary's numbers say of each result, the most important first.

    Parameters
    ----------
    summary : dict
        As it is written to summary.json; any part may be missing, and what is missing is said to be unknown.

    Returns
    -------
    list of Statement
        Bars: normals are called good up to 5 degrees median error, not to be relied on beyond 10; light
        directions 1 and 3 degrees (one sigma); registration 1 and 3 pixels; the error patterns of real frames
        and twin are called alike from a Pearson correlation of 0.6, unlike below 0.3. No result is called good
        beside a warning of the step that made it.
    """
    compared = summary.get("compare") or {}
    statements = [
        _normals(summary, compared),
        _truth(summary, compared),
        *_tilt(compared),
        _twin(summary, compared),
        _lights(summary, compared),
        *_capture(summary),
    ]
    return [statement for statement in statements if statement is not None]


def _best(compared: dict[str, Any], kind: str) -> tuple[str, dict[str, Any]] | None:
    rows = [(name, row[kind]) for name, row in (compared.get("methods") or {}).items() if row.get(kind)]
    return min(rows, key=lambda row: row[1]["median_deg"], default=None)


def _normals(summary: dict[str, Any], compared: dict[str, Any]) -> Statement | None:
    methods = compared.get("methods") or {}
    best = next((method for method in ranking(summary) if method.row.get("real")), None)
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
        return Statement("Normals", best.level, text)
    if not methods:
        return Statement("Normals", "unknown", "No normals were computed in this folder.")
    if compared.get("has_truth"):
        return Statement(
            "Normals", "unknown", "There is ground truth, but no normals of the photographs to judge by it."
        )
    text = (
        "Normals were computed, but nothing independent was given to judge them by (no scan, no known normals): "
        "<b>how accurate they are is not known</b>."
    )
    pairs = compared.get("between_methods") or []
    if pairs:
        pair = max(pairs, key=lambda row: row["median_deg"])
        text += (
            f" The methods that differ most, {escape(pair['a'])} and {escape(pair['b'])}, disagree by "
            f"{number(pair['median_deg'], 1, '°')} at half of the pixels, by more than {number(pair['q3_deg'], 1, '°')}"
            " at a quarter: there at least one of them is wrong. Agreement would not prove that they are right."
        )
    return Statement("Normals", "unknown", text)


def _truth(summary: dict[str, Any], compared: dict[str, Any]) -> Statement | None:
    align = summary.get("align") or compared.get("pose") or {}
    truth = compared.get("truth") or {}
    if not compared.get("has_truth"):
        return None
    sigma, residual = truth.get("sigma_deg_median"), align.get("residual_px")
    parts, level = [], "unknown"
    if is_number(residual):
        level = level_of(residual, RESIDUAL_BARS_PX)
        parts.append(f"the scan's outline fits the photographs to {number(residual, 2, 'px')}")
    if is_number(align.get("sigma_deg")):
        parts.append(f"its pose is known to {number(align['sigma_deg'], 2, '°')}")
    if is_number(sigma):
        level = level_of(sigma, (1.0, 3.0)) if level == "unknown" else level
        parts.append(f"its normals are uncertain by {number(sigma, 2, '°')} (median, one sigma)")
    if not parts:
        return Statement("Ground truth", "unknown", "Given, but nothing says how uncertain it is.")
    text = ", ".join(parts) + "."
    best = _best(compared, "real")
    if best is not None and is_number(sigma) and sigma > 0.5 * best[1]["median_deg"]:
        level = "care" if level == "good" else level
        text += " That is more than half of the smallest median error: part of the error may be the truth's own."
    level, text = _warned(summary, {"align": "registration"}, level, text)
    return Statement("Ground truth", level, text[0].upper() + text[1:])


def _tilt(compared: dict[str, Any]) -> list[Statement]:
    """Say where one turn common to all normals explains much of the error: lights or pose, not the method."""
    best = _best(compared, "real")
    if best is None:
        return []
    row = compared["methods"][best[0]]
    turn, left = row.get("real_rotation_deg"), row.get("real_median_unrotated_deg")
    if not is_number(turn) or not is_number(left) or turn < TILT_BAR_DEG or left > 0.75 * best[1]["median_deg"]:
        return []
    text = (
        f"One common turn of {number(turn, 1, '°')} explains much of the error of {escape(best[0])}: without it the "
        f"median would be {number(left, 1, '°')}. A turn shared by all pixels points to the lights' calibration or "
        "the scan's pose rather than to the method."
    )
    return [Statement("Common tilt", "care", text)]


def _twin(summary: dict[str, Any], compared: dict[str, Any]) -> Statement | None:
    rows = [
        (name, row)
        for name, row in (compared.get("methods") or {}).items()
        if row.get("real") and row.get("twin") and is_number(row.get("pearson"))
    ]
    if not rows:
        return None
    # The best method leaves the least for calibration and scan to hide behind.
    name, row = min(rows, key=lambda item: item[1]["real"]["median_deg"])
    r = row["pearson"]
    level, word = (
        ("bad", "do not resemble each other")
        if r < CORRELATION_BARS[0]
        else ("care", "resemble each other in part")
        if r < CORRELATION_BARS[1]
        else ("good", "are alike")
    )
    text = (
        f"The error patterns of {escape(name)} on the photographs and on their rendered twin {word} "
        f"(Pearson {number(r, 2)}, Spearman {number(row.get('spearman'), 2)}); median "
        f"{number(row['real']['median_deg'], 1, '°')} real, {number(row['twin']['median_deg'], 1, '°')} twin."
    )
    real, twin = row["real"]["median_deg"], row["twin"]["median_deg"]
    if level == "good" and real > 2 * twin and real - twin > 1:
        level = "care"
        text += (
            f" The twin fails where the object does, but less: {number(row.get('median_difference_deg'), 1, '°')} of "
            f"the median comes from what the twin lacks ({_lacking(summary)})."
        )
    elif level == "good":
        text += " The twin fails where the object does, and may be used to ask why."
    else:
        text += f" What the twin lacks ({_lacking(summary)}) makes errors of its own kind: do not read the object's "
        text += "failures off the twin."
    return Statement("Twin", level, text)


def _lacking(summary: dict[str, Any]) -> str:
    """Return what a twin does not have of the photographs it is of."""
    twin = summary.get("twin") or {}
    left = (twin.get("material") or {}).get("relative_rmse")
    unfitted = f"the {100 * left:.1f} % that its material leaves unexplained" if is_number(left) else ""
    noise = "" if twin.get("sensor") else "noise"
    return ", ".join(filter(None, (noise, unfitted or "material", "errors of calibration and registration")))


def _lights(summary: dict[str, Any], compared: dict[str, Any]) -> Statement | None:
    calibrate, lights = summary.get("calibrate") or {}, compared.get("lights") or {}
    if not calibrate and not lights:
        return Statement("Lights", "unknown", "No calibrated lights are in this folder.")
    sigma, relative = (
        calibrate[key] if is_number(calibrate.get(key)) else lights.get(key)
        for key in ("direction_sigma_deg_median", "intensity_sigma_median")
    )
    model = calibrate.get("model") or lights.get("model") or "unknown"
    count = lights.get("count")
    text = f"{number(count)} lights, model “{escape(str(model))}”." if is_number(count) else ""
    if not is_number(sigma):
        text += " Nothing says how uncertain their directions are."
    else:
        text += f" Their directions are known to {number(sigma, 2, '°')} (median, one sigma along one axis)"
        text += f", their intensities to {percent(relative, 1)}." if is_number(relative) else "."
    flagged = [row["name"] for row in lights.get("frames") or [] if row.get("flags")]
    level = level_of(sigma, DIRECTION_SIGMA_BARS_DEG)
    if flagged:
        level = "care" if level == "good" else level
        text += f" Suspicious: {escape(', '.join(flagged[:8]))}{' …' if len(flagged) > 8 else ''}."
    # Sigmas tell how far noise moves a direction; a frame that moved, or a lone ball, moves it further unseen.
    return Statement("Lights", *_warned(summary, {"check": "check", "calibrate": "calibration"}, level, text.strip()))


def _warned(summary: dict[str, Any], steps: dict[str, str], level: str, text: str) -> tuple[str, str]:
    """Return level and text, lowered and longer where one of the steps warned; `steps` gives each its word."""
    for step, word in steps.items():
        # What `check` says of the camera is a topic of its own.
        if any(not (step == "check" and warning.startswith("camera:")) for warning in warned_of(summary, step)):
            level = "care" if level == "good" else level
            text += f' The {word} warned: see <a href="#warnings">below</a>.'
    return level, text


def _capture(summary: dict[str, Any]) -> list[Statement]:
    out = []
    camera, capture = summary.get("camera") or {}, summary.get("capture") or {}
    if camera.get("projection") == "orthographic":
        text = (
            "The camera is taken as orthographic (no focal length is known): away from the image's centre the "
            "directions of view, and with them balls and normals, are off by up to half the angle of view."
        )
        out.append(Statement("Camera", "care", text))
    elif camera.get("source") in {"EXIF", "assumed"}:
        text = f"Its focal length is from “{escape(camera['source'])}”, not calibrated."
        out.append(Statement("Camera", "care", text))
    if capture.get("ambient") is False:
        text = "No frame without flash was given: constant light of the room is not subtracted."
        out.append(Statement("Ambient light", "care", text))
    return out
