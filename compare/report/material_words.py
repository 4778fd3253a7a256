"""What the twin's object is said to be made of, and how far that explains the photographs, for the report."""

from html import escape
from typing import Any

from compare.report.line_chart import line_chart
from compare.report.page import is_number, number, percent, table

CAUSES = {
    "direction": "the lights' directions",
    "intensity": "the lights' intensities",
    "ambient": "ambient light that was not subtracted",
    "registration": "the pose of the scan",
    "normals": "the normals, each pixel's own",
    "highlights": "highlights of another shape",
    "body": "a matte body of another kind",
}
TELLING_SIZE = ("direction", "intensity", "ambient", "normals")
"""Causes of one number of one unit; the others are curves or poses."""


def material_words(twin: dict[str, Any]) -> str:
    """Return HTML of the summary's `twin`: the sentence, what it leaves frame by frame, what would explain that."""
    material = twin.get("material") or {}
    if not material.get("sentence"):
        return ""
    text = "<h3>What the object is said to be made of</h3>" + _made_of(material)
    if not is_number(material.get("relative_rmse")):
        return text
    frames = [value if is_number(value) else float("nan") for value in material["relative_rmse_per_frame"]]
    text += (
        f"<p>With that material, and an albedo for each pixel, the photographs are met to "
        f"{percent(material['relative_rmse'], 1)} (root mean square, relative, of what is lit and not clipped). "
        f"{percent(material.get('onward'), 1)} of the values came by way of other parts of the object, and were "
        "subtracted before.</p>"
    )
    chart = line_chart(
        {"a frame": ([float(k + 1) for k in range(len(frames))], [100 * value for value in frames])},
        x_title="light",
        y_title="not explained, % (rms)",
    )
    rows = [
        (
            escape(CAUSES.get(name) or name),
            percent(part.get("explains")),
            f"{number(part.get('size'), 3)} {escape(str(part.get('unit') or ''))}" if name in TELLING_SIZE else "–",
        )
        for name, part in sorted(material["explained_by"].items(), key=lambda item: -(item[1].get("explains") or 0))
    ]
    head = ("what might be wrong", "share of the rest that it alone would explain", "how much of it that takes")
    return text + f'<div class="pair"><figure>{chart}</figure>{table(head, rows, kind="numbers")}</div>'


def _made_of(material: dict[str, Any]) -> str:
    """Return the sentence; of several places, one of each below it."""
    places = material.get("places") or []
    if not places:
        return f"<p>The object is {escape(str(material['sentence']))}.</p>"
    lines = "".join(
        f"<li>Place {k + 1}, {percent(one.get('share'))} of the pixels: {escape(str(one.get('sentence')))}.</li>"
        for k, one in enumerate(places)
    )
    return f"<p>The object is of two materials: {escape(str(material.get('why')))}.</p><ul>{lines}</ul>"
