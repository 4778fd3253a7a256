"""`rgbn export --format relight`: one picture that a viewer relights, fitted to the photographs."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Exposure
from formats.picture_files import srgb_from_linear
from formats.relight_files import terms, write_relight
from lab.results import pixel_size_mm
from scene.errors import SceneError
from scene.files import write_json
from scene.store import Store

MOST_PIXELS = 4_000_000
"""Of the picture: a texture of a viewer's, and few enough to be held."""
MOST_CONDITION = 1e3
"""Of the terms at the lights; beyond it they cannot be told apart."""


def export_relight(store: Store, name: str) -> tuple[list[Path], list[str]]:
    """Write OUT/export/relight from a calibrated session; return the files, and notes: the error.

    The pictures that are fitted are those that people see: sRGB, each divided by its flash's intensity, and by its
    fall-off at the depth of the lights' reference point. Directions are those at the reference point, as a viewer has
    one light for all pixels. The residual of a sample by a fit to all other photographs is r / (1 - h), h the
    photograph's element of the hat matrix' diagonal [Allen1974].

    Raises SceneError: the lights are too few, or in one plane or ring, for the terms.
    """
    frames, lights, camera = store.load_frames(), store.load_lights(), store.load_camera()
    lights.check()
    matrix = terms(lights.directions).astype(np.float32)
    if len(matrix) <= matrix.shape[1] or np.linalg.cond(matrix) > MOST_CONDITION:
        raise SceneError(
            f"relight: {len(matrix)} lights where these stand do not tell {matrix.shape[1]} terms of the light's "
            "direction. Seven lights or more, not all on one ring, are needed."
        )
    inverse = np.linalg.pinv(matrix)
    unseen = 1 / np.maximum(1 - np.einsum("fk,kf->f", matrix, inverse), 1e-6)
    step = int(np.ceil(np.sqrt(max(1.0, frames.width * frames.height / MOST_PIXELS))))
    exposure = Exposure.for_frames(frames, white_value=lights.white_value)
    u, white = np.arange(0, frames.width, step), exposure.white * exposure.balance

    def pictures(row: int) -> NDArray[np.float32]:
        """Return what is fitted of one row: (F, w, 3)."""
        pixels = np.stack([u, np.full(len(u), row)], 1).astype(float)
        points = camera.points_at_depth(pixels, float(lights.reference_point_mm[2]))
        strength = np.linalg.norm(lights.toward(points), axis=-1)[..., None] * lights.intensities[:, None]
        linear = frames.read(slice(row, row + 1), columns=slice(None, None, step))[:, 0]
        return srgb_from_linear(np.clip(linear / np.maximum(strength, 1e-6) / white, 0, 1)).astype(np.float32)

    rows = range(0, frames.height, step)
    folder = store.path("export", "relight")
    coefficients = np.stack([np.einsum("kf,fwc->kwc", inverse, pictures(row)) for row in rows], 1)
    pixel_mm = pixel_size_mm(camera, lights)
    paths, info = write_relight(folder, name, coefficients, lights.directions, pixel_mm and step * pixel_mm)
    squares = []
    for index, row in enumerate(rows):
        values = pictures(row)
        fitted = np.einsum("fk,kwc->fwc", matrix, np.einsum("kf,fwc->kwc", inverse, values))
        # By the files: what eight bits and JPEG cost is in it.
        shown = np.clip(np.einsum("fk,kwc->fwc", matrix, coefficients[:, index]), 0, 1)
        squares.append((np.mean((shown - values) ** 2), np.mean(((values - fitted) * unseen[:, None, None]) ** 2)))
    rms, left_out = np.sqrt(np.mean(squares, 0)).tolist()
    write_json(paths[1], info | {"rgbn": {"rms": rms, "left_out_rms": left_out}})
    notes = [
        f"relight: {len(coefficients)} terms; misses the photographs by {100 * rms:.1f} % of white (rms, "
        f"sRGB), photographs that it was not fitted to by {100 * left_out:.1f} %",
        f"relight: {folder.name}/index.html shows it with OpenLIME's openlime.min.js, skin.svg and skin.css beside it, "
        "served over http",
    ]
    return paths, notes
