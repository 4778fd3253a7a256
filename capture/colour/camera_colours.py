"""What is known of the camera's colours: by a chart, else by the matrix that its maker gives."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.colour.colour_chart import GOOD, chart_colours
from capture.session.globs import kind_of
from capture.session.session_types import CaptureSession
from scene.frames import Frames

MOST_CONDITION = 100
"""Of a camera's matrix; cameras have 2 to 10."""


def camera_colours(session: CaptureSession, frames: Frames) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what tells sRGB from a session's camera, and warnings.

    Returns
    -------
    known : dict
        `source`: "chart", "camera" or None. `camera_to_srgb` (3, 3): linear sRGB (D65) of the camera's RGB, by a chart
        as it was lit, by the camera's own matrix of white-balanced RGB. Of a chart also `delta_e_2000`, median and
        worst, `patches`, how many were read, `fall_off` of the light across it, and `flash`, the frame it stood in.
    warnings : tuple of str

    Raises
    ------
    CaptureError
        frames.chart holds no ColorChecker that can be read, or is of another size than the frames.
    """
    chart = chart_colours(session, frames)
    if chart is None:
        matrix = maker_matrix(session.flash[0]) if kind_of(session.flash[0]) == "raw" else None
        return {"source": None if matrix is None else "camera", "camera_to_srgb": matrix}, ()
    worst, warnings = float(np.nanmax(chart.delta_e_2000)), []
    if chart.used < 24:
        warnings.append(f"frames.chart: {24 - chart.used} of the 24 patches are clipped and left out. Expose less.")
    if chart.median > GOOD:
        warnings.append(
            f"frames.chart: the ColorChecker's colours are missed by Delta E 2000 of {chart.median:.1f} (median; worst "
            f"{worst:.1f}), good photographs by less than {GOOD:g}. Is it lit by the flash alone, without glare, in "
            "focus, and not faded?"
        )
    known = {"source": "chart", "camera_to_srgb": chart.camera_to_srgb, "patches": chart.used, "flash": chart.flash}
    return {**known, "delta_e_2000": {"median": chart.median, "worst": worst}, "fall_off": chart.fall_off}, (*warnings,)


def maker_matrix(path: Path) -> NDArray[np.float64] | None:
    """Return (3, 3), linear sRGB of a RAW file's white-balanced RGB by its maker's or Adobe's matrix, if it has one.

    LibRaw makes it of a DNG's ColorMatrix itself. Of others, with A the camera's RGB of XYZ (D65) and S the XYZ of
    sRGB, it is the inverse of A S with rows that sum to 1: white stays white.
    """
    import rawpy
    from skimage.color import colorconv

    try:
        with rawpy.imread(str(path)) as raw:
            matrix, camera = np.array(raw.color_matrix, float)[:, :3], np.array(raw.rgb_xyz_matrix, float)[:3]
    except rawpy.LibRawError:
        return None
    if not matrix.any() and camera.any():
        camera = camera @ colorconv.xyz_from_rgb
        matrix = np.linalg.pinv(camera / camera.sum(1, keepdims=True))
    return matrix if np.linalg.cond(matrix) < MOST_CONDITION else None
