"""Maps of an object as TIFF files that measuring and mapping programs open: values, and the size of a pixel."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_text, write_whole

CENTIMETRE = 3
"""ResolutionUnit [Adobe1992]."""


def write_map(
    path: Path, values: NDArray, told: Mapping[str, Any], pixel_mm: float | None, *, world_mm: float = 1.0, **tags: Any
) -> list[Path]:
    """Write a map as TIFF, and a world file beside it where a pixel has a size; return both.

    Parameters
    ----------
    path : Path
        .tif
    values : (H, W) or (H, W, 3), uint16 or float32
        NaN where unknown, of whole numbers 0.
    told : mapping
        What the values mean: JSON in the tag ImageDescription.
    pixel_mm : float or None
        On the object. It goes into XResolution and YResolution, pixels a centimetre, and into the .tfw: x to the right
        and y up, from the middle of the picture's first pixel.
    world_mm : float
        Unit of the .tfw.
    **tags
        Of `tifffile.imwrite`, as `iccprofile`.
    """
    import tifffile

    kind = "rgb" if values.ndim == 3 else "minisblack"
    size = {} if pixel_mm is None else {"resolution": (10 / pixel_mm,) * 2, "resolutionunit": CENTIMETRE}
    with write_whole(path) as file:
        tifffile.imwrite(
            file, np.ascontiguousarray(values), photometric=kind, description=json.dumps(told), metadata=None,
            compression="zlib", predictor=values.dtype.kind == "u", software="rgbn", **size, **tags,
        )  # fmt: skip
    world = path.with_suffix(".tfw")
    if pixel_mm is None:
        return [path]
    # Across, two turns, down, and the middle of the first pixel.
    pixel = pixel_mm / world_mm
    write_text(world, "".join(f"{number:.9g}\n" for number in (pixel, 0, 0, -pixel, 0, 0)))
    return [path, world]
