"""The report's tables of errors (every method's, real against twin, ambiguities, between methods) and of seconds."""

from html import escape

from compare.report import page
from compare.report.facts import Summary, by_error
from compare.report.speed import speed_points
from compare.statistics.statistics import statistics_rows
from draw.speed_chart import speed_chart


def statistics_section(compared: Summary) -> str:
    """Return the tables of angular errors, of how alike real and twin fail, and of how far methods are apart."""
    methods = compared.get("methods") or {}
    methods = {name: methods[name] for name in by_error(compared)}
    if rows := statistics_rows({"methods": methods}):
        body = page.table_of("errors", rows, caption=page.say("statistics", "errors"))
        body += _correlations(methods) + _four_ways(methods)
    elif compared.get("has_truth"):
        body = page.absent("There is ground truth, but no method's normals share a pixel with it.")
    else:
        body = page.absent(page.words("statistics")["no truth"])
    return page.section("statistics", "Statistics", body + _between_methods(compared, list(methods)))


def _correlations(methods: Summary) -> str:
    rows = [{"name": name, **row} for name, row in methods.items() if row.get("real") and row.get("twin")]
    if not rows:
        return page.absent("No twin: whether a rendering fails like the object cannot be told.")
    return page.table_of("correlations", rows, caption=page.say("statistics", "turn"))


def _four_ways(methods: Summary) -> str:
    """Return what is left of the errors of ambiguous results once their ambiguity is settled by the truth."""
    rows = [
        {"name": name, "kind": kind, **ways, "sign": "inside out" if ways.get("mirrored") else "right"}
        for name, row in methods.items()
        for kind in ("real", "twin")
        if (ways := row.get(f"{kind}_four_ways"))
    ]
    if not rows:
        return ""
    return page.table_of("four ways", rows, caption=page.say("statistics", "four ways")) + page.definitions(
        page.words("four_ways").items()
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
        if not page.is_number(value):
            return "–"
        return f'<span class="heat" style="--share: {value / most:.3f}">{page.number(value, 1)}</span>'

    rows = [(escape(a), *(cell(a, b) for b in there)) for a in there]
    lead = page.say("statistics", "apart")
    square = page.table(("method", *(f"<span>{escape(name)}</span>" for name in there)), rows, kind="square")
    square = f'<h3>How far the methods are apart</h3><p class="lead">{lead}</p>{square}'
    return square + page.folded("All statistics of each two methods", page.table_of("pairs", pairs))


def time_section(summary: Summary) -> str:
    """Return the time-against-error chart, what it could not show, and its numbers."""
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    if not solved:
        return page.section("time", "Speed against accuracy", page.absent("No method's time is in the summary."))
    points, missing = speed_points(summary)
    reasons: dict[str, list[str]] = {}
    for method, reason in missing:
        reasons.setdefault(reason, []).append(method)
    chart = f'<figure class="speed">{speed_chart(points)}</figure>' if points else ""
    chart += "".join(
        page.absent(f"Not in the chart: {', '.join(names)}: {reason}.") for reason, names in reasons.items()
    )
    errors = compared.get("methods") or {}
    rows = []
    for name in dict.fromkeys([*(name for name in by_error(compared) if name in solved), *solved]):
        row, error = solved[name] or {}, errors.get(name) or {}
        maybe = {kind: (error.get(kind) or {}).get("median_deg") for kind in ("real", "twin")}
        maybe["twin_processor_seconds"] = row.get("twin_processor_seconds")
        shown = {key: value if page.is_number(value) else "–" for key, value in maybe.items()}
        options = ", ".join(f"{key} {page.as_text(value)}" for key, value in (row.get("settings") or {}).items())
        rows.append({**row, **shown, "name": name, "options": options or "–"})
    body = chart + page.table_of("seconds", rows)
    body += page.folded("The settings they ran with", page.table_of("settings", rows, kind="plain"))
    lead = page.say("statistics", "seconds") + (page.say("statistics", "steps") if points else "")
    return page.section("time", "Speed against accuracy", body, lead)
