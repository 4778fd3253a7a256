"""One self-contained page: what the cameras saw, what was computed of it, and how far it can be trusted."""

from html import escape
from pathlib import Path
from typing import Any

from compare.report import page
from compare.report.facts import Material, Summary, all_warnings, by_error, family
from compare.report.first_screen import first_screen, why_section
from compare.report.galleries import balls_section, frames_section, lights_section
from compare.report.layers import Layers
from compare.report.maps import errors_section, normals_section
from compare.report.registration_section import registration_section
from compare.report.statistics_section import statistics_section, time_section
from compare.report.trust_section import trust_section
from compare.report.twin_section import twin_section
from compare.report.verdict import ranking_table
from compare.report.viewer_section import script, viewer_section
from scene.files import write_text
from scene.store import Store

LONG = ("warnings", "material", "held_out")
"""Parts that other sections tell."""


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
    compared, warnings = summary.get("compare") or {}, all_warnings(summary)
    layers = Layers.of(material, summary)
    # The methods are ranked by the truth; without one the photographs may have recommended a method.
    recommended = None if compared.get("has_truth") else (summary.get("trust") or {}).get("recommended")
    best = recommended or next(iter(material.methods), None)
    folded = {
        "Why": why_section(summary),
        "Warnings": _warnings_section(warnings),
        "Photographs": frames_section(material, layers, summary),
        "Balls": balls_section(material),
        "Lights": lights_section(material),
        "Registration": registration_section(material, summary),
        "Normals": normals_section(material, layers, ranking_table(summary)),
        "Which normals": trust_section(summary),
        "Twin": twin_section(material, layers, summary),
        "Errors": errors_section(layers, summary),
        "Statistics": statistics_section(compared),
        "Speed": time_section(summary),
        "Known truth": _truth_check_section(summary),
        "Provenance": _provenance_section(summary),
        "How to read": _how_to_read_section(compared),
    }
    chapters = {
        "Verdict": first_screen(material, layers, summary, warnings, best),
        "Viewer": viewer_section(material, layers, best),
        **{words: page.folded_section(html) for words, html in folded.items() if html},
    }
    name = str(summary.get("name") or store.folder.resolve().name)
    kind, subtitle = "Photometric stereo report", _subtitle(summary, compared)
    write_text(store.path("report.html"), page.whole_page(name, kind, subtitle, chapters, script=script()))
    return store.path("report.html")


def _subtitle(summary: dict[str, Any], compared: dict[str, Any]) -> str:
    capture, parts = summary.get("capture") or {}, []
    if page.is_number(capture.get("frames")):
        parts.append(f"{page.number(capture['frames'])} flash photographs")
    if page.is_number(capture.get("width")) and page.is_number(capture.get("height")):
        parts.append(f"{page.number(capture['width'])} × {page.number(capture['height'])} px")
    if compared.get("methods"):
        parts.append("methods " + escape(", ".join(compared["methods"])))
    if summary.get("created"):
        parts.append(escape(str(summary["created"])))
    if version := (summary.get("versions") or {}).get("rgbn"):
        parts.append(f"rgbn {escape(str(version))}")
    return " · ".join(parts)


def _warnings_section(warnings: list[tuple[str, str]]) -> str:
    """Return all warnings, each with its step."""
    if not warnings:
        return page.section("warnings", "Warnings", "<p>None of the steps gave a warning.</p>")
    rows = "".join(f"<li><b>{escape(step or 'session')}</b> {escape(text)}</li>" for step, text in warnings)
    return page.section("warnings", "Warnings", f'<ul class="warnings">{rows}</ul>')


def _truth_check_section(summary: Summary) -> str:
    """Return known truth against what was found (the demo); nothing where none was supplied."""
    rows = []
    for label, row in (summary.get("truth_check") or {}).items():
        value, bar, unit = row.get("value"), row.get("bar"), str(row.get("unit") or "")
        unit = {"degrees": "°"}.get(unit, unit)
        mark = (
            "" if not (page.is_number(value) and page.is_number(bar)) else "within" if value <= bar else "<b>over</b>"
        )
        name = escape(str(row.get("text") or label)).replace("`", "")
        rows.append(
            (name, page.number(value, 3, unit), page.round_number(bar, unit) if page.is_number(bar) else "", mark)
        )
    if not rows:
        return ""
    columns = 4 if any(mark for *_, mark in rows) else 2
    lead = "This session's truth is known from elsewhere; none of the steps was given it."
    found = page.table(("quantity", "found", "bar", "verdict")[:columns], [row[:columns] for row in rows])
    return page.section("truth-check", "Against the known truth", found, lead)


def _provenance_section(summary: Summary) -> str:
    """Return versions, arguments, camera, rendering and seconds: what is needed to get these numbers again."""
    parts = []
    if seconds := summary.get("seconds"):
        spent = summary.get("processor_seconds") or {}
        rows = [
            (escape(str(step)), *(page.number(value, 1, "s") for value in (spent.get(step), wall)))
            for step, wall in seconds.items()
        ]
        parts.append(page.table(("step", "processor", "wall"), rows, caption="Seconds per step"))
    for key in ("versions", "arguments", "camera", "twin"):
        values = {name: value for name, value in (summary.get(key) or {}).items() if name not in LONG}
        if values:
            rows = [(escape(str(name)), escape(page.as_text(value))) for name, value in values.items()]
            parts.append(page.table(("name", "value"), rows, caption=key.capitalize(), kind="plain"))
    notes = "".join(
        f"<li><b>{escape(step)}</b> {escape(str(text))}</li>"
        for step in ("calibrate", "align")
        for text in (summary.get(step) or {}).get("evidence") or ()
    )
    notes = f"<h3>What the steps decided, and on what evidence</h3><ul>{notes}</ul>" if notes else ""
    body = (
        f'<div class="columns">{"".join(parts)}</div>{notes}'
        if parts or notes
        else page.absent("Nothing was recorded.")
    )
    lead = "Every number of this page is in summary.json beside it; its full precision too."
    return page.section("provenance", "Where the numbers come from", body, lead)


def _how_to_read_section(compared: Summary) -> str:
    """Return what the page's words mean, the families and the names of the methods that are there among them."""
    names = by_error(compared)
    families, known = {family(name) for name in names}, page.words("methods")
    terms = [
        *page.words("how_to_read").items(),
        *((f"{word.capitalize()} method", text) for word, text in page.words("families").items() if word in families),
        *((name, known[name].replace("`", "")) for name in names if name in known),
    ]
    return page.section("how-to-read", "How to read this page", page.definitions(terms))
