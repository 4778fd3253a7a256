"""What was found and how far it can be trusted, in sentences made from the summary's numbers."""

from dataclasses import dataclass
from statistics import median
from typing import Any

from markupsafe import Markup

from compare.report.facts import Summary, by_error, doubts_of, family, warned_of
from compare.report.page import badge, is_number, number, percent, plain, say, table_of, words
from compare.statistics.counterparts import likeness

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

    @property
    def text(self) -> str:
        return plain(self.html)


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
        _twin(summary.get("twin") or {}, methods),
        _lights(summary, compared),
        _camera(summary.get("camera") or {}),
        _ambient(summary.get("capture") or {}),
    ]
    return [statement for statement in statements if statement is not None]


def _normals(summary: Summary, compared: Summary) -> Statement:
    best = next((method for method in ranking(summary) if method.row.get("real")), None)
    if best is not None:
        coverage, doubts = best.row.get("coverage"), " ".join(best.doubts).replace("`", "")
        others = (compared.get("level") or {}).get("level") or []
        values = {"name": best.name, "others": ", ".join(others), **best.row["real"]}
        text = say("normals", "level" if others else "best", **values)
        if is_number(coverage) and coverage < COVERAGE_BAR:
            text += say("normals", "few", coverage=coverage)
        return Statement("Normals", best.level, text + (say("normals", "doubts", doubts=doubts) if doubts else ""))
    found = "unjudged" if compared.get("has_truth") else "without truth"
    text = say("normals", found if compared.get("methods") else "none")
    if compared.get("methods") and not compared.get("has_truth") and (pairs := compared.get("between_methods")):
        text += say("normals", "apart", **max(pairs, key=lambda row: row["median_deg"]))
    if trust := summary.get("trust"):
        # What explains the photographs best need not be good: no result is called so by that alone.
        text += say("normals", "predicted") + trust_sentence(trust)
    return Statement("Normals", "unknown", text)


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
    both = [name for name, row in methods.items() if row.get("real") and row.get("twin")]
    both = [name for name in both if is_number(methods[name].get("pearson"))]
    if not both:
        return None
    # The best method leaves the least for calibration and scan to hide behind.
    name = min(both, key=lambda name: methods[name]["real"]["median_deg"])
    row = methods[name]
    real, twins = row["real"]["median_deg"], row["twin"]["median_deg"]
    level = LIKENESS[likeness(row["pearson"])]
    # What a twin does not have of the photographs it is of.
    left = (twin.get("material") or {}).get("relative_rmse")
    unfitted = f"the {100 * left:.1f} % that its material leaves unexplained" if is_number(left) else "material"
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
    for step, word in steps.items():
        # What `check` says of the camera is a topic of its own.
        if any(not (step == "check" and warning.startswith("camera:")) for warning in warned_of(summary, step)):
            level = _lowered(level)
            text += say("warnings", "step", step=word)
    return level, text


def _camera(camera: Summary) -> Statement | None:
    if camera.get("projection") == "orthographic":
        return Statement("Camera", "care", say("capture", "orthographic"))
    if camera.get("source") in {"EXIF", "assumed"}:
        return Statement("Camera", "care", say("capture", "focal length", source=camera["source"]))
    return None


def _ambient(capture: Summary) -> Statement | None:
    if capture.get("ambient") is not False:
        return None
    return Statement("Ambient light", "care", say("capture", "no ambient"))


@dataclass(frozen=True)
class Ranked:
    """One method's normals of the photographs: `row` is its part of the comparison, `level` a key of `page.LEVELS`."""

    name: str
    family: str
    level: str
    row: Summary
    doubts: list[str]


def level_of(value: Any, bars: tuple[float, float]) -> str:
    """Return a value's level between two bars; unknown where it is none."""
    if not is_number(value):
        return "unknown"
    return "good" if value <= bars[0] else "care" if value <= bars[1] else "bad"


def ranking(summary: Summary) -> list[Ranked]:
    """Return all methods, the smallest median error first; those without one last.

    A method that leaves more than a tenth of the object unknown, or that doubts itself, is not called good.
    """
    compared, ranked = summary.get("compare") or {}, []
    for name in by_error(compared):
        row, doubts = compared["methods"][name], doubts_of(summary, name)
        level, coverage = level_of((row.get("real") or {}).get("median_deg"), MEDIAN_BARS_DEG), row.get("coverage")
        if level == "good" and (doubts or (is_number(coverage) and coverage < COVERAGE_BAR)):
            level = "care"
        ranked.append(Ranked(name, family(name), level, row, doubts))
    return ranked


def ranking_table(summary: Summary) -> Markup:
    """Return the methods as a table for the top of the page; nothing where there are none."""
    ranked, compared = ranking(summary), summary.get("compare") or {}
    if not ranked:
        return Markup("")
    name = "ranking" if any(method.row.get("real") for method in ranked) else "without truth"
    sigma = (compared.get("truth") or {}).get("sigma_deg_median")
    caption = say("ranking", name)
    if name == "ranking" and is_number(sigma):
        caption += say("ranking", "sigma", sigma=sigma)
    solved, rows = (summary.get("solve") or {}).get("methods") or {}, []
    for method in ranked:
        sigma_of = method.row.get("median_sigma_deg")
        told = {
            "name": method.name,
            "family": "" if method.family == "calibrated" else Markup(" <small>{}</small>").format(method.family),
            "verdict": badge(method.level),
            "uncertainty": Markup(f" ± {number(sigma_of, 1, '°')}") if is_number(sigma_of) else "",
            "own_sigma": (solved.get(method.name) or {}).get("sigma_deg_median"),
            # Without the quotes that stand for code on a terminal.
            "doubts": " ".join(method.doubts).replace("`", "") or "–",
        }
        rows.append({**(method.row.get("real") or {}), **method.row, **told})
    return Markup(table_of(name, rows, caption=caption, kind="numbers ranking"))


def trust_sentence(found: Summary) -> str:
    """Return which method to take, which not to use, and why not to believe that."""
    methods, recommended, level = found["methods"], found["recommended"], found["level"]
    text = recommended
    if level:
        text += f"; {', '.join(level)} {'is' if len(level) == 1 else 'are'} level with it"
    least = max(methods[recommended]["unexplained"], 1e-9)
    bad = {name: row["unexplained"] / least for name, row in methods.items() if row["unexplained"] is not None}
    named = [f"{name} ({times:.0f} times)" for name, times in bad.items() if times > TRUST_WORSE]
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


def tiles(
    summary: Summary, statements: list[Statement], best: str | None
) -> list[tuple[str, str, str, Markup, Markup]]:
    """Return title, section, level, value and its uncertainty of normals, ground truth, lights and twin."""
    levels, compared = {s.topic: s.level for s in statements}, summary.get("compare") or {}
    row = (compared.get("methods") or {}).get(best or "") or {}
    real, truth, align = row.get("real") or {}, compared.get("truth") or {}, summary.get("align") or {}
    calibrate, lights = summary.get("calibrate") or {}, compared.get("lights") or {}
    sigma = calibrate.get("direction_sigma_deg_median") or lights.get("direction_sigma_deg_median")
    intensity, off = calibrate.get("intensity_sigma_median"), align.get("residual_px")
    twin, own = (row.get("twin") or {}).get("median_deg"), row.get("median_sigma_deg")
    normals = number(real.get("median_deg"), 1, "°") + (f" ± {number(own, 1, '°')}" if is_number(own) else "")
    found = {
        "Normals": (
            "Median error", "errors", normals,
            f"{percent(row.get('coverage'))} of the object answered" if real else "nothing to measure it by",
        ),
        "Ground truth": (
            "Truth uncertain by", "registration", number(truth.get("sigma_deg_median"), 1, "°"),
            f"outline off by {number(off, 2, 'px')}" if is_number(off) else "no scan was registered",
        ),
        "Lights": (
            "Lights uncertain by", "lights", number(sigma, 2, "°"),
            f"intensity ± {percent(intensity, 1)}" if is_number(intensity) else "intensity not known",
        ),
        "Twin": (
            "Twin errs alike", "twin", number(row.get("pearson"), 2),
            f"1: at the same places, 0: unrelated; its median error {number(twin, 1, '°')}"
            if is_number(twin) else "there is no twin",
        ),
    }  # fmt: skip
    return [
        (title, anchor, levels.get(topic, "unknown"), Markup(value), Markup(more))
        for topic, (title, anchor, value, more) in found.items()
    ]
