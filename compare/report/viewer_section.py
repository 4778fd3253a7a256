"""The report's viewer: photographs, maps and relit pictures wiped over each other, samples, the scene in 3-D."""

import json
from html import escape
from pathlib import Path
from string import Template

from compare.report import page
from compare.report.facts import Material
from compare.report.layers import Layers, palette, scene_of, surface_uri
from compare.report.registration_pictures import raking_frame

HERE = Path(__file__).parent
SCRIPTS = ("report_page.js", "viewer_values.js", "viewer_relight.js", "viewer_pixel.js", "viewer_scene.js", "viewer.js")
GROUPS = {
    "photograph": "photographs of one light", "relit": "relit by a lamp", "normals": "normals",
    "error": "angular error",
    "sigma": "standard deviation (sigma)", "albedo": "albedo",
}  # fmt: skip


def script() -> str:
    """Return the page's program: the viewer's parts, each reading none that follows it."""
    parts = "\n".join((HERE / name).read_text("utf-8") for name in SCRIPTS)
    return f'"use strict";\n(() => {{\n{parts}\n}})();'


def viewer_section(material: Material, layers: Layers | None, best: str | None) -> str:
    """Return the viewer; without a browser's scripts, what says where the still pictures are."""
    if layers is None or not layers.layers:
        return page.section("viewer", "Look closely", page.absent("No photographs and no normals are in this folder."))
    options = _options(layers)
    keys = [key for group in options.values() for key, _ in group]
    left = "photograph:real" if "photograph:real" in keys else keys[0]
    wanted = (
        f"error:real:{best}",
        f"normals:real:{best}",
        *(key for key in keys if key.startswith("normals")),
        keys[-1],
    )
    right = next(key for key in wanted if key in keys)
    width, height = layers.grid.size
    names = [] if material.frames is None else list(material.frames.names)
    values = {
        "width": width, "height": height, "left": layers.grid.box.left, "top": layers.grid.box.top,
        "step": layers.grid.step, "frames": names, "scales": layers.scales,
        "frame": 0 if material.directions is None else raking_frame(material.directions),
        "palette": palette().tolist(), "surface": surface_uri(material, layers.grid), "best": best,
        **scene_of(material),
    }  # fmt: skip
    data = json.dumps(values, allow_nan=False).replace("<", "\\u003c")
    html = Template((HERE / "viewer.html").read_text("utf-8")).substitute(
        left=_select("left", options, left), right=_select("right", options, right), data=data,
        last=max(len(names) - 1, 0), ratio=f"{width} / {height}", accuracy=_accuracy(layers),
    )  # fmt: skip
    return page.section("viewer", "Look closely", html, page.say("viewer", "lead"))


def _options(layers: Layers) -> dict[str, list[tuple[str, str]]]:
    """Return what a side may show, by group: (key, words)."""
    found: dict[str, dict[str, str]] = {group: {} for group in GROUPS}
    for layer in layers.layers:
        if layer.kind == "photograph":
            found["photograph"][f"photograph:{layer.side}"] = (
                "photograph" if layer.side == "real" else "twin's photograph"
            )
        else:
            found[layer.kind][f"{layer.kind}:{layer.side}:{layer.name}"] = layer.label
        if layer.kind == "albedo":
            found["relit"][f"relit:real:{layer.name}"] = f"relit, {layer.name}"
    return {group: [*rows.items()] for group, rows in found.items() if rows}


def _select(side: str, options: dict[str, list[tuple[str, str]]], chosen: str) -> str:
    groups = ""
    for group, rows in options.items():
        inner = "".join(
            f'<option value="{escape(key)}"{" selected" if key == chosen else ""}>{escape(words)}</option>'
            for key, words in rows
        )
        groups += f'<optgroup label="{GROUPS[group]}">{inner}</optgroup>'
    return f'<select id="viewer-{side}">{groups}</select>'


def _accuracy(layers: Layers) -> str:
    """Return how far a value read off may be from the folder's own."""
    parts = ["normals 0.4° at most, 0.2° usually"]
    for kind in ("error", "sigma"):
        if scale := layers.scales.get(kind):
            parts.append(
                f"{kind} {scale['end_deg'] / 254:.2g}° up to {scale['end_deg']:g}°, which also stands for more"
            )
    if scale := layers.scales.get("photograph-real"):
        parts.append(f"photographs {100 * scale['error_share']:.1g} % of white for 95 % of samples")
    every = "every pixel" if layers.grid.step == 1 else f"one pixel of {layers.grid.step} × {layers.grid.step}"
    return f"{every} is shown; values are rounded: {'; '.join(parts)}."
