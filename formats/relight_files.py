"""Relightable pictures as the viewers OpenLIME and RelightLab take them: info.json, planes of coefficients, a page.

Of each pixel and channel the picture under a light from (x, y, z), unit, the camera's frame, is a sum over terms of the
light's direction times a coefficient [Malzbender2001]. A plane is a JPEG of one term's coefficients, its
channels the picture's; info.json has what turns its codes c, 0 to 1, into coefficients: scale (c - bias).
"""

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_text, write_whole

Array = NDArray[np.float64]
QUALITY = 95
"""Of the JPEGs."""
PAGE = """<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>html, body, .view {{ margin: 0; height: 100%; background: #222; }}</style>
<div class="view"></div>
<!-- OpenLIME's own files, beside this one: https://github.com/cnr-isti-vclab/openlime -->
<script src="openlime.min.js"></script>
<script>
  const viewer = new OpenLIME.Viewer(".view");
  viewer.addLayer("rti", new OpenLIME.Layer({{ type: "rti", layout: "image", url: "info.json", normals: false }}));
  const shown = new OpenLIME.UIBasic(viewer, {{ skin: "skin.svg", pixelSize: {pixel_mm} }});
  shown.actions.light.active = true;
  shown.actions.ruler.display = shown.pixelSize > 0;
</script>
</html>
"""


def terms(directions: Array) -> Array:
    """Return the terms (F, 6) of lights from unit `directions` (F, 3), of a polynomial in x and y."""
    x, y, _ = directions.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)


def write_relight(
    folder: Path, title: str, coefficients: NDArray[np.float32], directions: Array, pixel_mm: float | None
) -> tuple[list[Path], dict[str, Any]]:
    """Write index.html, a page for OpenLIME, plane_0.jpg and so on; return the paths, and what info.json is to hold.

    coefficients : (K, h, w, 3) float32
        Written over by what a viewer has of the files: it shows the sum times `terms`, cut off at 0 and 1.
    directions : (F, 3)
        Of the lights that they were fitted to.
    pixel_mm : float or None
        For OpenLIME's ruler; None: there is none.
    """
    from PIL import Image

    low, high = coefficients.min((1, 2)).astype(float), coefficients.max((1, 2)).astype(float)
    scale = np.maximum(high - low, 1e-6)
    bias = -low / scale
    height, width = coefficients.shape[1:3]
    paths = [folder / "index.html", folder / "info.json"]
    for index, plane in enumerate(coefficients):
        codes = np.round(255 * (plane - low[index]) / scale[index]).astype(np.uint8)
        paths.append(folder / f"plane_{index}.jpg")
        with write_whole(paths[-1]) as file:
            Image.fromarray(codes).save(file, "JPEG", quality=QUALITY, subsampling=0)
        shown = np.asarray(Image.open(paths[-1]), np.float32) / 255
        plane[:] = (shown - bias[index].astype(np.float32)) * scale[index].astype(np.float32)
    material = {"scale": scale.ravel().tolist(), "bias": bias.ravel().tolist()}
    info = {"width": width, "height": height, "format": "jpg", "type": "ptm", "colorspace": "rgb",
            "lights": np.round(directions, 6).ravel().tolist(), "nplanes": 3 * len(coefficients), "quality": QUALITY,
            "materials": [material]}  # fmt: skip
    write_text(paths[0], PAGE.format(title=escape(title), pixel_mm=json.dumps(pixel_mm)))
    return paths, info
