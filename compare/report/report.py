"""One self-contained page: what the cameras saw, what was computed of it, and how far it can be trusted."""

from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from compare.report import page
from compare.report.facts import Material, Summary, all_warnings, by_error, doubts_of, family
from compare.report.layers import Layers
from compare.report.pictures import legend_ball
from compare.report.report_figures import ball_figures, glance, placed
from compare.report.speed import speed_points
from compare.report.verdict import limits, ranking_table, tiles, trust_sentence, verdict
from compare.report.viewer import SCRIPTS, viewer_facts
from compare.statistics.statistics import statistics_rows
from draw import light_charts
from draw.line_chart import line_chart
from draw.object_charts import error_histograms
from draw.speed_chart import speed_chart
from scene.files import write_text
from scene.store import Store

CHAPTERS = {
    "Verdict": "verdict", "Viewer": "viewer", "Why": "why", "Warnings": "warned", "Photographs": "frames",
    "Balls": "balls", "Lights": "lights", "Registration": "registration", "Normals": "normals",
    "Which normals": "trusted", "Twin": "twinned", "Errors": "errors", "Statistics": "statistics", "Speed": "time",
    "Known truth": "checked", "Provenance": "provenance", "How to read": "reading",
}  # fmt: skip
"""The sections of report.html by their names in the row of links; all but the first two are folded."""
ELSEWHERE = ("warnings", "material", "held_out")
"""Parts of the summary that other sections tell."""
TILES_TELL = ("Lights", "Ground truth", "Twin")


def write_report(store: Store, summary: dict[str, Any]) -> Path:
    """Write report.html: charts, pictures and text in one file that fetches nothing.

    Parameters
    ----------
    store : Store
        The output folder; pictures come from what is in it.
    summary : dict
        What goes to summary.json: name, created, versions, arguments, seconds, warnings, capture, camera, calibrate,
        align, solve, twin, compare (of `compare.compare.compare`), truth_check. Any of them may be missing:
        the page then says what is absent and why.

    Returns
    -------
    Path
        The page. Its policy forbids the browser to load anything from outside it.
    """
    material = Material.load(store, summary)
    layers = Layers.of(material, summary)
    compared = summary.get("compare") or {}
    # The methods are ranked by the truth; without one the photographs may have recommended a method.
    recommended = None if compared.get("has_truth") else (summary.get("trust") or {}).get("recommended")
    best = recommended or next(iter(material.methods), None)
    facts = _verdict_facts(summary, best) | _table_facts(summary, compared) | _provenance(summary)
    facts |= viewer_facts(material, layers, best) | ball_figures(material)
    facts |= {name: summary.get(name) or {} for name in ("capture", "twin", "compare", "trust", "truth_check")}
    facts |= {"material": material, "layers": layers, "glance": glance(material, layers, compared, best)}
    facts |= {"placed": placed(material), "ranking": ranking_table(summary), "charts": light_charts}
    facts |= {"legend_ball": legend_ball, "error_histograms": error_histograms, "speed_chart": speed_chart}
    lights = (material.lights or {}).get("frames") or []
    facts["light_rows"] = [
        {
            **row,
            "number": str(index),
            "distance": page.say("lights", "distance", **row) if row.get("distance_mm") else "–",
            "flags": "; ".join(row.get("flags") or []) or "–",
        }
        for index, row in enumerate(lights, 1)
    ]
    listed = {row.get("name"): row for row in facts["capture"].get("frames_table") or []}
    names = material.frames.names if material.frames is not None else ()
    facts["frame_rows"] = [
        {"number": str(index), "name": name, **(listed.get(name) or {})} for index, name in enumerate(names, 1)
    ]
    module = page.template("report.html").make_module(facts)
    sections = {words: str(getattr(module, name)()).strip() for words, name in CHAPTERS.items()}
    chapters = {
        words: html if words in ("Verdict", "Viewer") else page.folded_section(html)
        for words, html in sections.items()
        if html
    }
    name = str(summary.get("name") or store.folder.resolve().name)
    script = "\n".join((page.HERE / part).read_text("utf-8") for part in SCRIPTS)
    script = f'"use strict";\n(() => {{\n{script}\n}})();'
    html = page.whole_page(name, "Photometric stereo report", _subtitle(summary, compared), chapters, script=script)
    write_text(store.path("report.html"), html)
    return store.path("report.html")


def _subtitle(summary: Summary, compared: Summary) -> str:
    capture, version = summary.get("capture") or {}, (summary.get("versions") or {}).get("rgbn")
    parts = []
    if page.is_number(capture.get("frames")):
        parts.append(f"{page.number(capture['frames'])} flash photographs")
    if page.is_number(capture.get("width")) and page.is_number(capture.get("height")):
        parts.append(f"{page.number(capture['width'])} × {page.number(capture['height'])} px")
    methods = ", ".join(compared.get("methods") or ())
    told = (f"methods {methods}" if methods else "", summary.get("created"), f"rgbn {version}" if version else "")
    return " · ".join([*parts, *(escape(str(one)) for one in told if one)])


def _verdict_facts(summary: Summary, best: str | None) -> Summary:
    statements, warnings = verdict(summary), all_warnings(summary)
    marked = [one for one in statements[1:] if one.level in ("care", "bad") and one.topic not in TILES_TELL]
    return {
        "statements": statements, "levels": page.LEVELS, "warnings": warnings, "marked": marked,
        "limits": limits(summary, statements[1:], warnings), "tiles": tiles(summary, statements, best),
        "trust_sentence": trust_sentence,
    }  # fmt: skip


def _table_facts(summary: Summary, compared: Summary) -> Summary:
    """Return the rows of the tables of errors and of seconds, and what the chart of speed could not show."""
    solved, every = (summary.get("solve") or {}).get("methods") or {}, compared.get("methods") or {}
    methods = {name: every[name] for name in by_error(compared)}
    four_ways = [
        {"name": name, "kind": kind, **ways, "sign": "inside out" if ways.get("mirrored") else "right"}
        for name, row in methods.items()
        for kind in ("real", "twin")
        if (ways := row.get(f"{kind}_four_ways"))
    ]
    points, missing = speed_points(summary)
    uncharted: dict[str, list[str]] = {}
    for method, reason in missing:
        uncharted.setdefault(reason, []).append(method)
    second_rows = []
    for name in dict.fromkeys([*(name for name in methods if name in solved), *solved]):
        row, error = solved[name] or {}, methods.get(name) or {}
        maybe = {kind: (error.get(kind) or {}).get("median_deg") for kind in ("real", "twin")}
        maybe["twin_processor_seconds"] = row.get("twin_processor_seconds")
        shown = {key: value if page.is_number(value) else "–" for key, value in maybe.items()}
        options = ", ".join(f"{key} {page.as_text(value)}" for key, value in (row.get("settings") or {}).items())
        second_rows.append({**row, **shown, "name": name, "options": options or "–"})
    trusted = (summary.get("trust") or {}).get("methods") or {}
    align = summary.get("align") or compared.get("pose") or {}
    values = {**(align.get("fit") or {}), **align}
    return {
        "names": list(methods), "methods": methods, "solved": solved, "four_ways": four_ways, "points": points,
        "doubts": {name: doubts_of(summary, name) for name in methods},
        "uncharted": uncharted, "second_rows": second_rows, "statistics_rows": statistics_rows({"methods": methods}),
        "both_rows": [{"name": name, **row} for name, row in methods.items() if row.get("real") and row.get("twin")],
        "square": _square(compared.get("between_methods") or [], list(methods)),
        "trust_rows": [{"name": name, **row} for name, row in trusted.items()],
        "misfit_chart": _misfit_chart,
        "registration_rows": [
            (what, page.Sentence().format(text, values[key]))
            for what, key, text in page.words("tables")["registration"]
            if page.is_number(values.get(key))
        ],
    }  # fmt: skip


def _square(pairs: list[Summary], names: list[str]) -> list[list[str]]:
    """Return how far each two methods are apart, medians, as a square with its head."""
    medians = {frozenset((pair["a"], pair["b"])): pair["median_deg"] for pair in pairs}
    there = [name for name in names if any(name in pair for pair in medians)]
    most = max(medians.values(), default=0) or 1.0

    def cell(a: str, b: str) -> str:
        value = medians.get(frozenset((a, b))) if a != b else None
        if not page.is_number(value):
            return "–"
        return f'<span class="heat" style="--share: {value / most:.3f}">{page.number(value, 1)}</span>'

    head = ["method", *(f"<span>{escape(name)}</span>" for name in there)]
    return [head, *([str(escape(a)), *(cell(a, b) for b in there)] for a in there)]


def _misfit_chart(shares: list[Any]) -> str:
    values = [100 * value if page.is_number(value) else float("nan") for value in shares]
    lights = [float(k + 1) for k in range(len(values))]
    return line_chart({"a frame": (lights, values)}, x_title="light", y_title="not explained, % (rms)")


def _provenance(summary: Summary) -> Summary:
    """Return what is needed to get the numbers again, the known truth, and what the page's words mean."""
    spent, compared = summary.get("processor_seconds") or {}, summary.get("compare") or {}
    settings = {
        key: [{"name": str(name), "value": page.as_text(value)} for name, value in (summary.get(key) or {}).items()
              if name not in ELSEWHERE]
        for key in ("versions", "arguments", "camera", "twin")
    }  # fmt: skip
    names = by_error(compared)
    families, known = {family(name) for name in names}, page.words("methods")
    return {
        "seconds": summary.get("seconds"), "settings": settings if any(settings.values()) else {},
        "spent_rows": [
            {"step": str(step), "processor": spent.get(step), "wall": wall}
            for step, wall in (summary.get("seconds") or {}).items()
        ],
        "evidence": [
            (step, str(text))
            for step in ("calibrate", "align")
            for text in (summary.get(step) or {}).get("evidence") or ()
        ],
        "check_rows": [_checked(label, row) for label, row in (summary.get("truth_check") or {}).items()],
        "terms": [
            *page.words("how_to_read").items(),
            *((f"{word.capitalize()} method", page.words("families")[word]) for word in sorted(families)),
            *((name, known[name].replace("`", "")) for name in names if name in known),
        ],
    }  # fmt: skip


def _checked(label: str, row: Summary) -> tuple[str, ...]:
    """Return a figure of the known truth: what it is, what was found, its bar and whether it is kept."""
    value, bar, unit = row.get("value"), row.get("bar"), str(row.get("unit") or "")
    unit = {"degrees": "°"}.get(unit, unit)
    name = escape(str(row.get("text") or label).replace("`", ""))
    if not page.is_number(bar):
        return name, page.number(value, 3, unit), "", ""
    mark = "" if not page.is_number(value) else "within" if value <= bar else Markup("<b>over</b>")
    return name, page.number(value, 3, unit), page.round_number(bar, unit), mark
