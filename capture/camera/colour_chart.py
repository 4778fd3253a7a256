"""Colours of the camera's RGB: by a ColorChecker that was photographed, else by the matrix that its maker gives."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.photograph import SATURATION
from capture.session.globs import kind_of
from capture.session.session_types import CaptureSession
from formats.picture_files import LUMINANCE, srgb_from_linear
from scene.errors import CaptureError
from scene.frames import Frames
from scene.frames import decode as linear_of

WIDTHS_PX = 1200, 1800, 800, 2600
"""Of the picture that OpenCV's detector is given: it wants patches of some 30 to 100 px."""
CANDIDATES = 5
"""Charts that the detector may name in each; the one whose colours fit best is taken."""
CELL_PX, INNER = 50, slice(16, 34)
"""So large is a patch drawn, with its margin, and its middle read: the detector is off by up to a tenth of it."""
FEWEST = 18
"""Patches of the 24 that are not clipped; fewer hardly hold the matrix."""
ENOUGH, GOOD, WORST = 0.8, 3.0, 8.0
"""Median Delta E 2000: sound photographs leave 0.8 to 2 (a camera is no eye); what is no chart leaves more than 20.
Below the first no better one is looked for; from the second on it is doubted, and from the third refused."""
MOST_CONDITION = 100
"""Of a maker's matrix; cameras have 2 to 10."""


class ChartFit(NamedTuple):
    """camera_to_srgb (3, 3); delta_e_2000 (24,), NaN where clipped; the light's relative fall_off across the chart."""

    camera_to_srgb: NDArray[np.float64]
    delta_e_2000: NDArray[np.float64]
    fall_off: float

    @property
    def used(self) -> int:
        return int(np.count_nonzero(~np.isnan(self.delta_e_2000)))

    @property
    def median(self) -> float:
        return float(np.nanmedian(self.delta_e_2000)) if self.used >= FEWEST else np.inf


def camera_colours(session: CaptureSession, frames: Frames) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what tells sRGB from a session's camera, and warnings.

    `source` is "chart", "camera" or None; `camera_to_srgb` (3, 3) gives linear sRGB (D65): by a chart, of RGB under the
    light that it stood in; by the camera's own matrix, of white-balanced RGB. Of a chart also `delta_e_2000` (median
    and worst), `patches` (how many were read), `fall_off`, and `flash`, the frame in which it stood, if in any.
    CaptureError: frames.chart shows no ColorChecker that can be read, or is of another size than the frames.
    """
    path = session.chart
    if path is None:
        matrix = maker_matrix(session.flash[0]) if kind_of(session.flash[0]) == "raw" else None
        words = "no ColorChecker is stated (frames.chart)"
        return {"source": None if matrix is None else "camera", "camera_to_srgb": matrix, "words": words}, ()
    flash = session.flash.index(path) if path in session.flash else None
    if flash is None:
        photograph = read_photograph(path, DevelopRecipe(session.encoding, session.half, path, is_first=True))
        linear = linear_of(photograph.codes)
        clipped = linear.max(-1) >= SATURATION * photograph.white
    else:
        linear, clipped = frames.frame(flash), frames.saturated(frames=[flash])[0]
    if linear.shape[:2] != (frames.height, frames.width):
        raise CaptureError(
            f"frames.chart: {path.name} is {linear.shape[1]} x {linear.shape[0]} px, the flash frames "
            f"{frames.width} x {frames.height}. Photograph the chart with the session's camera, at the same size."
        )
    linear[clipped] = np.nan
    best = ChartFit(np.eye(3), np.full(24, np.nan), 0)
    for patches in find_patches(linear):
        best = max(best, fit_colours(patches), key=lambda one: (-one.median, one.used))
        if best.median < ENOUGH:
            break
    if not best.median <= WORST:
        found = f"{24 - best.used} patches are clipped, {24 - FEWEST} may be" if best.used else "nothing is like one"
        if best.used >= FEWEST:
            found = f"Delta E 2000 has the median {best.median:.0f}, expected below {GOOD:g}"
        raise CaptureError(
            f"frames.chart: {path.name} shows no ColorChecker that can be read: {found}. Photograph one of 24 patches "
            "by the flash alone, a tenth of the picture's width or more, in focus, neither clipped nor with glare."
        )
    delta_e, warnings = {"median": best.median, "worst": float(np.nanmax(best.delta_e_2000))}, []
    if best.used < 24:
        warnings.append(f"frames.chart: {24 - best.used} of the 24 patches are clipped and left out. Expose less.")
    if best.median > GOOD:
        warnings.append(
            f"frames.chart: the ColorChecker's colours are missed by Delta E 2000 of {best.median:.1f} (median), good "
            f"photographs by less than {GOOD:g}. Is it lit by the flash alone, without glare, in focus, and not faded?"
        )
    known = {"source": "chart", "camera_to_srgb": best.camera_to_srgb, "patches": best.used, "flash": flash}
    words = f"a ColorChecker, missed by Delta E 2000 of {best.median:.1f} (median), {delta_e['worst']:.1f} (worst)"
    return {**known, "delta_e_2000": delta_e, "fall_off": best.fall_off, "words": words}, (*warnings,)


def maker_matrix(path: Path) -> NDArray[np.float64] | None:
    """Return (3, 3), linear sRGB of a RAW file's white-balanced RGB by its maker's or Adobe's matrix, if it has one.

    LibRaw makes it of a DNG's ColorMatrix itself. Of others, with A the camera's RGB of XYZ (D65) and S the XYZ of
    sRGB, it is the inverse of A S with rows that sum to 1: white stays white.
    """
    import rawpy

    try:
        with rawpy.imread(str(path)) as raw:
            matrix, camera = np.array(raw.color_matrix, float)[:, :3], np.array(raw.rgb_xyz_matrix, float)[:3]
    except rawpy.LibRawError:
        return None
    if not matrix.any() and camera.any():
        from skimage.color import colorconv

        camera = camera @ colorconv.xyz_from_rgb
        matrix = np.linalg.pinv(camera / camera.sum(1, keepdims=True))
    return matrix if np.linalg.cond(matrix) < MOST_CONDITION else None


def find_patches(linear: NDArray[np.float32]) -> Iterator[NDArray[np.float64]]:
    """Yield the patches' means (24, 3), row by row, of each thing in a picture (H, W, 3) that may be a ColorChecker.

    NaN where a patch is clipped, as `linear` has NaN, or lies beside the picture.
    """
    import cv2

    grid = CELL_PX * (np.stack(np.meshgrid(np.arange(6), np.arange(4)), -1).reshape(24, 2) + 0.5) - 0.5
    for width in WIDTHS_PX:
        scale = width / linear.shape[1]
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        small = cv2.resize(linear, None, fx=scale, fy=scale, interpolation=how)
        white = np.maximum(np.nanquantile(small, 0.995, axis=(0, 1)), 1e-6)
        shown = np.round(255 * srgb_from_linear(np.nan_to_num(small[..., ::-1] / white[::-1], nan=1)))
        detector, settings = cv2.mcc.CCheckerDetector.create(), cv2.mcc.DetectorParametersMCC()
        # Its own way to enlarge small pictures is not wanted.
        settings.minImageSize = min(small.shape[:2])
        detector.setDetectionParams(settings)
        detector.setColorChartType(cv2.mcc.MCC24)
        detector.process(np.ascontiguousarray(shown.astype(np.uint8)), CANDIDATES)
        for chart in detector.getListColorChecker():
            middles = (np.reshape(chart.getColorCharts(), (24, 4, 2)).mean(1) + 0.5) / scale - 0.5
            turn, _ = cv2.findHomography(middles, grid)
            if turn is not None:
                beside = {"borderMode": cv2.BORDER_CONSTANT, "borderValue": (np.nan,) * 3}
                drawn = cv2.warpPerspective(linear, turn, (6 * CELL_PX, 4 * CELL_PX), **beside)
                cells = drawn.reshape(4, CELL_PX, 6, CELL_PX, 3)[:, INNER, :, INNER]
                yield cells.mean((1, 3), dtype=np.float64).reshape(24, 3)


def fit_colours(patches: NDArray[np.float64]) -> ChartFit:
    """Fit the camera's matrix to a chart's patches (24, 3), NaN where clipped.

    M c_i = (1 + g . p_i) r_i, least squares in M (3 x 3) and g (2): c_i is the camera's RGB of patch i, r_i its linear
    sRGB, p_i its place on the chart, and g the light's fall-off. Each patch has the weight Y_i^(-2/3), the slope of
    CIE's lightness. r_i are the maker's values [Pascale2006], from D50 to D65 by Bradford's matrix; the differences
    are Delta E 2000 [Sharma2005].
    """
    from skimage.color import colorconv, deltaE_ciede2000, xyz2lab

    known, reference = np.isfinite(patches).all(1), reference_colours()
    delta_e = np.where(known, np.inf, np.nan)
    if known.sum() < FEWEST:
        return ChartFit(np.eye(3), delta_e, 0.0)
    places = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 6), np.linspace(-0.5, 0.5, 4)), -1).reshape(24, 2)
    rows = np.zeros((24, 3, 11))
    for channel in range(3):
        rows[:, channel, 3 * channel : 3 * channel + 3] = patches
    rows[:, :, 9:] = -reference[:, :, None] * places[:, None]
    weights = (reference @ LUMINANCE)[:, None] ** (-2 / 3)
    rows, aims = (rows * weights[..., None])[known], (reference * weights)[known]
    solution = np.asarray(np.linalg.lstsq(rows.reshape(-1, 11), aims.ravel(), rcond=None)[0], np.float64)
    matrix, slope = solution[:9].reshape(3, 3), solution[9:]
    shown = patches @ matrix.T / (1 + places @ slope)[:, None]
    lab = [xyz2lab(linear[known] @ colorconv.xyz_from_rgb.T) for linear in (reference, shown)]
    delta_e[known] = deltaE_ciede2000(*lab)
    return ChartFit(matrix, delta_e, float(np.abs(slope).max()))


@lru_cache(maxsize=1)
def reference_colours() -> NDArray[np.float64]:
    """Return linear sRGB (24, 3) of the chart's patches, row by row; cyan's red is below 0. See `fit_colours`."""
    import cv2

    # OpenCV hands its table out with a fit alone.
    model = cv2.ccm.ColorCorrectionModel(np.full((24, 1, 3), 0.5), cv2.ccm.COLORCHECKER_MACBETH)
    model.setMaxCount(1)
    model.compute()
    return np.asarray(model.getRefLinearRGB(), np.float64).reshape(24, 3)
