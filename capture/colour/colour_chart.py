"""A ColorChecker in a photograph: its patches' values, and the matrix that makes colours of the camera's RGB."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.photograph import SATURATION
from capture.session.session_types import CaptureSession
from formats.picture_files import LUMINANCE, srgb_from_linear
from scene.errors import CaptureError
from scene.frames import Frames
from scene.frames import decode as linear_of

WIDTHS_PX = 1200, 1800, 800, 2600
"""Of the picture that OpenCV's detector is given: it wants patches of some 30 to 100 px."""
CANDIDATES = 5
"""Charts that the detector may name in each; the one whose colours fit best is taken."""
INNER = 0.6
"""Of the detector's middle of a patch, each way, is read: its corners are off by up to a tenth of a patch."""
FEWEST = 18
"""Patches of the 24 that are not clipped; fewer hardly hold the matrix."""
ENOUGH, GOOD, WORST = 0.8, 3.0, 8.0
"""Median Delta E 2000: sound photographs leave 0.8 to 2 (a camera is no eye); what is no chart leaves more than 20.
Below the first no better one is looked for; from the second on it is doubted, and from the third refused."""
CLIPPED_SHARE = 0.01
"""Of a patch's pixels."""


@dataclass(frozen=True)
class ChartColours:
    """What a chart says of the camera.

    Parameters
    ----------
    camera_to_srgb : (3, 3) float64
        Linear sRGB (D65) of the camera's linear RGB under the light that the chart stood in.
    delta_e_2000 : (24,) float64
        Of each patch, row by row, after the matrix; NaN where it is clipped.
    patches : (24, 3) float64
        Their means, linear, as photographed.
    fall_off : float
        Relative difference of the light from one side of the chart to the other, which the fit allows for.
    flash : int or None
        The flash frame that the chart was found in.
    """

    camera_to_srgb: NDArray[np.float64]
    delta_e_2000: NDArray[np.float64]
    patches: NDArray[np.float64]
    fall_off: float
    flash: int | None = None

    @property
    def used(self) -> int:
        """How many patches are not clipped."""
        return int(np.isfinite(self.delta_e_2000).sum())

    @property
    def median(self) -> float:
        """Of Delta E 2000."""
        return float(np.nanmedian(self.delta_e_2000)) if self.used else np.inf


def chart_colours(session: CaptureSession, frames: Frames) -> ChartColours | None:
    """Return what the session's chart says; None where it has none. CaptureError as `read_chart` and `fit_colours`."""
    path = session.chart
    if path is None:
        return None
    if path in session.flash:
        flash = session.flash.index(path)
        clipped = frames.saturated(frames=[flash])[0]
        return replace(_best(frames.frame(flash), clipped, path), flash=flash)
    photograph = read_photograph(path, DevelopRecipe(session.encoding, session.half, path, is_first=True))
    linear = linear_of(photograph.codes)
    if linear.shape[:2] != (frames.height, frames.width):
        raise CaptureError(
            f"frames.chart: {path.name} is {linear.shape[1]} x {linear.shape[0]} px, the flash frames "
            f"{frames.width} x {frames.height}. Photograph the chart with the session's camera, at the same size."
        )
    return _best(linear, linear.max(-1) >= SATURATION * photograph.white, path)


def _best(linear: NDArray[np.float32], clipped: NDArray[np.bool_], path: Path) -> ChartColours:
    """Return the chart in a photograph whose colours fit best; CaptureError where none fits."""
    found: list[ChartColours] = []
    for patches in find_patches(linear, clipped):
        found.append(fit_colours(patches))
        if found[-1].used >= FEWEST and found[-1].median < ENOUGH:
            break
    do = "Photograph a ColorChecker of 24 patches by the flash alone, so that it fills a tenth of the picture or more"
    if not found:
        raise CaptureError(f"frames.chart: no ColorChecker is found in {path.name}. {do}, and lies in focus.")
    best = min(found, key=lambda one: one.median if one.used >= FEWEST else 100 - one.used)
    if best.used < FEWEST:
        raise CaptureError(
            f"frames.chart: {24 - best.used} of the 24 patches in {path.name} are clipped; {24 - FEWEST} may be. "
            "Expose less."
        )
    if best.median > WORST:
        raise CaptureError(
            f"frames.chart: the colours in {path.name} are not those of a ColorChecker (Delta E 2000 has the median "
            f"{best.median:.1f}, expected below {GOOD:g}). {do}, evenly lit and without glare."
        )
    return best


def find_patches(linear: NDArray[np.float32], clipped: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    """Yield the patches' means of each thing in a photograph that may be a ColorChecker [Pascale2006].

    Parameters
    ----------
    linear : (H, W, 3) float32
    clipped : (H, W) bool

    Yields
    ------
    (24, 3) float64
        Row by row from dark skin; NaN where a patch is clipped.
    """
    import cv2

    for width in WIDTHS_PX:
        scale = width / linear.shape[1]
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        small = cv2.resize(linear, None, fx=scale, fy=scale, interpolation=how)
        shown = srgb_from_linear(small / np.maximum(np.quantile(small, 0.995, axis=(0, 1)), 1e-6))
        detector, settings = cv2.mcc.CCheckerDetector.create(), cv2.mcc.DetectorParametersMCC()
        # Its own way to enlarge small pictures is not wanted.
        settings.minImageSize = min(small.shape[:2])
        detector.setDetectionParams(settings)
        detector.setColorChartType(cv2.mcc.MCC24)
        detector.process(np.ascontiguousarray(np.round(255 * shown[..., ::-1]).astype(np.uint8)), CANDIDATES)
        for chart in detector.getListColorChecker():
            corners = (np.reshape(chart.getColorCharts(), (24, 4, 2)) + 0.5) / scale - 0.5
            yield np.array([_mean(linear, clipped, corner) for corner in corners])


def _mean(linear: NDArray[np.float32], clipped: NDArray[np.bool_], corners: NDArray) -> NDArray[np.float64]:
    """Return the mean (3,) of a patch with these corners (4, 2); NaN where it is clipped, or not in the picture."""
    import cv2

    corners = np.round(corners.mean(0) + INNER * (corners - corners.mean(0))).astype(int)
    (left, top), (right, bottom) = corners.min(0), corners.max(0) + 1
    if min(left, top) < 0 or right > linear.shape[1] or bottom > linear.shape[0]:
        return np.full(3, np.nan)
    inside = np.zeros((bottom - top, right - left), np.uint8)
    cv2.fillConvexPoly(inside, (corners - [left, top]).astype(np.int32), (1,))
    where, part = inside > 0, np.s_[top:bottom, left:right]
    lost = clipped[part][where].mean() > CLIPPED_SHARE
    return np.full(3, np.nan) if lost else linear[part][where].mean(0, dtype=np.float64)


def fit_colours(patches: NDArray[np.float64]) -> ChartColours:
    """Fit the camera's matrix to a chart's patches (24, 3), NaN where clipped.

    M c_i = (1 + g . p_i) r_i, least squares in M (3 x 3) and g (2): c_i is the camera's RGB of patch i, r_i its linear
    sRGB, p_i its place on the chart, and g the light's fall-off. Each patch has the weight Y_i^(-2/3), the slope of
    CIE's lightness. r_i are the maker's values [Pascale2006], from D50 to D65 by Bradford's matrix; the differences
    are Delta E 2000 [Sharma2005].
    """
    from skimage.color import deltaE_ciede2000

    reference = reference_colours()
    known = np.isfinite(patches).all(1)
    places = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 6), np.linspace(-0.5, 0.5, 4)), -1).reshape(24, 2)
    weights = (reference @ LUMINANCE) ** (-2 / 3)
    rows = np.zeros((24, 3, 11))
    for channel in range(3):
        rows[:, channel, 3 * channel : 3 * channel + 3] = patches
    rows[:, :, 9:] = -reference[:, :, None] * places[:, None]
    rows, aims = rows * weights[:, None, None], reference * weights[:, None]
    solution = np.asarray(np.linalg.lstsq(rows[known].reshape(-1, 11), aims[known].ravel(), rcond=None)[0], np.float64)
    matrix, slope = solution[:9].reshape(3, 3), solution[9:]
    shown = patches @ matrix.T / (1 + places @ slope)[:, None]
    delta_e = np.full(24, np.nan)
    delta_e[known] = deltaE_ciede2000(_lab(reference[known]), _lab(shown[known]))
    return ChartColours(matrix, delta_e, patches, float(np.abs(slope).max()))


@lru_cache(maxsize=1)
def reference_colours() -> NDArray[np.float64]:
    """Return linear sRGB (24, 3) of the chart's patches, row by row; cyan's red is below 0. See `fit_colours`."""
    import cv2

    # OpenCV hands its table out with a fit alone.
    model = cv2.ccm.ColorCorrectionModel(np.full((24, 1, 3), 0.5), cv2.ccm.COLORCHECKER_MACBETH)
    model.setMaxCount(1)
    model.compute()
    return np.asarray(model.getRefLinearRGB(), np.float64).reshape(24, 3)


def _lab(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return CIE L*a*b* (N, 3), D65, of linear sRGB."""
    from skimage.color import colorconv, xyz2lab

    return xyz2lab(linear @ colorconv.xyz_from_rgb.T)
