"""One self-contained page: what the cameras saw, what was computed of it, and how far it can be trusted."""

from html import escape
from pathlib import Path
from typing import Any

from compare.report import charts, sections
from compare.report.facts import all_warnings
from compare.report.galleries import balls_section, frames_section, lights_section
from compare.report.maps import errors_section, normals_section
from compare.report.page import is_number, number, whole_page
from compare.report.registration_section import registration_section
from compare.report.shown_material import Material
from compare.report.statistics_section import statistics_section, time_section
from compare.report.twin_section import twin_section
from compare.report.verdict import verdict_box
from scene.files import write_text
from scene.store import Store


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
    chapters = {
        "Verdict": verdict_box(summary, len(warnings)) + sections.truth_check_section(summary),
        "Warnings": sections.warnings_section(warnings),
        "Photographs": frames_section(material, summary),
        "Balls": balls_section(material),
        "Lights": lights_section(material),
        "Registration": registration_section(material, summary),
        "Normals": normals_section(material),
        "Twin": twin_section(material, summary),
        "Errors": errors_section(material, summary),
        "Statistics": statistics_section(compared),
        "Speed": time_section(summary),
        "Provenance": sections.provenance_section(summary),
        "How to read": sections.how_to_read_section(compared),
    }
    name = str(summary.get("name") or store.folder.resolve().name)
    kind, subtitle = "Photometric stereo report", _subtitle(summary, compared)
    write_text(store.path("report.html"), whole_page(name, kind, subtitle, chapters, script=charts.library()))
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
    if version := (summary.get("versions") or {}).get("rgbn"):
        parts.append(f"rgbn {escape(str(version))}")
    return " · ".join(parts)
