"""What the report's viewer is given: the pictures that a side may show, and what turns their colours into values."""

from compare.report.facts import Material, Summary
from compare.report.layers import ViewerLayers, palette, scene_of, surface_uri
from compare.report.registration_pictures import raking_frame

SCRIPTS = ("report_page.js", "viewer_values.js", "viewer_pixel.js", "viewer_scene.js", "viewer.js")
"""The page's program in parts, each reading none that follows it."""
GROUPS = {
    "photograph": "photographs of one light", "relit": "relit by a lamp", "normals": "normals",
    "error": "angular error",
    "sigma": "standard deviation (sigma)", "albedo": "albedo",
}  # fmt: skip


def viewer_facts(material: Material, layers: ViewerLayers | None, best: str | None) -> Summary:
    """Return what viewer.html is filled in with; no options where there is nothing to be shown."""
    if layers is None or not layers.layers:
        return {"options": {}}
    found: dict[str, dict[str, str]] = {group: {} for group in GROUPS}
    for layer in layers.layers:
        if layer.kind == "photograph":
            found[layer.kind][f"photograph:{layer.side}"] = (
                "photograph" if layer.side == "real" else "twin's photograph"
            )
        else:
            found[layer.kind][f"{layer.kind}:{layer.side}:{layer.name}"] = layer.label
        if layer.kind == "albedo":
            found["relit"][f"relit:real:{layer.name}"] = f"relit, {layer.name}"
    keys = [key for group in found.values() for key in group]
    left = "photograph:real" if "photograph:real" in keys else keys[0]
    wanted = (
        f"error:real:{best}",
        f"normals:real:{best}",
        *(key for key in keys if key.startswith("normals")),
        keys[-1],
    )
    (width, height), grid = layers.grid.size, layers.grid
    data = {
        "width": width, "height": height, "left": grid.box.left, "top": grid.box.top, "step": grid.step,
        "frames": [] if material.frames is None else list(material.frames.names), "scales": layers.scales,
        "frame": 0 if material.directions is None else raking_frame(material.directions),
        "palette": palette().tolist(), "surface": surface_uri(material, grid), "best": best, **scene_of(material),
    }  # fmt: skip
    return {
        "options": {GROUPS[group]: [*rows.items()] for group, rows in found.items() if rows},
        "chosen": (left, next(key for key in wanted if key in keys)),
        "viewer_data": data,
        "accuracy": _accuracy(layers),
    }


def _accuracy(layers: ViewerLayers) -> str:
    """Return how far a value read off may be from the folder's own."""
    parts = ["normals 0.4° at most, 0.2° usually"]
    for kind in ("error", "sigma"):
        if scale := layers.scales.get(kind):
            end = scale["end_deg"]
            parts.append(f"{kind} {end / 254:.2g}° up to {end:g}°, which also stands for more")
    if scale := layers.scales.get("photograph-real"):
        parts.append(f"photographs {100 * scale['error_share']:.1g} % of white for 95 % of samples")
    every = "every pixel" if layers.grid.step == 1 else f"one pixel of {layers.grid.step} × {layers.grid.step}"
    return f"{every} is shown; values are rounded: {'; '.join(parts)}."
