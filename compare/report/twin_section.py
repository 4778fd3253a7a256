"""The report's section on the twin: beside the photograph, its material and what that leaves, why its engine."""

from html import escape
from typing import Any

from compare.report.facts import Material, Summary
from compare.report.layers import Layers
from compare.report.page import absent, is_number, say, section
from draw.line_chart import line_chart


def twin_section(material: Material, layers: Layers | None, summary: Summary) -> str:
    """Return the twin's frames, its material and its engine."""
    shown = "" if layers is None else layers.html("photograph", "twin")
    if not shown:
        registered = material.map_of("normals", "truth") is not None and material.store.path("pose.json").exists()
        reason = "No twin was rendered in this folder." if registered else ""
        return section("twin", "The twin", absent(reason or "No twin was rendered: it needs the registered scan."))
    facts = summary.get("twin") or {}
    lead = say("material", "twin")
    if facts.get("engine"):
        reason = f": {facts['reason']}" if facts.get("reason") else ""
        lead += say("material", "engine", seconds=facts.get("seconds"), engine=f"{facts['engine']}{reason}")
    if alike := (summary.get("compare") or {}).get("frames_alike"):
        worst = min(alike["frames"], key=lambda row: row["ssim"])
        lead += say("material", "alike", **alike, worst=worst["name"], least=worst["ssim"])
    body = f'<div class="sheet">{shown}</div>{material_words(facts)}'
    return section("twin", "The twin", body, lead)


def material_words(twin: dict[str, Any]) -> str:
    """Return HTML of the summary's `twin`: the sentence, what it leaves frame by frame."""
    material = twin.get("material") or {}
    if not material.get("sentence"):
        return ""
    text = "<h3>What the object is said to be made of</h3>"
    text += f"<p>The object is {escape(str(material['sentence']))}.</p>"
    if not is_number(material.get("relative_rmse")):
        return text
    text += say("material", "met", **material)
    if held_out := twin.get("held_out"):
        text += say("material", "held out", **held_out)
    shares = [100 * value if is_number(value) else float("nan") for value in material["relative_rmse_per_frame"]]
    lights = [float(k + 1) for k in range(len(shares))]
    chart = line_chart({"a frame": (lights, shares)}, x_title="light", y_title="not explained, % (rms)")
    return f"{text}<figure>{chart}</figure>"
