"""What was found and how far it can be trusted, in sentences made from the summary's numbers."""

from dataclasses import dataclass
from statistics import median
from typing import Any

from markupsafe import Markup

from compare.report.facts import Summary, all_warnings, by_error, family, tied_methods
from compare.report.page import badge, plain, say, words
from compare.statistics.counterparts import likeness
from draw.readable import Readable, is_number, readable, share

DIRECTION_SIGMA_BARS_DEG = (1.0, 3.0)
TRUTH_SIGMA_BARS_DEG = (1.0, 3.0)
RESIDUAL_BARS_PX = (1.0, 3.0)
TILT_BAR_DEG = 1.0
MEDIAN_BARS_DEG = (5.0, 10.0)
"""Median error up to which normals are called good, and beyond which not to be relied on."""
COVERAGE_BAR = 0.9
LIKENESS = {"alike": "good", "alike in part": "care", "not alike": "bad"}
TRUST_WORSE = 3.0
"""Times as much unexplained as by the recommended method, from which on another is not to be used."""


@dataclass(frozen=True)
class Statement:
    """One sentence or two about one topic; `level` is a key of `page.LEVELS`, `html` is escaped already."""

    topic: str
    level: str
    html: Markup
    word: str = ""
    """On the badge, in place of the level's own."""

    @property
    def text(self) -> str:
        return plain(self.html)


def verdict(summary: Summary) -> list[Statement]:
    """Return what the summary's numbers say of each result, the most important first; a tolerance before all else.

    Any part of the summary may be missing, and what is missing is said to be unknown. Bars: normals are called good up
    to 5 degrees median error, not to be relied on beyond 10; light directions 1 and 3 degrees (one sigma);
    registration 1 and 3 pixels; the error patterns of real frames and twin are called alike from a Pearson correlation
    of 0.6, unlike below 0.3. No result is called good beside a warning of the step that made it.
    """
    compared = summary.get("compare") or {}
    methods = {name: compared["methods"][name] for name in by_error(compared)}
    judged = [name for name, row in methods.items() if row.get("real")]
    least = min((methods[name]["real"]["median_deg"] for name in judged), default=None)
    camera, capture = summary.get("camera") or {}, summary.get("capture") or {}
    statements = [
        _tolerance(summary, compared),
        _normals(summary, compared),
        _truth(summary, compared, least),
        _tilt(judged[0], methods[judged[0]]) if judged else None,
        _twin(summary.get("twin") or {}, methods),
        _lights(summary, compared),
    ]
    if camera.get("projection") == "orthographic":
        statements.append(Statement("Camera", "care", say("capture", "orthographic")))
    elif camera.get("source") in {"EXIF", "assumed"}:
        statements.append(Statement("Camera", "care", say("capture", "focal length", source=camera["source"])))
    if capture.get("ambient") is False:
        statements.append(Statement("Ambient light", "care", say("capture", "no ambient")))
    return [statement for statement in statements if statement is not None]


def _tolerance(summary: Summary, compared: Summary) -> Statement | None:
    """Say whether the normals are good enough for the user's purpose."""
    wanted = (summary.get("arguments") or {}).get("tolerance_deg")
    found = compared.get("tolerance")
    if not found:
        html = say("tolerance", "without truth", wanted=wanted)
        return Statement("Tolerance", "unknown", html) if is_number(wanted) else None
    level, word = ("good", "pass") if found["passes"] else ("bad", "fail")
    return Statement("Tolerance", level, say("tolerance", word, **found), word)


def _normals(summary: Summary, compared: Summary) -> Statement:
    best = next((row for row in ranking(summary) if is_number(row.get("median_deg"))), None)
    if best is not None:
        tied = tied_methods(compared)
        others = [name for name in tied if name != best["name"]] if best["name"] in tied else []
        text = say("normals", "level" if others else "best", **{**best, "others": ", ".join(others)})
        if _is_few(best):
            text += say("normals", "few", **best)
        level = best["level"]
        if tolerance := compared.get("tolerance"):
            # The user's bar, not the habits of the trade: no page says "pass" and "do not rely on it".
            level = "bad" if not tolerance["passes"] else "care" if _is_doubtful(best) else "good"
        return Statement("Normals", level, text + (say("normals", "doubts", **best) if best["doubts"] else ""))
    found = "unjudged" if compared.get("has_truth") else "without truth"
    text = say("normals", found if compared.get("methods") else "none")
    if compared.get("methods") and not compared.get("has_truth") and (pairs := compared.get("between_methods")):
        text += say("normals", "apart", **max(pairs, key=lambda row: row["median_deg"]))
    if trust := summary.get("trust"):
        # What explains the photographs best need not be good: no result is called so by that alone.
        text += say("normals", "predicted") + trust_sentence(trust)
    return Statement("Normals", "unknown", text)


def _is_few(row: Summary) -> bool:
    """Tell whether a method answers too little of the object."""
    return is_number(row.get("coverage")) and row["coverage"] < COVERAGE_BAR


def _is_doubtful(row: Summary) -> bool:
    """Tell whether a method doubts itself, or answers too little: it is not called good."""
    return bool(row["doubts"]) or _is_few(row)


def _truth(summary: Summary, compared: Summary, least_deg: float | None) -> Statement | None:
    if not compared.get("has_truth"):
        return None
    align = summary.get("align") or compared.get("pose") or {}
    sigma, residual = (compared.get("truth") or {}).get("sigma_deg_median"), align.get("residual_px")
    parts = {"residual": residual, "pose": align.get("sigma_deg"), "sigma": sigma}
    told = ", ".join(say("truth", name, value=value) for name, value in parts.items() if is_number(value))
    if not told:
        return Statement("Ground truth", "unknown", say("truth", "unknown"))
    text = Markup(f"{told[0].upper()}{told[1:]}.")
    level = level_of(residual, RESIDUAL_BARS_PX) if is_number(residual) else level_of(sigma, TRUTH_SIGMA_BARS_DEG)
    if least_deg is not None and is_number(sigma) and sigma > 0.5 * least_deg:
        level = _lowered(level)
        text += say("truth", "its own")
    return Statement("Ground truth", *_warned(summary, {"align": "registration"}, level, text))


def _tilt(name: str, row: Summary) -> Statement | None:
    """Say where one turn common to all normals explains much of the error: lights or pose, not the method."""
    turn, left = row.get("real_rotation_deg"), row.get("real_median_unrotated_deg")
    if not is_number(turn) or not is_number(left) or turn < TILT_BAR_DEG or left > 0.75 * row["real"]["median_deg"]:
        return None
    return Statement("Common tilt", "care", say("normals", "tilt", name=name, turn=turn, left=left))


def _twin(twin: Summary, methods: Summary) -> Statement | None:
    """Say whether real and twin err alike; `methods`: the rows, the best first."""
    both = [name for name, row in methods.items() if row.get("real") and row.get("twin")]
    both = [name for name in both if is_number(methods[name].get("pearson"))]
    if not both:
        return None
    # The best method leaves the least for calibration and scan to hide behind.
    name = both[0]
    row = methods[name]
    real, twins = row["real"]["median_deg"], row["twin"]["median_deg"]
    level = LIKENESS[likeness(row["pearson"])]
    # What a twin does not have of the photographs it is of.
    left = (twin.get("material") or {}).get("relative_rmse")
    unfitted = f"the {share(left, 1)} % that its material leaves unexplained" if is_number(left) else "material"
    noise = [] if twin.get("sensor") else ["noise"]
    lacking = ", ".join([*noise, unfitted, "errors of calibration and registration"])
    text = say("twin", "patterns", name=name, resemblance=say("resemblance", level), **row)
    if level != "good":
        text += say("twin", "of their own", lacking=lacking)
    elif real > 2 * twins and real - twins > 1:
        level = "care"
        text += say("twin", "less", lacking=lacking, **row)
    else:
        text += say("twin", "alike")
    return Statement("Twin", level, text)


def _lights(summary: Summary, compared: Summary) -> Statement:
    calibrate, lights = summary.get("calibrate") or {}, compared.get("lights") or {}
    # What `align` found of lights that `calibrate` could not tell.
    probe = (summary.get("align") or {}).get("light_probe")
    calibrate = {**calibrate, **(probe or {})}
    if not calibrate and not lights:
        return Statement("Lights", "unknown", say("lights", "none"))
    sigma, relative = (
        calibrate[key] if is_number(calibrate.get(key)) else lights.get(key)
        for key in ("direction_sigma_deg_median", "intensity_sigma_median")
    )
    model, count = str(calibrate.get("model") or lights.get("model") or "unknown"), lights.get("count")
    known = "unknown" if not is_number(sigma) else "directions and intensities" if is_number(relative) else "directions"
    if model == "unknown" and is_number(count):
        return Statement("Lights", "bad", say("lights", "no probe", count=count))
    parts = [say("lights", "count", count=count, model=model)] if is_number(count) else []
    parts.append(say("lights", known, sigma=sigma, relative=relative))
    parts += [say("lights", "by the scan")] if probe else []
    level = level_of(sigma, DIRECTION_SIGMA_BARS_DEG)
    if flagged := [row["name"] for row in lights.get("frames") or [] if row.get("flags")]:
        level = _lowered(level)
        parts.append(say("lights", "suspicious", names=", ".join(flagged[:8]) + (" …" if len(flagged) > 8 else "")))
    if witness := (summary.get("align") or {}).get("lights"):
        off, usual = witness["off"], median(witness["turn_deg"])
        parts.append(say("lights", "contradicted" if off else "agreed", names=", ".join(off), usual=usual))
        level = _lowered(level) if off else level
    # Sigmas tell how far noise moves a direction; a frame that moved, or a lone ball, moves it further unseen.
    text = Markup(" ").join(parts)
    return Statement("Lights", *_warned(summary, {"check": "check", "calibrate": "calibration"}, level, text))


def _lowered(level: str) -> str:
    return "care" if level == "good" else level


def _warned(summary: Summary, steps: dict[str, str], level: str, text: Markup) -> tuple[str, Markup]:
    """Return level and text, lowered and longer where one of the steps warned; `steps` gives each its word."""
    # What `check` says of the camera is a topic of its own.
    warned = {step for step, text in all_warnings(summary) if not (step == "check" and text.startswith("camera:"))}
    for step in [step for step in steps if step in warned]:
        level = _lowered(level)
        text += say("warnings", "step", step=steps[step])
    return level, text


def level_of(value: Any, bars: tuple[float, float]) -> str:
    """Return a value's level between two bars; unknown where it is none."""
    if not is_number(value):
        return "unknown"
    return "good" if value <= bars[0] else "care" if value <= bars[1] else "bad"


def ranking(summary: Summary) -> list[Summary]:
    """Return all methods as rows of a table, the smallest median error first; those without one last.

    A row has the method's part of the comparison and its errors on the photographs; name, family, doubts: why it says
    that it should not be believed; own_sigma: the median of its normals' sigma; level, a key of `page.LEVELS`: a method
    that leaves more than a tenth of the object unknown, or that doubts itself, is not called good.
    """
    compared, rows = summary.get("compare") or {}, []
    solved = (summary.get("solve") or {}).get("methods") or {}
    for name in by_error(compared):
        row = compared["methods"][name]
        kind = family(name)
        row = {**(row.get("real") or {}), **row, "name": name, "family": "" if kind == "calibrated" else kind}
        found = solved.get(name) or {}
        doubts = (str(text).removeprefix(f"{name}: ") for text in found.get("warnings") or ())
        # Without the quotes that stand for code on a terminal.
        row |= {"doubts": " ".join(doubts).replace("`", ""), "own_sigma": found.get("sigma_deg_median")}
        row["level"] = level_of(row.get("median_deg"), MEDIAN_BARS_DEG)
        row["level"] = _lowered(row["level"]) if _is_doubtful(row) else row["level"]
        rows.append({**row, "badge": badge(row["level"])})
    return rows


def trust_sentence(found: Summary) -> str:
    """Return which method to take, its sigma, which not to use, and why not to believe that."""
    methods, recommended, level = found["methods"], found["recommended"], found["level"]
    text, sigma = recommended, found["sigma_deg"]
    if sigma["median"] is not None:
        text += Readable().format(" (sigma {median:1°} in the median, {q90:1°} at one pixel of ten)", **sigma)
    if level:
        text += f"; {', '.join(level)} {'is' if len(level) == 1 else 'are'} level with it"
    least = max(methods[recommended]["unexplained"], 1e-9)
    bad = {name: row["unexplained"] / least for name, row in methods.items() if row["unexplained"] is not None}
    named = [f"{name} ({readable(times, 0)} times)" for name, times in bad.items() if times > TRUST_WORSE]
    if named:
        text += f". Do not use what explains them so much worse: {', '.join(named)}"
    return " ".join([f"{text}.", *(f"{doubt[0].upper()}{doubt[1:]}" for doubt in found["doubts"])])


def limits(summary: Summary, statements: list[Statement], warnings: list[tuple[str, str]]) -> Markup:
    """Return what makes the error, as far as twin, ground truth and lights tell, or why that is not known."""
    compared = summary.get("compare") or {}
    if not compared.get("has_truth"):
        return say("limits", "without truth")
    named, truth = [f"{s.topic} {s.level}" for s in statements], compared.get("truth") or {}
    told = [say("limits", name, **truth) for name in named if name in words("limits")]
    warned = {step for step, _ in warnings if step in ("calibrate", "align")}
    told += [say("limits", "warned", steps=" and ".join(sorted(warned)))] if warned else []
    return Markup(" ").join(told) or say("limits", "not told")
