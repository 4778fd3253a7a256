"""What makes the error, and the one thing to do next: the cases, whose sentences stand in report_words.toml."""

from markupsafe import Markup

from compare.report.facts import Summary, best_method
from compare.report.page import say, words
from compare.report.verdict import Statement, is_its_own


def limits(summary: Summary, statements: list[Statement]) -> Markup:
    """Return what makes the error, as far as twin, ground truth and lights tell, or why that is not known."""
    compared, level = summary.get("compare") or {}, {one.topic: one.level for one in statements}
    truth, sentences = compared.get("truth") or {}, words("limits")
    if not compared.get("has_truth"):
        return say("limits", "without truth")
    # What is doubtful besides bears on what a twin proves: it is rendered under the lights as they were measured.
    doubtful, is_tilted = level.get("Lights") in ("care", "bad"), "Common tilt" in level
    twin = "Twin good, tilted" if is_tilted else "Twin good, lights doubtful" if doubtful else "Twin good"
    named = [twin if level.get("Twin") == "good" else f"Twin {level.get('Twin')}"]
    named += ["Lights"] if doubtful and twin not in named else []
    medians = [row["real"]["median_deg"] for row in (compared.get("methods") or {}).values() if row.get("real")]
    own = "bad" if level.get("Ground truth") == "bad" else "own"
    is_own = own == "bad" or is_its_own(truth.get("sigma_deg_median"), min(medians, default=None))
    named = ["Common tilt"] * is_tilted + named + [f"Ground truth {own}"] * is_own
    return Markup(" ").join(say("limits", name, **truth) for name in named if name in sentences) or say(
        "limits", "not told"
    )


def advice(summary: Summary, statements: list[Statement]) -> Markup:
    """Return the one thing to do next."""
    compared, first, level = summary.get("compare") or {}, statements[0], {one.topic: one.level for one in statements}
    name = best_method(summary)
    files = (summary.get("results") or {}).get("files") or ()
    where = next((file for file in files if file == f"results/normals_{name}.tif"), f"normals/{name}.npy")
    if first.level != "unknown":
        use = say("advice", first.judged or first.level, name=name, where=where)
        look = say("look", _cause(first, level), reasons=" and ".join(first.reasons))
        return use if first.level == "good" else Markup("{} {}").format(use, look)
    if not compared.get("methods"):
        return say("advice", "no methods")
    if level.get("Lights") == "bad":
        return say("advice", "no lights")
    if compared.get("has_truth"):
        return say("advice", "unjudged")
    trust = summary.get("trust")
    known = "unknown" if not trust else "disbelieved" if trust["doubts"] else "recommended"
    return say("advice", known, name=name, where=where)


def _cause(first: Statement, level: dict[str, str]) -> str:
    """Return where to look first for what makes the error; as `limits` has it."""
    marked = ("care", "bad")
    cases = {
        "own": bool(first.reasons),
        "Common tilt": "Common tilt" in level,
        "Ground truth": level.get("Ground truth") == "bad",
        "Twin": level.get("Twin") == "good",
        "Lights": level.get("Lights") in marked,
        "truth": level.get("Ground truth") in marked,
        "methods": True,
    }
    return next(name for name, is_so in cases.items() if is_so)
