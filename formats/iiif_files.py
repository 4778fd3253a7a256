"""IIIF: pictures as tiles that any web server gives out as files, and the manifest that lists them [IIIF2020].

A picture is a level-0 service of the Image API 3.0: info.json, and a PNG for each address that it promises. The ids of
the manifest, of the Presentation API 3.0, are the addresses at which all will be served; relative ones are not allowed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_json, write_png

TILE_PX = 512
"""Side of a tile."""
API = "http://iiif.io/api"
LIGHTING_MAP = "https://iiif.bodleian.ox.ac.uk/contexts/lightingmap/context.json"
PHYSICAL = f"{API}/annex/services/physdim"


def write_tiles(folder: Path, base: str, picture: NDArray[np.uint8], name: str, label: str, part: str) -> Any:
    """Write iiif/image/NAME: a picture's tiles, and info.json; return what stands for it in a manifest.

    folder : Path
        What is served at the address `base`.
    picture : (H, W, 3) uint8
    part : str
        Its part in relighting, by the extension LightingMap: albedo, normal, composite; or empty.
    """
    from PIL import Image

    (height, width), place, scales = picture.shape[:2], f"iiif/image/{name}", [1]

    def write(region: str, size: str, pixels: NDArray[np.uint8]) -> str:
        address = f"{place}/{region}/{size}/0/default.png"
        write_png(folder / address, pixels)
        return f"{base}/{address}"

    full, level = write("full", "max", picture), picture
    while True:
        step = TILE_PX * scales[-1]
        for y in range(0, height, step):
            for x in range(0, width, step):
                v, u = y // scales[-1], x // scales[-1]
                tile = level[v : v + TILE_PX, u : u + TILE_PX]
                region = f"{x},{y},{min(step, width - x)},{min(step, height - y)}"
                write(region, f"{tile.shape[1]},{tile.shape[0]}", tile)
        if max(level.shape) <= TILE_PX:
            break
        # The mean of four pixels; at an edge of odd length, of those that there are.
        level, scales = np.asarray(Image.fromarray(level).reduce(2)), [*scales, 2 * scales[-1]]
    # What fits a tile is asked for as the full picture.
    small = {"id": write("full", f"{level.shape[1]},{level.shape[0]}", level), "type": "Image", "format": "image/png",
             "width": level.shape[1], "height": level.shape[0]}  # fmt: skip
    service = {"id": f"{base}/{place}", "type": "ImageService3", "protocol": f"{API}/image", "profile": "level0",
               "width": width, "height": height, "sizes": [{key: small[key] for key in ("width", "height")}],
               "tiles": [{"width": TILE_PX, "scaleFactors": scales}], "preferredFormats": ["png"],
               "extraFormats": ["png"]}  # fmt: skip
    write_json(folder / place / "info.json", {"@context": f"{API}/image/3/context.json", **service})
    relit = {"id": f"{base}/{place}", "type": "LightingMapExtension", "profile": f"{API}/extension/lightingmap"}
    return {"id": full, "type": "Image", "format": "image/png", "label": {"en": [label]}, "width": width,
            "height": height, "thumbnail": [small],
            "service": [service, {**relit, "mapType": part}] if part else [service]}  # fmt: skip


def write_manifest(
    folder: Path, base: str, label: str, images: Sequence[Any], pixel_mm: float | None, files: Sequence[str]
) -> str:
    """Write iiif/manifest.json of one object; return its address.

    images : sequence of dict
        By `write_tiles`, all of one size; the first is shown.
    pixel_mm : float or None
        Size of a pixel; None: not known.
    files : sequence of str
        Other files of `folder`, TIFF or JSON, to download.
    """
    address, canvas = f"{base}/iiif/manifest.json", f"{base}/iiif/canvas/1"
    annotation = {"id": f"{canvas}/annotation/1", "type": "Annotation", "motivation": "painting", "target": canvas,
                  "body": {"type": "Choice", "items": images}}  # fmt: skip
    shown = {"id": canvas, "type": "Canvas", "width": images[0]["width"], "height": images[0]["height"],
             "items": [{"id": f"{canvas}/page/1", "type": "AnnotationPage", "items": [annotation]}]}  # fmt: skip
    if pixel_mm is not None:
        shown["service"] = [{"@context": f"{PHYSICAL}/1/context.json", "@id": f"{canvas}/size",
                             "@type": "PhysicalDimensionsService", "profile": PHYSICAL, "physicalScale": pixel_mm,
                             "physicalUnits": "mm"}]  # fmt: skip
    others = [{"id": f"{base}/{file}", "type": "Dataset", "label": {"none": [Path(file).name]},
               "format": "image/tiff" if file.endswith(".tif") else "application/json"} for file in files]  # fmt: skip
    manifest = {"@context": [LIGHTING_MAP, f"{API}/presentation/3/context.json"], "id": address, "type": "Manifest",
                "label": {"none": [label]}, "thumbnail": images[0]["thumbnail"], "rendering": others,
                "items": [shown]}  # fmt: skip
    write_json(folder / "iiif" / "manifest.json", manifest)
    return address
