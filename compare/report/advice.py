"""What makes the error, and the one thing to do next: the cases, whose sentences stand in report_words.toml."""

from markupsafe import Markup

from compare.report.doubts import HELPFUL, explains, is_its_own_doing
from compare.report.facts import Summary, best_method
from compare.report.page import say
from compare.report.verdict import Statement, is_truths_own


def limits(summary: Summary, statements: list[Statement]) -> Markup:
    """Return what makes the error, as far as twin, ground truth and lights tell, or why that is not known."""
    compared, level = summary.get("compare") or {}, {one.topic: one.level for one in statements}
    if not compared.get("has_truth"):
        return say("limits", "without truth")
    # What is doubtful besides bears on what a twin proves: it is rendered under the lights as they were measured.
    doubtful, tilted = level.get("Lights") in ("care", "bad"), "Common tilt" in level
    alike = level.get("Twin") == "good"
    poor = level.get("Ground truth") == "bad" and explains("Ground truth", summary)
    is_its_own = is_its_own_doing(summary) and not alike
    material = (summary.get("twin") or {}).get("material") or {}
    is_metal = material.get("model") == "metal"
    cases = {
        "Common tilt": tilted,
        "Twin good": alike and not doubtful and not tilted,
        "Twin good, lights doubtful": alike and doubtful and not tilted,
        "Twin good, tilted": alike and tilted,
        "Metal": is_its_own and is_metal,
        "Object": is_its_own and not is_metal,
        "Twin care": level.get("Twin") == "care" and not is_its_own,
        "Twin bad": level.get("Twin") == "bad" and not is_its_own,
        "Lights": doubtful and explains("Lights", summary) and (tilted or not alike),
        "Ground truth bad": poor,
        "Ground truth own": not poor and is_truths_own(compared),
    }
    named = [name for name, is_so in cases.items() if is_so] or ["not told"]
    return Markup(" ").join(say("limits", name, **(compared.get("truth") or {}), **material) for name in named)


def advice(summary: Summary, statements: list[Statement]) -> Markup:
    """Return the one thing to do next."""
    compared, first, level = summary.get("compare") or {}, statements[0], {one.topic: one.level for one in statements}
    name, trust = best_method(summary), summary.get("trust")
    file = f"results/normals_{name}.tif"
    where = file if file in ((summary.get("results") or {}).get("files") or ()) else f"normals/{name}.npy"
    marked = {topic for topic in ("Lights", "Ground truth") if level.get(topic) in ("care", "bad")}
    large = {topic for topic in marked if explains(topic, summary)}
    if first.level != "unknown":
        causes = {
            "own": bool(first.reasons) and first.level == "care",
            "Common tilt": "Common tilt" in level,
            "Ground truth": level.get("Ground truth") == "bad" and "Ground truth" in large,
            "Twin": level.get("Twin") == "good",
            "Lights": "Lights" in large,
            "truth": "Ground truth" in large,
            "Object": is_its_own_doing(summary),
            "small": bool(marked),
            "methods": True,
        }
        cause = next(cause for cause, is_so in causes.items() if is_so)
        untried = ",".join(one for one in HELPFUL.get(cause, ()) if one not in (compared.get("methods") or {}))
        told = {"reasons": " and ".join(first.reasons), "untried": untried}
        look = say("look", f"{cause} untried" if untried else cause, **told)
        # Nothing is left to be found.
        known = ", object" if first.level == "bad" and not first.judged and cause == "Object" else ""
        use = say("advice", (first.judged or first.level) + known, name=name, where=where)
        return use if first.level == "good" else Markup("{} {}").format(use, look)
    cases = {
        "no methods": not compared.get("methods"),
        "no lights": level.get("Lights") == "bad",
        "unjudged": bool(compared.get("has_truth")),
        "untold": not trust and "trust" in (summary.get("seconds") or {}),
        "unknown": not trust,
        "disbelieved, object": is_its_own_doing(summary),
        "disbelieved, small": bool(trust and trust["doubts"]) and not explains("Lights", summary),
        "disbelieved": bool(trust and trust["doubts"]),
        "recommended": True,
    }
    return say("advice", next(case for case, is_so in cases.items() if is_so), name=name, where=where)
