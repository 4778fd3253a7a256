"""What makes the error, and the one thing to do next: the cases, whose sentences stand in report_words.toml."""

from markupsafe import Markup

from compare.report.facts import Summary, best_method
from compare.report.page import say
from compare.report.verdict import Statement, is_its_own


def limits(summary: Summary, statements: list[Statement]) -> Markup:
    """Return what makes the error, as far as twin, ground truth and lights tell, or why that is not known."""
    compared, level = summary.get("compare") or {}, {one.topic: one.level for one in statements}
    truth = compared.get("truth") or {}
    if not compared.get("has_truth"):
        return say("limits", "without truth")
    # What is doubtful besides bears on what a twin proves: it is rendered under the lights as they were measured.
    doubtful, tilted = level.get("Lights") in ("care", "bad"), "Common tilt" in level
    alike, poor = level.get("Twin") == "good", level.get("Ground truth") == "bad"
    measured = [row["real"]["median_deg"] for row in (compared.get("methods") or {}).values() if row.get("real")]
    measured += [compared["tolerance"]["deg"]] if compared.get("tolerance") else []
    cases = {
        "Common tilt": tilted,
        "Twin good": alike and not doubtful and not tilted,
        "Twin good, lights doubtful": alike and doubtful and not tilted,
        "Twin good, tilted": alike and tilted,
        "Twin care": level.get("Twin") == "care",
        "Twin bad": level.get("Twin") == "bad",
        "Lights": doubtful and (tilted or not alike),
        "Ground truth bad": poor,
        "Ground truth own": not poor and is_its_own(truth.get("sigma_deg_median"), measured),
    }
    named = [name for name, is_so in cases.items() if is_so] or ["not told"]
    return Markup(" ").join(say("limits", name, **truth) for name in named)


def advice(summary: Summary, statements: list[Statement]) -> Markup:
    """Return the one thing to do next."""
    compared, first, level = summary.get("compare") or {}, statements[0], {one.topic: one.level for one in statements}
    name, trust = best_method(summary), summary.get("trust")
    file = f"results/normals_{name}.tif"
    where = file if file in ((summary.get("results") or {}).get("files") or ()) else f"normals/{name}.npy"
    marked = ("care", "bad")
    if first.level != "unknown":
        use = say("advice", first.judged or first.level, name=name, where=where)
        causes = {
            "own": bool(first.reasons) and first.level == "care",
            "Common tilt": "Common tilt" in level,
            "Ground truth": level.get("Ground truth") == "bad",
            "Twin": level.get("Twin") == "good",
            "Lights": level.get("Lights") in marked,
            "truth": level.get("Ground truth") in marked,
            "methods": True,
        }
        look = next(say("look", cause, reasons=" and ".join(first.reasons)) for cause, is_so in causes.items() if is_so)
        return use if first.level == "good" else Markup("{} {}").format(use, look)
    cases = {
        "no methods": not compared.get("methods"),
        "no lights": level.get("Lights") == "bad",
        "unjudged": bool(compared.get("has_truth")),
        "untold": not trust and "trust" in (summary.get("seconds") or {}),
        "unknown": not trust,
        "disbelieved": bool(trust and trust["doubts"]),
        "recommended": True,
    }
    return say("advice", next(case for case, is_so in cases.items() if is_so), name=name, where=where)
