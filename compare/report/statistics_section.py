"""The report's tables of errors (every method's, real against twin, ambiguities, between methods) and of seconds."""

from html import escape
from typing import Any

from compare.report.facts import by_error
from compare.report.page import absent, definitions, folded, is_number, number, say, section, table, table_of, words
from compare.report.sections import as_text
from compare.report.speed import speed_points
from compare.report.speed_chart import speed_chart

Summary = dict[str, Any]


def statistics_section(compared: Summary) -> str:
    """Return the tables of angular errors, of how alike real and twin fail, and of how far methods are apart."""
    methods = compared.get("methods") or {}
    methods = {name: methods[name] for name in by_error(compared)}
    rows = [
        {**found, "covered": row.get("coverage" if found["kind"] == "real" else "twin_coverage")}
        for row, found in _of_both(methods, "{}")
    ]
    if rows:
        body = table_of("errors", rows, caption=say("statistics", "errors"))
        body += _correlations(methods) + _four_ways(methods)
    elif compared.get("has_truth"):
        body = absent("There is ground truth, but no method's normals share a pixel with it.")
    else:
        body = absent(words("statistics")["no truth"])
    return section("statistics", "Statistics", body + _between_methods(compared, list(methods)))


def _of_both(methods: Summary, key: str) -> list[tuple[Summary, Summary]]:
    """Return (its row, what the row has under the key, with its name and kind) of methods that have it."""
    return [
        (row, {"name": name, "kind": kind, **found})
        for name, row in methods.items()
        for kind in ("real", "twin")
        if (found := row.get(key.format(kind)))
    ]


def _correlations(methods: Summary) -> str:
    rows = [{"name": name, **row} for name, row in methods.items() if row.get("real") and row.get("twin")]
    if not rows:
        return absent("No twin: whether a rendering fails like the object cannot be told.")
    return table_of("correlations", rows, caption=say("statistics", "turn"))


def _four_ways(methods: Summary) -> str:
    """Return what is left of the errors of ambiguous results once their ambiguity is settled by the truth."""
    rows = [
        {**ways, "sign": "inside out" if ways.get("mirrored") else "right"}
        for _, ways in _of_both(methods, "{}_four_ways")
    ]
    if not rows:
        return ""
    return table_of("four ways", rows, caption=say("statistics", "four ways")) + definitions(words("four_ways").items())


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
    square = f'<h3>How far the methods are apart</h3><p class="lead">{lead}</p>{square}'
    return square + folded("All statistics of each two methods", table_of("pairs", pairs))


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
    rows = []
    for name in dict.fromkeys([*(name for name in by_error(compared) if name in solved), *solved]):
        row, error = solved[name] or {}, errors.get(name) or {}
        maybe = {kind: (error.get(kind) or {}).get("median_deg") for kind in ("real", "twin")}
        maybe["twin_seconds"] = row.get("twin_seconds")
        shown = {key: value if is_number(value) else "–" for key, value in maybe.items()}
        options = ", ".join(f"{key} {as_text(value)}" for key, value in (row.get("settings") or {}).items())
        rows.append({**row, **shown, "name": name, "options": options or "–"})
    body = chart + table_of("seconds", rows)
    body += folded("The settings they ran with", table_of("settings", rows, kind="plain"))
    lead = say("statistics", "seconds") + (say("statistics", "steps") if points else "")
    return section("time", "Speed against accuracy", body, lead)
