"""One self-contained page: what the cameras saw, what was computed of it, and how far it can be trusted."""

from html import escape
from pathlib import Path
from string import Template
from typing import Any

from compare.report import charts, galleries, maps, registration_section, sections
from compare.report.page import is_number, number
from compare.report.shown_material import Material
from compare.report.speed_section import time_section
from compare.report.statistics_section import statistics_section
from compare.report.verdict import verdict
from compare.report.warned import all_warnings
from compare.statistics.ranking import ranking_table
from scene.files import write_text
from scene.store import Store

CHAPTERS = (
    ("verdict", "Verdict"),
    ("warnings", "Warnings"),
    ("frames", "Photographs"),
    ("balls", "Balls"),
    ("lights", "Lights"),
    ("registration", "Registration"),
    ("normals", "Normals"),
    ("twin", "Twin"),
    ("errors", "Errors"),
    ("statistics", "Statistics"),
    ("time", "Speed"),
    ("provenance", "Provenance"),
    ("how-to-read", "How to read"),
)


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
    compared = summary.get("compare") or {}
    warnings = all_warnings(summary)
    name = str(summary.get("name") or store.folder.resolve().name)
    body = [
        sections.verdict_box(verdict(summary), len(warnings), ranking_table(summary)),
        sections.truth_check_section(summary),
        sections.warnings_section(warnings),
        galleries.frames_section(material, summary),
        galleries.balls_section(material),
        galleries.lights_section(material),
        registration_section.registration_section(material, summary),
        maps.normals_section(material),
        maps.twin_section(material, summary),
        maps.errors_section(material, summary),
        statistics_section(compared),
        time_section(summary),
        sections.provenance_section(summary),
        sections.how_to_read_section(compared),
    ]
    here = Path(__file__).parent
    page = Template((here / "report_template.html").read_text(encoding="utf-8")).substitute(
        title=escape(name),
        kind="Photometric stereo report",
        subtitle=_subtitle(summary, compared),
        chapters="".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in CHAPTERS),
        style=(here / "report_style.css").read_text(encoding="utf-8"),
        plotly=charts.library(),
        body="\n".join(body),
    )
    write_text(store.path("report.html"), page)
    return store.path("report.html")


def _subtitle(summary: dict[str, Any], compared: dict[str, Any]) -> str:
    capture, parts = summary.get("capture") or {}, []
    if is_number(capture.get("frames")):
        parts.append(f"{number(capture['frames'])} flash photographs")
    if is_number(capture.get("width")) and is_number(capture.get("height")):
        parts.append(f"{number(capture['width'])} × {number(capture['height'])} px")
    if compared.get("methods"):
        parts.append("methods " + escape(", ".join(compared["methods"])))
    if summary.get("created"):
        parts.append(escape(str(summary["created"])))
    version = (summary.get("versions") or {}).get("rgbn")
    if version:
        parts.append(f"rgbn {escape(str(version))}")
    return " · ".join(parts)
