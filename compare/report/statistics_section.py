"""The report's tables of errors (every method's, real against twin, ambiguities, between methods) and of seconds."""

from html import escape
from typing import Any

from compare.report.facts import by_error
from compare.report.page import (
    absent,
    definitions,
    folded,
    is_number,
    number,
    numbers,
    percent,
    say,
    section,
    table,
    words,
)
from compare.report.sections import as_text
from compare.report.speed import speed_points
from compare.report.speed_chart import speed_chart

Summary = dict[str, Any]


def statistics_section(compared: Summary) -> str:
    """Return the tables of angular errors, of how alike real and twin fail, and of how far methods are apart."""
    methods = compared.get("methods") or {}
    methods = {name: methods[name] for name in by_error(compared)}
    rows = []
    for name, kind, row, found in _of_both(methods, "{}"):
        degrees = numbers(found, (f"{key}_deg" for key in ("min", "max", "mean", "median", "std", "q1", "q3")))
        shares = [found.get("under_5_deg"), found.get("under_10_deg")]
        shares.append(row.get("coverage" if kind == "real" else "twin_coverage"))
        under_5, under_10, covered = (percent(share, 1) for share in shares)
        rows.append((name, *degrees, under_5, under_10, number(found["pixels"]), covered))
    if rows:
        head = ("min", "max", "mean", "median", "std", "Q1", "Q3", "&lt; 5°", "&lt; 10°", "pixels", "answered")
        body = table(("method", *head), rows, caption=say("statistics", "errors"), kind="numbers")
        body += _correlations(methods) + _four_ways(methods)
    elif compared.get("has_truth"):
        body = absent("There is ground truth, but no method's normals share a pixel with it.")
    else:
        body = absent(words("statistics")["no truth"])
    return section("statistics", "Statistics", body + _between_methods(compared, list(methods)))


def _of_both(methods: Summary, key: str) -> list[tuple[str, str, Summary, Summary]]:
    """Return (its name as HTML, real or twin, its row, what the row has under the key) of methods that have it."""
    return [
        (f"{escape(name)} <small>{kind}</small>", kind, row, found)
        for name, row in methods.items()
        for kind in ("real", "twin")
        if (found := row.get(key.format(kind)))
    ]


def _correlations(methods: Summary) -> str:
    columns = {
        "pearson": "Pearson",
        "spearman": "Spearman",
        "median_difference_deg": "median real − twin, °",
        "correlation_pixels": "pixels in both",
        "real_rotation_deg": "common turn real, °",
        "real_median_unrotated_deg": "median without it, °",
        "twin_rotation_deg": "common turn twin, °",
        "twin_median_unrotated_deg": "median without it, °",
    }
    rows = [
        (escape(name), *numbers(row, ("pearson", "spearman"), 3), *numbers(row, list(columns)[2:]))
        for name, row in methods.items()
        if row.get("real") and row.get("twin")
    ]
    if not rows:
        return absent("No twin: whether a rendering fails like the object cannot be told.")
    return table(("method", *columns.values()), rows, caption=say("statistics", "turn"), kind="numbers")


def _four_ways(methods: Summary) -> str:
    """Return what is left of the errors of ambiguous results once their ambiguity is settled by the truth."""
    ways_words = words("four_ways")
    keys = [f"{name.replace(' ', '_')}_deg" for name in ways_words]
    rows = [
        (name, *numbers(ways, keys), "inside out" if ways.get("mirrored") else "right")
        for name, _, _, ways in _of_both(methods, "{}_four_ways")
    ]
    if not rows:
        return ""
    caption = say("statistics", "four ways")
    return table(("method", *ways_words, "sign"), rows, caption=caption, kind="numbers") + definitions(
        ways_words.items()
    )


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
    lead = say("statistics", "apart")
    square = table(("", *(f"<span>{escape(name)}</span>" for name in there)), rows, kind="square")
    keys = ("mean_deg", "median_deg", "q1_deg", "q3_deg", "max_deg", "pixels")
    lines = [(f"{escape(pair['a'])} – {escape(pair['b'])}", *numbers(pair, keys)) for pair in pairs]
    listed = table(("methods", "mean", "median", "Q1", "Q3", "max", "pixels"), lines, kind="numbers")
    square = f'<h3>How far the methods are apart</h3><p class="lead">{lead}</p>{square}'
    return square + folded("All statistics of each two methods", listed)


def time_section(summary: Summary) -> str:
    """Return the time-against-error chart, what it could not show, and its numbers."""
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    if not solved:
        return section("time", "Speed against accuracy", absent("No method's time is in the summary."))
    points, missing = speed_points(summary)
    reasons: dict[str, list[str]] = {}
    for method, reason in missing:
        reasons.setdefault(reason, []).append(method)
    chart = f'<figure class="speed">{speed_chart(points)}</figure>' if points else ""
    chart += "".join(absent(f"Not in the chart: {', '.join(names)}: {reason}.") for reason, names in reasons.items())
    errors = compared.get("methods") or {}
    rows, settings = [], []
    for name in dict.fromkeys([*(name for name in by_error(compared) if name in solved), *solved]):
        row, error = solved[name] or {}, errors.get(name) or {}
        maybe = [row.get("twin_seconds"), *((error.get(kind) or {}).get("median_deg") for kind in ("real", "twin"))]
        cells = [number(row.get("seconds"), 2), number(row.get("seconds_per_megapixel_image"), 3)]
        rows.append((escape(name), *cells, *(number(value, 2) if is_number(value) else "–" for value in maybe)))
        options = ", ".join(f"{key} {as_text(value)}" for key, value in (row.get("settings") or {}).items())
        settings.append((escape(name), escape(options) or "–"))
    head = ("method", "seconds", "s per megapixel-image", "seconds, twin", "median error, °", "median error, twin, °")
    body = chart + table(head, rows, kind="numbers")
    body += folded("The settings they ran with", table(("method", "settings"), settings, kind="plain"))
    lead = say("statistics", "seconds") + (say("statistics", "steps") if points else "")
    return section("time", "Speed against accuracy", body, lead)
