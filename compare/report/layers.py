"""The object's pixels as pictures that people see and the viewer reads values from: one grid of pixels for all.

A picture's colour is its value's code: photographs and albedo in sRGB, normals (n + 1) / 2, angles by their
place on a scale of colours.
"""

import base64
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.facts import Material, Summary, read_optional
from compare.report.pictures import Exposure, PixelBox
from draw.readable import is_number
from formats.picture_files import linear_from_srgb
from scene.frames import Frames
from scene.map_pictures import Image, data_uri, normal_picture

MOST_PIXELS = 400_000
MOST_BYTES = 5_500_000
"""Of all pictures, before base64 makes four thirds of them."""
SURFACE_POINTS = 60_000
"""Of the scene in 3-D, about."""
GROUPS = {
    "photograph": "photographs of one light", "relit": "relit by a lamp", "normals": "normals",
    "error": "angular error", "sigma": "standard deviation (sigma)", "albedo": "albedo",
}  # fmt: skip
"""What a side of the viewer may show."""


@dataclass(frozen=True)
class Layer:
    """One picture of the grid. `kind`: photograph, normals, error, sigma or albedo; `side`: real, twin or truth."""

    kind: str
    side: str
    name: str
    label: str
    image: Image

    @cached_property
    def uri(self) -> str:
        return data_uri(self.image, photograph=self.kind == "photograph")


@dataclass(frozen=True)
class ViewerLayers:
    """All pictures of a folder on one grid, and what turns their colours into values again."""

    grid: PixelBox
    """Of every `step`-th pixel: a value shown is that of one pixel, not a mean."""
    layers: list[Layer]
    scales: Summary

    @classmethod
    def of(cls, material: Material, summary: Summary, step: int = 0) -> "ViewerLayers":
        """Return the folder's pictures of every `step`-th pixel; 0: the least step by which all fit."""
        box, scales = PixelBox.of_mask(material.mask, margin=0.04), {}
        step = step or int(np.ceil(np.sqrt(max(1.0, box.width * box.height / MOST_PIXELS))))
        grid, sides = replace(box, step=step), {"real": material.frames, "twin": material.twin_frames}
        there = {side: frames for side, frames in sides.items() if frames is not None}
        layers = [one for side, frames in there.items() for one in _photographs(material, frames, side, grid, scales)]
        end = (summary.get("compare") or {}).get("error_scale_deg")
        layers += _maps(material, grid, end if is_number(end) else None, scales)
        # Pictures of one kind and side are about as large as the first of them: to encode them is most of the work.
        firsts = {(layer.kind, layer.side): layer for layer in reversed(layers)}
        size = 0.75 * sum(len(firsts[layer.kind, layer.side].uri) for layer in layers)
        if size > MOST_BYTES:
            return cls.of(material, summary, int(np.ceil(step * np.sqrt(size / MOST_BYTES))))
        return cls(grid, layers, scales)


def _photographs(material: Material, frames: Frames, side: str, grid: PixelBox, scales: Summary) -> Iterator[Layer]:
    """Yield a side's photographs; its scale has what JPEG costs 95 % of samples at most, as a share of white."""
    exposure, words = material.exposure, "photograph"
    if side == "twin":
        exposure, words = Exposure.for_frames(frames, white_value=exposure.balance), "twin"
    for index, name in enumerate(frames.names):
        values = grid.frame(frames, index)
        layer = Layer("photograph", side, str(index), f"{words} {index + 1}, {name}", exposure.develop(values))
        if not index:
            scales[f"photograph-{side}"] = {
                "white": exposure.white, "balance": exposure.balance.tolist(),
                "error_share": _jpeg_error(layer.uri, values / exposure.balance / exposure.white),
            }  # fmt: skip
        yield layer


def _jpeg_error(uri: str, share: NDArray) -> float:
    import cv2

    coded = np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8)
    read = linear_from_srgb(np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)) / 255).mean(-1)
    return float(np.quantile(np.abs(read - np.clip(np.nan_to_num(share), 0, 1).mean(-1)), 0.95))


def _maps(material: Material, grid: PixelBox, error_end: float | None, scales: Summary) -> Iterator[Layer]:
    """Yield normals, and the errors, albedo and sigma that belong to them, of the truth and of every method."""

    def there(place: str, name: str) -> NDArray | None:
        found = material.map_of(place, name)
        return None if found is None else grid.of(found)

    balance = material.exposure.balance
    sigmas: dict[str, list[tuple[str, str, NDArray]]] = {"truth": [], "real": []}
    for name, side in [("truth", "truth"), *product(material.methods, ("real", "twin"))]:
        normals = there("twin/normals" if side == "twin" else "normals", name)
        if normals is None:
            continue
        of = {"truth": "ground truth", "real": f"{name}, photographs", "twin": f"{name}, twin"}[side]
        yield Layer("normals", side, name, f"normals, {of}", normal_picture(normals, grid.size[0]))
        error = there("compare", f"error_{side}_{name}")
        if error is not None and error_end is not None:
            yield Layer("error", side, name, f"error, {of}", pictures.error_picture(error, error_end))
        sigma = {"truth": ("normals", "truth_sigma"), "real": ("sigma", name)}.get(side)
        if sigma and (found := there(*sigma)) is not None:
            sigmas[side].append((name, f"sigma, {of}", found))
        albedo = there("albedo", name) if side == "real" else None
        if albedo is not None:
            known = (albedo / balance)[np.isfinite(albedo).all(-1)]
            white = max(float(np.quantile(known, 0.999)) if known.size else 1.0, 1e-6)
            scales[f"albedo-{name}"] = {"white": white, "balance": balance.tolist()}
            yield Layer("albedo", "real", name, f"albedo, {name}", Exposure(white, balance).develop(albedo))
    for side, shown in sigmas.items():
        known = np.concatenate([np.zeros(0), *(sigma[np.isfinite(sigma)] for *_, sigma in shown)])
        if known.size:
            end = pictures.colour_scale_end(float(np.quantile(known, 0.98)), least=0.1)
            scales[f"sigma-{side}"] = {"end_deg": end}
            for name, label, sigma in shown:
                yield Layer("sigma", side, name, label, pictures.error_picture(sigma, end))
    if error_end is not None:
        scales["error"] = {"end_deg": error_end}


def _surface(material: Material, grid: PixelBox) -> Summary | None:
    """Return the scan's depth z, mm, at every `step`-th pixel: 16 bits from `low` on over `span`, 0 where unknown."""
    z, (width, height) = material.map_of("twin", "truth_z_mm"), grid.size
    if z is None:
        return None
    grid = replace(grid, step=grid.step * max(1, round((width * height / SURFACE_POINTS) ** 0.5)))
    z = grid.of(z).astype(np.float64)
    known = (z < 0) & grid.of(material.mask)
    if not known.any():
        return None
    low, span = float(z[known].min()), max(float(np.ptp(z[known])), 1e-6)
    codes = np.where(known, 1 + np.round((z - low) / span * 65534), 0).astype("<u2")
    shown = {"codes": base64.b64encode(codes.tobytes()).decode(), "low": low, "span": span}
    return {**shown, "width": z.shape[1], "step": grid.step}


def viewer_facts(material: Material, layers: ViewerLayers, best: str | None) -> Summary:
    """Return what viewer.html is filled in with."""
    options: dict[str, dict[str, str]] = {title: {} for title in GROUPS.values()}
    for layer in layers.layers:
        key, label = f"{layer.kind}:{layer.side}:{layer.name}", layer.label
        if layer.kind == "photograph":
            key, label = f"photograph:{layer.side}", "photograph" if layer.side == "real" else "twin's photograph"
        options[GROUPS[layer.kind]][key] = label
        if layer.kind == "albedo":
            options[GROUPS["relit"]][f"relit:real:{layer.name}"] = f"relit, {layer.name}"
    keys = [key for rows in options.values() for key in rows]
    wanted = [f"error:real:{best}", f"normals:real:{best}", *options[GROUPS["normals"]], keys[-1]]
    (width, height), grid = layers.grid.size, layers.grid
    parts = {name: read_optional(material.store, f"{name}.json") for name in ("camera", "lights", "spheres")}
    data = {
        "width": width, "height": height, "left": grid.left, "top": grid.top, "step": grid.step,
        "frames": list(material.frames.names), "scales": layers.scales,
        "frame": material.raking,
        "palette": pictures.error_scale_colours(256), "surface": _surface(material, grid), "best": best, **parts,
    }  # fmt: skip
    return {
        "options": {title: rows for title, rows in options.items() if rows},
        "chosen": ("photograph:real", next(key for key in wanted if key in keys)), "viewer_data": data,
    }  # fmt: skip
