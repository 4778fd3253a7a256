"""Relightable pictures as the viewers OpenLIME and RelightLab take them: info.json, planes of coefficients, a page.

Of each pixel and channel the picture under a light from (x, y, z), unit, the camera's frame, is a sum over terms of the
light's direction times a coefficient [Malzbender2001], [Gautron2004]. A plane is a JPEG of one term's coefficients, its
channels the picture's; info.json has what turns its codes c, 0 to 1, into coefficients: scale (c - bias).
"""

import json
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.files import write_json, write_text, write_whole

Array = NDArray[np.float64]
QUALITY = 95
"""Of the JPEGs."""
LOWEST_RAD = 0.15
"""Above the plane of the picture: `hsh` takes lower lights as if they stood there, as the viewers do."""
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


def terms(kind: str, directions: Array) -> Array:
    """Return the terms (F, K) of lights from unit `directions` (F, 3).

    kind: `ptm`, the 6 of a polynomial in x and y; `hsh`, the 9 hemispherical harmonics up to order 2, in the viewers'
    order.
    """
    x, y, z = directions.T
    if kind == "ptm":
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    c = np.cos(np.minimum(np.arccos(np.clip(z, -1, 1)), np.pi / 2 - LOWEST_RAD))
    # The viewers' have cosines before sines, and all but the zonal ones the other sign.
    return harmonics(np.stack([x, y, c], 1), 2)[:, [0, 3, 2, 1, 8, 7, 6, 5, 4]] * [1, -1, 1, -1, -1, -1, 1, -1, -1]


def harmonics(directions: NDArray, order: int) -> NDArray[np.float64]:
    """Return the hemispherical harmonics (..., (order + 1)^2) at unit vectors (..., 3), those below z = 0 as on it."""
    from scipy.special import sph_harm_y

    polar = np.arccos(2 * np.clip(directions[..., 2], 0, 1) - 1)
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    found = []
    for degree in range(order + 1):
        # Those of the whole sphere, twice as dense; by their real and imaginary parts.
        whole = [np.sqrt(2.0) * sph_harm_y(degree, m, polar, azimuth) for m in range(degree + 1)]
        found += [np.sqrt(2.0) * one.imag for one in whole[:0:-1]] + [whole[0].real]
        found += [np.sqrt(2.0) * one.real for one in whole[1:]]
    return np.stack(found, -1)


def write_relight(
    folder: Path, title: str, kind: str, coefficients: NDArray[np.float32], directions: Array, pixel_mm: float | None
) -> list[Path]:
    """Write index.html, a page for OpenLIME, info.json, plane_0.jpg and so on.

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
    info = {"width": width, "height": height, "format": "jpg", "type": kind, "colorspace": "rgb",
            "lights": np.round(directions, 6).ravel().tolist(), "nplanes": 3 * len(coefficients), "quality": QUALITY,
            "materials": [material]}  # fmt: skip
    write_json(paths[1], info)
    write_text(paths[0], PAGE.format(title=escape(title), pixel_mm=json.dumps(pixel_mm)))
    return paths


def tell(folder: Path, told: dict[str, float]) -> None:
    """Add to info.json, under `rgbn`, how far the picture misses the photographs; viewers pass it over."""
    info = json.loads((folder / "info.json").read_text())
    write_json(folder / "info.json", {**info, "rgbn": told})
