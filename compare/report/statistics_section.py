"""The report's tables of errors: every method's, real against twin, ambiguities, and how methods differ."""

from html import escape
from typing import Any

from compare.report.facts import by_error
from compare.report.page import absent, is_number, number, percent, section, table

Summary = dict[str, Any]

FOUR_WAYS = (
    (
        "raw",
        "as the method gives it, with its own sign. Only this compares with other methods; the tables above hold it.",
    ),
    ("best sign", "convex or concave, whichever the truth says: both give the same pictures under unknown lights."),
    (
        "oracle relief",
        "after the generalised bas-relief transform (GBR, three numbers) that suits the truth best: what a perfect "
        "choice among the surfaces that the pictures leave open would reach.",
    ),
    (
        "oracle linear",
        "after the 3 × 3 matrix that suits the truth best: what is left is no ambiguity's fault, but that of shadows, "
        "gloss and noise.",
    ),
)


def statistics_section(compared: Summary) -> str:
    """Return the table of angular errors, and that of how alike real and twin fail."""
    methods = compared.get("methods") or {}
    rows, names = [], by_error(compared)
    for name in names:
        row = methods[name]
        for kind in ("real", "twin"):
            if not (found := row.get(kind)):
                continue
            degrees = [
                number(found.get(f"{key}_deg"), 2) for key in ("min", "max", "mean", "median", "std", "q1", "q3")
            ]
            shares = [percent(found.get("under_5_deg"), 1), percent(found.get("under_10_deg"), 1)]
            covered = percent(row.get("coverage" if kind == "real" else "twin_coverage"), 1)
            rows.append((f"{escape(name)} <small>{kind}</small>", *degrees, *shares, number(found["pixels"]), covered))
    body = ""
    if rows:
        head = (
            "method",
            "min",
            "max",
            "mean",
            "median",
            "std",
            "Q1",
            "Q3",
            "&lt; 5°",
            "&lt; 10°",
            "pixels",
            "answered",
        )
        caption = "Angular error against the ground truth, degrees; “answered”: share of the true pixels."
        body += table(head, rows, caption=caption, kind="numbers")
        body += _correlations({name: methods[name] for name in names}) + _four_ways(methods, names)
    elif compared.get("has_truth"):
        body += absent("There is ground truth, but no method's normals share a pixel with it.")
    else:
        body += absent(
            "No ground truth: without a scan or given normals there is no error to count. What follows compares "
            "methods with each other, which tells where they disagree, not which is right."
        )
    body += _between_methods(compared, names)
    return section("statistics", "Statistics", body)


def _correlations(methods: Summary) -> str:
    rows = [
        (
            escape(name),
            number(row.get("pearson"), 3),
            number(row.get("spearman"), 3),
            number(row.get("median_difference_deg"), 2),
            number(row.get("correlation_pixels")),
            number(row.get("real_rotation_deg"), 2),
            number(row.get("real_median_unrotated_deg"), 2),
            number(row.get("twin_rotation_deg"), 2),
            number(row.get("twin_median_unrotated_deg"), 2),
        )
        for name, row in methods.items()
        if row.get("real") and row.get("twin")
    ]
    if not rows:
        return absent("No twin: whether a rendering fails like the object cannot be told.")
    head = (
        "method",
        "Pearson",
        "Spearman",
        "median real − twin, °",
        "pixels in both",
        "common turn real, °",
        "median without it, °",
        "common turn twin, °",
        "median without it, °",
    )
    return table(head, rows, caption="Do real and twin fail alike, and how much is one common turn?", kind="numbers")


def _four_ways(methods: Summary, names: list[str]) -> str:
    """Return what is left of the errors of ambiguous results once their ambiguity is settled by the truth."""
    rows = []
    for name in names:
        for kind in ("real", "twin"):
            if ways := methods[name].get(f"{kind}_four_ways"):
                keys = ("raw_deg", "best_sign_deg", "oracle_relief_deg", "oracle_linear_deg")
                sign = "inside out" if ways.get("mirrored") else "right"
                errors = [number(ways.get(key), 2) for key in keys]
                rows.append((f"{escape(name)} <small>{kind}</small>", *errors, sign))
    if not rows:
        return ""
    caption = (
        "What their ambiguity costs the methods that are not told the lights' directions, that factor all samples as "
        "one matrix (rpca), or that are other programs: mean angular error, degrees, four ways. No angle is folded."
    )
    listed = table(("method", *(words for words, _ in FOUR_WAYS), "sign"), rows, caption=caption, kind="numbers")
    return listed + "<dl>" + "".join(f"<dt>{words}</dt><dd>{text}</dd>" for words, text in FOUR_WAYS) + "</dl>"


def _between_methods(compared: Summary, names: list[str]) -> str:
    """Return how far each two methods are apart: medians as a square, all statistics folded away."""
    pairs = compared.get("between_methods") or []
    if not pairs:
        return ""
    medians = {frozenset((pair["a"], pair["b"])): pair["median_deg"] for pair in pairs}
    there = [name for name in names if any(name in pair for pair in medians)]
    most = max(medians.values()) or 1.0

    def cell(a: str, b: str) -> str:
        value = medians.get(frozenset((a, b))) if a != b else None
        if not is_number(value):
            return "–"
        return f'<span class="heat" style="--share: {value / most:.3f}">{number(value, 1)}</span>'

    rows = [(escape(a), *(cell(a, b) for b in there)) for a in there]
    lead = (
        "Median angle between two methods' normals on the photographs, degrees; the darker, the farther apart. It "
        "tells where methods disagree, not which is right."
    )
    square = table(("", *(f"<span>{escape(name)}</span>" for name in there)), rows, kind="square")
    lines = [
        (
            f"{escape(p['a'])} – {escape(p['b'])}",
            *(number(p.get(f"{key}_deg"), 2) for key in ("mean", "median", "q1", "q3", "max")),
            number(p["pixels"]),
        )
        for p in pairs
    ]
    listed = table(("methods", "mean", "median", "Q1", "Q3", "max", "pixels"), lines, kind="numbers")
    square = f'<h3>How far the methods are apart</h3><p class="lead">{lead}</p>{square}'
    return f"{square}<details><summary>All statistics of each two methods</summary>{listed}</details>"
