"""One self-contained page: what the cameras saw, what was computed of it, and how far it can be trusted."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from compare.report import page
from compare.report.advice import advice, limits
from compare.report.facts import Material, Summary, all_warnings, best_method, by_error, family, speed_points
from compare.report.layers import ViewerLayers, viewer_facts
from compare.report.paper import write_paper
from compare.report.pictures import legend_ball
from compare.report.registration_pictures import ball_figures, placed
from compare.report.verdict import ranking, trust_sentence, verdict
from compare.statistics.statistics import statistics_rows
from draw import light_charts
from draw.line_chart import line_chart
from draw.object_charts import error_histograms
from draw.readable import is_number
from draw.speed_chart import speed_chart
from draw.svg import Drawing
from scene.files import write_text
from scene.map_pictures import data_uri
from scene.store import Store

SCRIPTS = ("report_page.js", "viewer_values.js", "viewer_pixel.js", "viewer_scene.js", "viewer.js")
"""The page's program in parts, each reading none that follows it."""
ELSEWHERE = ("warnings", "material", "held_out")
"""Parts of the summary that other sections tell."""


def write_report(store: Store, summary: dict[str, Any], digests: Mapping[str, str | None] | None = None) -> Path:
    """Write report.html: charts, pictures and text in one file that fetches nothing.

    Parameters
    ----------
    store : Store
        The output folder; pictures come from what is in it.
    summary : dict
        What goes to summary.json: name, created, versions, arguments, seconds, warnings, capture, camera, calibrate,
        align, solve, twin, compare (of `compare.compare.compare`), truth_check. Any of them may be missing:
        the page then says what is absent and why.
    digests : mapping of str to str or None, optional
        SHA-256 of the session's files by name, None of one that is not there: with them report.pdf is written, too.

    Returns
    -------
    Path
        The page. Its policy forbids the browser to load anything from outside it.
    """
    material = Material(store, summary)
    layers = ViewerLayers.of(material, summary)
    compared = summary.get("compare") or {}
    best = best_method(summary) or next(iter(material.methods), None)
    statements, ranked = verdict(summary), ranking(summary)
    of_errors = "ranking by tolerance" if compared.get("tolerance") else "ranking"
    facts = {
        **summary, **_rows(summary), **viewer_facts(material, layers, best), **ball_figures(material),
        "compare": compared, "material": material, "layers": layers, "placed": placed(material), "best": best,
        "statements": statements, "topics": {one.topic: one for one in statements}, "warnings": all_warnings(summary),
        "limits": limits(summary, statements), "advice": advice(summary, statements), "ranking": ranked,
        "ranking_table": of_errors if any(row.get("real") for row in ranked) else "without truth",
        "terms": _terms(by_error(compared)), "charts": light_charts, "error_histograms": error_histograms,
        "speed_chart": speed_chart, "misfit_chart": _misfit_chart, "legend_ball": legend_ball, "data_uri": data_uri,
        "trust_sentence": trust_sentence,
    }  # fmt: skip
    module = page.environment().get_template("report.html").make_module(facts)
    name = str(summary.get("name") or store.folder.resolve().name)
    script = "\n".join((page.HERE / part).read_text("utf-8") for part in SCRIPTS)
    script = f'"use strict";\n(() => {{\n{script}\n}})();'
    versions, made = summary.get("versions") or {}, str(summary.get("created") or "")[:16].replace("T", " ")
    told = {"methods": ", ".join(compared.get("methods") or ()) or None, "created": made or None, **(versions or {})}
    subtitle = page.say("page", "subtitle", **{**(summary.get("capture") or {}), **told}).removeprefix(" · ")
    html = page.whole_page(name, "Photometric stereo report", subtitle, str(module), script=script)
    write_text(store.path("report.html"), html)
    if digests is not None:
        write_paper(store, name, subtitle, facts, digests)
    return store.path("report.html")


def _rows(summary: Summary) -> Summary:
    """Return the rows of the tables, and what the chart of speed could not show."""
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    methods = {name: compared["methods"][name] for name in by_error(compared)}
    points = speed_points(summary)
    charted = {point.method for point in points if point.kind == "real"}
    lost = [name for name in dict.fromkeys([*solved, *methods]) if name not in charted]
    # Keys of the words of `statistics`.
    reasons = {name: "no time" if (methods.get(name) or {}).get("real") else "no normals" for name in lost}
    reasons = reasons if compared.get("has_truth") else dict.fromkeys(lost, "no error")
    align = summary.get("align") or compared.get("pose") or {}
    align = {**(align.get("fit") or {}), **align}
    spent = summary.get("processor_seconds") or {}
    return {
        "methods": methods, "points": points, "statistics_rows": statistics_rows({"methods": methods}),
        "uncharted": {why: [name for name in lost if reasons[name] == why] for why in dict.fromkeys(reasons.values())},
        "both_rows": {name: row for name, row in methods.items() if row.get("real") and row.get("twin")},
        "four_ways": [
            {"name": name, "kind": kind, **ways, "sign": "inside out" if ways.get("mirrored") else "right"}
            for name, row in methods.items()
            for kind in ("real", "twin")
            if (ways := row.get(f"{kind}_four_ways"))
        ],
        "second_rows": [
            {**(solved[name] or {}), "name": name, "error": methods.get(name) or {},
             "options": page.as_text((solved[name] or {}).get("settings") or {})}
            for name in dict.fromkeys([*(name for name in methods if name in solved), *solved])
        ],
        "registration_rows": [
            {"what": what, "found": found}
            for what in page.words("registered")
            if (found := page.say("registered", what, **align))
        ],
        "spent_rows": {
            step: {"processor": spent.get(step), "wall": wall} for step, wall in (summary.get("seconds") or {}).items()
        },
        "setting_rows": {
            part: {name: {"value": page.as_text(value)} for name, value in (summary.get(part) or {}).items()
                   if name not in ELSEWHERE}
            for part in ("versions", "arguments", "camera", "twin")
        },
        "truth_rows": [
            {**row, "text": str(row.get("text") or name).replace("`", ""), "verdict": _within(row)}
            for name, row in (summary.get("truth_check") or {}).items()
        ],
        **_square(compared.get("between_methods") or [], list(methods)),
    }  # fmt: skip


def _square(pairs: list[Summary], names: list[str]) -> Summary:
    """Return how far each two methods are apart: medians by both names, the largest, and the methods that have one."""
    medians = {key: pair["median_deg"] for pair in pairs for key in ((pair["a"], pair["b"]), (pair["b"], pair["a"]))}
    there = [name for name in names if any(name in key for key in medians)]
    return {"apart": medians, "most_apart": max(medians.values(), default=0) or 1.0, "apart_names": there}


def _within(row: Summary) -> Markup | None:
    """Return whether a value is as good as is asked for; None where that is not."""
    if not (is_number(row.get("bar")) and is_number(row.get("value"))):
        return None
    return Markup("within") if row["value"] <= row["bar"] else Markup("<b>over</b>")


def _misfit_chart(shares: list[Any]) -> Drawing:
    values = [100 * value if is_number(value) else float("nan") for value in shares]
    lights = [float(k + 1) for k in range(len(values))]
    return line_chart({"a frame": (lights, values)}, x_title="light", y_title="not explained, % (rms)")


def _terms(names: list[str]) -> list[tuple[str, str]]:
    """Return what the page's words mean, the families and the names of the methods that are there among them."""
    families, known = page.words("families"), page.words("methods")
    return [
        *page.words("how_to_read").items(),
        *((f"{word.capitalize()} method", families[word]) for word in sorted({family(name) for name in names})),
        *((name, known[name].replace("`", "")) for name in names if name in known),
    ]
