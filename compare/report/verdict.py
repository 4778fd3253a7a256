"""What was found and how far it can be trusted, in sentences made from the summary's numbers."""

from dataclasses import dataclass, replace
from typing import Any

from markupsafe import Markup, escape

from compare.report.doubts import is_its_own_doing
from compare.report.facts import Summary, all_warnings, by_error, by_runs, family, stated_of_lights, tied_methods
from compare.report.page import LEVELS, badge, plain, say, words
from compare.statistics.counterparts import likeness
from draw.readable import is_number, share

DOUBT_BARS = (1.0, 3.0)
"""Of sigmas of lights and ground truth, degrees, and of the outline's residual, px."""
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
    reasons: tuple[str, ...] = ()
    """What speaks against it beside its number: with one it is not called good."""
    judged: str = ""
    """By a tolerance: pass or fail."""
    about: str = ""
    """The method that a twin's likeness is of."""

    @property
    def text(self) -> str:
        return plain(self.html)

    @property
    def word(self) -> str:
        """On its badge."""
        return self.judged or words("badges").get(self.topic, LEVELS)[self.level]

    @property
    def bar(self) -> str:
        """What is called good; nothing where nothing is judged."""
        return "" if self.level == "unknown" or self.judged else words("bars").get(self.topic, "")

    @property
    def why(self) -> str:
        """By what it is called so."""
        return "; ".join([*filter(None, [self.bar]), *(f"mind: {reason}" for reason in self.reasons)])


def _statement(topic: str, level: str, html: Markup, reasons: list[str], judged: str = "") -> Statement:
    """Return a statement; with a reason none is called good, unless by a tolerance."""
    level = "care" if reasons and level == "good" and not judged else level
    return Statement(topic, level, html, tuple(reasons), judged)


def verdict(summary: Summary) -> list[Statement]:
    """Return what the summary's numbers say of each result, the most important first; a tolerance before all else.

    Any part of the summary may be missing, and what is missing is said to be unknown. Bars: normals are called good up
    to 5 degrees median error, not to be relied on beyond 10; light directions 1 and 3 degrees (one sigma);
    registration 1 and 3 pixels and degrees; the error patterns of real frames and twin are called alike from a Pearson
    correlation of 0.6, unlike below 0.3. No result is called good beside a warning of the step that made it, and no
    normals that a poor ground truth measured.
    """
    compared = summary.get("compare") or {}
    methods = {name: compared["methods"][name] for name in by_error(compared)}
    judged = [name for name, row in methods.items() if row.get("real")]
    camera, capture, truth = summary.get("camera") or {}, summary.get("capture") or {}, _truth(summary, compared)
    statements = [
        _tolerance(summary, compared),
        _normals(summary, compared, truth),
        truth,
        # What a metal's normals have in common tells of no light.
        _tilt(judged[0], methods[judged[0]]) if judged and not is_its_own_doing(summary) else None,
        _twin(summary.get("twin") or {}, methods),
        _lights(summary, compared),
    ]
    if camera.get("projection") == "orthographic":
        statements.append(Statement("Camera", "care", say("capture", "orthographic")))
    elif camera.get("source") in {"EXIF", "assumed"}:
        statements.append(Statement("Camera", "care", say("capture", "focal length", **camera)))
    if capture.get("ambient") is False:
        statements.append(Statement("Ambient light", "care", say("capture", "no ambient")))
    first, *others = [statement for statement in statements if statement is not None]
    first = replace(first, html=first.html + _predicted(summary)) if first.level == "unknown" else first
    return [first, *others]


def _tolerance(summary: Summary, compared: Summary) -> Statement | None:
    """Say whether the normals are good enough for the user's purpose."""
    wanted = (summary.get("arguments") or {}).get("tolerance_deg")
    found = compared.get("tolerance")
    if not found:
        html = say("tolerance", "without truth", wanted=wanted)
        return Statement("Tolerance", "unknown", html) if is_number(wanted) else None
    level, word = ("good", "pass") if found["passes"] else ("bad", "fail")
    return Statement("Tolerance", level, say("tolerance", word, **found), judged=word)


def _normals(summary: Summary, compared: Summary, truth: Statement | None) -> Statement:
    rows = [row for row in ranking(summary) if is_number(row.get("median_deg"))]
    if rows:
        best, tied = rows[0], tied_methods(compared)
        level = {row["name"]: row["badge"] for row in rows}
        # The user's bar tells apart what the uncertainty does not.
        alike = [] if best["judged"] or best["name"] not in tied else tied
        others = ", ".join(name for name in alike if name != best["name"] and level.get(name) == best["badge"])
        few = best["coverage"] if words("reasons")["few"] in best["reasons"] else None
        text = say("normals", "best", **best | {"others": others or None, "few": few, "doubts": best["doubts"] or None})
        poor = truth is not None and truth.level == "bad" and not best["judged"]
        reasons = best["reasons"] + [words("reasons")["truth"]] * poor
        return _statement("Normals", best["level"], text, reasons, best["judged"])
    if compared.get("methods") and not compared.get("has_truth"):
        pairs = compared.get("between_methods") or [{}]
        text = say("normals", "without truth", **max(pairs, key=lambda row: row.get("median_deg", 0)))
    else:
        text = say("normals", "unjudged" if compared.get("methods") else "none")
    return Statement("Normals", "unknown", text)


def _predicted(summary: Summary) -> Markup:
    """Return what the photographs recommend; what explains them best need not be good: by that alone nothing is."""
    if not (trust := summary.get("trust")):
        return Markup()
    return say("trust", "best", **trust) + (say("trust", "disbelieved") if trust["doubts"] else "")


def _truth(summary: Summary, compared: Summary) -> Statement | None:
    if not compared.get("has_truth"):
        return None
    align = summary.get("align") or compared.get("pose") or {}
    sigma, residual = (compared.get("truth") or {}).get("sigma_deg_median"), align.get("residual_px")
    levels = {level_of(residual, DOUBT_BARS), level_of(sigma, DOUBT_BARS)}
    level = next(name for name in ("bad", "care", "good", "unknown") if name in levels)
    if not any(map(is_number, (residual, align.get("sigma_deg"), sigma))):
        return Statement("Ground truth", "unknown", say("truth", "unknown"))
    text = say("truth", "told", residual=residual, pose=align.get("sigma_deg"), sigma=sigma).strip()
    own = say("truth", "its own") if is_truths_own(compared) else ""
    return _statement("Ground truth", level, text + own, _warned(summary, "align"))


def is_truths_own(compared: Summary) -> bool:
    """Tell whether the truth is so uncertain that much of what is measured by it, or its tolerance, may be its own."""
    sigma_deg, tolerance = (compared.get("truth") or {}).get("sigma_deg_median"), compared.get("tolerance")
    measured = [row["real"]["median_deg"] for row in (compared.get("methods") or {}).values() if row.get("real")]
    measured += [tolerance["deg"]] if tolerance else []
    return is_number(sigma_deg) and sigma_deg > 0.5 * min(measured, default=sigma_deg * 2)


def _tilt(name: str, row: Summary) -> Statement | None:
    """Say where one turn common to all normals explains much of the error: lights or pose, not the method."""
    turn, left = row.get("real_rotation_deg"), row.get("real_median_unrotated_deg")
    if not is_number(turn) or not is_number(left) or turn < TILT_BAR_DEG or left > 0.75 * row["real"]["median_deg"]:
        return None
    return Statement("Common tilt", "care", say("normals", "tilt", name=name, turn=turn, left=left))


def _twin(twin: Summary, methods: Summary) -> Statement | None:
    """Say whether real and twin err alike; `methods`: the rows, the best first."""
    both = {name: row for name, row in methods.items() if row.get("real") and row.get("twin")}
    # The best method leaves the least for calibration and scan to hide behind.
    name, row = next(((name, row) for name, row in both.items() if is_number(row.get("pearson"))), (None, {}))
    if name is None:
        return None
    real, twins = row["real"]["median_deg"], row["twin"]["median_deg"]
    level, reasons = LIKENESS[likeness(row["pearson"])], []
    # What a twin does not have of the photographs it is of.
    left = (twin.get("material") or {}).get("relative_rmse")
    unfitted = f"the {share(left, 1)} % that its material leaves unexplained" if is_number(left) else "material"
    noise = [] if twin.get("sensor") else ["noise"]
    lacking = ", ".join([*noise, unfitted, "errors of calibration and registration"])
    text = say("twin", "patterns", name=name, resemblance=say("resemblance", level), **row)
    if level != "good":
        text += say("twin", "of their own", lacking=lacking)
    elif real > 2 * twins and real - twins > 1:
        reasons.append(words("reasons")["less"])
        text += say("twin", "less", lacking=lacking, **row)
    else:
        text += say("twin", "alike")
    return replace(_statement("Twin", level, text, reasons), about=name)


def _lights(summary: Summary, compared: Summary) -> Statement:
    lights, probe = compared.get("lights") or {}, (summary.get("align") or {}).get("light_probe")
    if not (summary.get("calibrate") or probe or lights):
        return Statement("Lights", "unknown", say("lights", "none"))
    calibrate = stated_of_lights(summary)
    sigma, model = calibrate["direction_sigma_deg_median"], calibrate.get("model") or lights.get("model") or "unknown"
    if model == "unknown" and is_number(lights.get("count")):
        return _statement("Lights", "bad", say("lights", "no probe", **lights), [words("reasons")["no probe"]])
    told = {**calibrate, "count": lights.get("count"), "model": str(model)}
    text = say("lights", "known" if is_number(sigma) else "unknown", **told)
    text += say("lights", "alone", **apart) if (apart := calibrate.get("cross_validation")) else ""
    text += say("lights", "by the scan") if probe else ""
    reasons = []
    if flagged := [row["name"] for row in lights.get("frames") or [] if row.get("flags")]:
        text += say("lights", "suspicious", names=by_runs(flagged))
        reasons.append(plain(say("reasons", "flagged", count=len(flagged))))
    # Sigmas tell how far noise moves a direction; a frame that moved, or a lone ball, moves it further unseen.
    reasons += _warned(summary, "check", "calibrate")
    return _statement("Lights", level_of(sigma, DOUBT_BARS), text, reasons)


def _warned(summary: Summary, *steps: str) -> list[str]:
    """Return which of the steps warned, in words."""
    # What `check` says of the camera is a topic of its own.
    warned = {step for step, text in all_warnings(summary) if not (step == "check" and text.startswith("camera:"))}
    return [words("reasons")[step] for step in steps if step in warned]


def level_of(value: Any, bars: tuple[float, float], decimals: int = 2) -> str:
    """Return a value's level between two bars, as it is shown; unknown where it is none."""
    if not is_number(value):
        return "unknown"
    value = round(value, decimals)
    return "good" if value <= bars[0] else "care" if value <= bars[1] else "bad"


def ranking(summary: Summary) -> list[Summary]:
    """Return all methods as rows of a table, the smallest median error first; those without one last.

    A row has the method's part of the comparison and its errors on the photographs; name, family, doubts: why it says
    that it should not be believed; own_sigma: the median of its normals' sigma; level, a key of `page.LEVELS`: a method
    that leaves more than a tenth of the object unknown, or that doubts itself, is not called good (`reasons`); judged:
    with a tolerance pass or fail.
    """
    compared, rows = summary.get("compare") or {}, []
    tolerance, reasons = compared.get("tolerance") or {}, words("reasons")
    solved = (summary.get("solve") or {}).get("methods") or {}
    for name in by_error(compared):
        row = compared["methods"][name]
        kind = family(name)
        row = {**(row.get("real") or {}), **row, "name": name, "family": "" if kind == "calibrated" else kind}
        found = solved.get(name) or {}
        doubts = (str(text).removeprefix(f"{name}: ") for text in found.get("warnings") or ())
        # Without the quotes that stand for code on a terminal.
        row |= {"doubts": " ".join(doubts).replace("`", ""), "own_sigma": found.get("sigma_deg_median")}
        row["level"], row["judged"] = level_of(row.get("median_deg"), MEDIAN_BARS_DEG, 1), ""
        few = is_number(row.get("coverage")) and row["coverage"] < COVERAGE_BAR
        row["reasons"] = [reasons["few"]] * few + [reasons["doubts"]] * bool(row["doubts"])
        row["level"] = "care" if row["reasons"] and row["level"] == "good" else row["level"]
        if tolerance and row["level"] != "unknown":
            # The user's bar, not the habits of the trade: no page says "pass" and "do not rely on it".
            passes = (row.get("real_within_tolerance") or 0) >= tolerance["least_share"]
            row["level"], row["judged"] = ("good", "pass") if passes else ("bad", "fail")
        rows.append({**row, "badge": badge(row["level"], row["judged"])})
    return rows


def trust_sentence(trust: Summary) -> Markup:
    """Return which method explains the photographs best, which as well, which much worse, and why not to believe it."""
    left = {name: row["unexplained"] for name, row in trust["methods"].items() if is_number(row["unexplained"])}
    most = TRUST_WORSE * max(left[trust["recommended"]], 1e-9)
    named = {"level": ", ".join(trust["level"]), "worse": ", ".join(name for name in left if left[name] > most)}
    said = [say("trust", what, names=names) for what, names in named.items() if names]
    doubts = (escape(f" {doubt[0].upper()}{doubt[1:]}") for doubt in trust["doubts"])
    return say("trust", "best", **trust) + Markup("").join([*said, *doubts])
