"""Uncalibrated normals from diffuse maxima: where an image of a matte surface peaks, the normal faces the light.

Looks at all pixels at once. Memory: 9 bytes a sample beside the samples themselves.
"""

import cv2
import numba
import numpy as np

from solve.uncalibrated.front_end import family
from solve.uncalibrated.normals_and_lights import finish

WHOLE = True
CALIBRATED = False

SETTINGS = {
    "robust": True,
    "sign": "outline",
    "smooth_px": 2.0,
    "brightness": 0.5,
    "most_maxima": 2500,
    "agreement": 0.3,
    "fewest_distinct": 25,
}
SEED_SETTINGS = SETTINGS | {"robust": False, "sign": "arbitrary", "agreement": np.inf, "fewest_distinct": 0}
"""The plain reading: no cleaning of the samples, no rescue of the sign, every crossing has a vote."""

FEWEST_CROSSINGS = 3
CONCENTRATED = 0.5
_NEAR = 0.25
_MARGIN = 8


def fit_whole(
    gray,
    valid,
    points,
    geometry,
    mask,
    *,
    robust,
    sign,
    smooth_px,
    brightness,
    most_maxima,
    agreement,
    fewest_distinct,
):
    """Fit b = albedo x normal, and the lights.

    Parameters
    ----------
    gray : (P, F) float32
    valid : (P, F) bool
        Not clipped.
    points, geometry
        Not used.
    mask : (H, W) bool
        Of P pixels.
    robust : bool
        See `front_end.family`. The maxima are then those of the matte images that it leaves.
    sign : str
        See `finish.finish`.
    smooth_px : float
        Gaussian under the derivatives, and under the images before their maxima are looked for.
    brightness : float
        Maxima under this share of an image's range are none.
    most_maxima : int
        The brightest, relative to their image, take part: their pairs are counted.
    agreement : float
        Greatest difference of log lambda between the two maxima of a crossing.
    fewest_distinct : int
        A pixel that is a maximum under two lights is a bright spot of the albedo, and dropped. With fewer maxima
        than this left, all in the brightest quarter are taken.

    Returns
    -------
    Whole

    Notes
    -----
    At a maximum with pseudo-normal N and pseudo-light L, [N1 + mu N3, N2 + nu N3, lambda N3] is parallel to
    [L1, L2, (L3 - mu L1 - nu L2) / lambda] [Favaro2012]. With (mu, nu) = (-N1, -N2) / N3 + t (L1, L2) this is
    lambda^2 = t (c - q t), c = N.L / N3, q = L1^2 + L2^2: a segment of (mu, nu), with lambda above it. Every pair of
    segments that cross gives a candidate; the median over all, each number by itself, is what is taken. Medians
    follow a bas-relief transform of the start, so that the result does not depend on it.

    Do not believe it where no normal faces a light (flat reliefs, lights beyond the visible normals), on texture
    without smooth regions, nor on gloss that is not cleaned away: its maxima face halfway to the camera. It says so
    by crossings that do not concentrate.
    """
    found = family(gray, valid, mask, robust=robust, smooth_px=smooth_px)
    clean = found.rendered() if robust else gray
    doubts = []
    pixel, frame, height, times = maxima(clean, mask, smooth_px, brightness)
    distinct = times < 2
    if np.count_nonzero(distinct) < fewest_distinct:
        doubts.append(
            f"only {np.count_nonzero(distinct)} maxima move with the light, expected {fewest_distinct}: texture hides "
            "the others."
        )
        distinct = height > 0.5 + brightness / 2
    chosen = np.flatnonzero(distinct)
    chosen = chosen[np.lexsort((pixel[chosen], -height[chosen]))[:most_maxima]]
    numbers = crossings(found.b[pixel[chosen]], found.lights[frame[chosen]], agreement)
    if len(numbers) < FEWEST_CROSSINGS:
        doubts.append(f"only {len(numbers)} pairs of diffuse maxima agree on a relief: tilt and depth are not known.")
        return finish(found, 0.0, 0.0, 1.0, mask, sign, doubts)
    middle = np.median(numbers, axis=0)
    depth = float(np.exp(middle[2]))
    near = np.mean(np.all(np.abs((numbers - middle) / [depth, depth, 1]) < _NEAR, axis=1))
    if near < CONCENTRATED:
        doubts.append(
            f"{near:.0%} of the crossings of diffuse maxima are near their median, expected {CONCENTRATED:.0%}: "
            "maxima that are none (texture, gloss) outvote the others."
        )
    return finish(found, float(middle[0]), float(middle[1]), depth, mask, sign, doubts)


def maxima(images, mask, smooth_px, brightness):
    """Find the maxima of each image, away from the outline.

    Parameters
    ----------
    images : (P, F) float32
    mask : (H, W) bool
    smooth_px, brightness : float
        See `fit_whole`.

    Returns
    -------
    pixel, frame : (M,) int
    height : (M,) float
        0 at the image's darkest, 1 at its brightest pixel.
    times : (M,) int
        In how many images a maximum lies here or beside.
    """
    top, left = (int(np.flatnonzero(mask.any(axis)).min()) for axis in (1, 0))
    bottom, right = (int(np.flatnonzero(mask.any(axis)).max()) + 1 for axis in (1, 0))
    inside = np.pad(mask[top:bottom, left:right], _MARGIN)
    share = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), smooth_px)
    inner = cv2.erode(inside.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    beside = np.ones((3, 3), np.uint8)
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(len(images))
    times = np.zeros(inside.shape, np.int32)
    field = np.zeros(inside.shape, np.float32)
    places, frames, heights = [], [], []
    for frame in range(images.shape[1]):
        field[inside] = images[:, frame]
        smooth = cv2.GaussianBlur(field, (0, 0), smooth_px) / np.maximum(share, 1e-6)
        smooth[~inside] = 0
        low, high = float(smooth[inside].min()), float(smooth[inside].max())
        peak = (smooth >= cv2.dilate(smooth, beside)) & inner & (smooth > low + brightness * (high - low))
        times += cv2.dilate(peak.astype(np.uint8), beside)
        place = np.flatnonzero(peak)
        places.append(place)
        frames.append(np.full(len(place), frame))
        heights.append((smooth.ravel()[place] - low) / max(high - low, 1e-30))
    place = np.concatenate(places)
    return number.ravel()[place], np.concatenate(frames), np.concatenate(heights), times.ravel()[place]


def crossings(normals, lights, agreement):
    """Return (C, 3) mu, nu, log lambda where the segments of two maxima cross; see `fit_whole`.

    Parameters
    ----------
    normals, lights : (M, 3) float64
        Pseudo-normal and pseudo-light of each maximum.
    agreement : float
        Greatest difference of log lambda.
    """
    usable = np.abs(normals[:, 2]) > 1e-9
    return _crossings(normals[usable], lights[usable], agreement)


@numba.njit(nogil=True, cache=True)
def _crossings(normals, lights, agreement):  # pragma: no cover
    count = len(normals)
    start = -normals[:, :2] / normals[:, 2:]
    along = lights[:, :2]
    reach = np.sum(normals * lights, 1) / normals[:, 2]
    square = np.sum(along * along, 1)
    out = np.empty((count * (count - 1) // 2, 3))
    size = 0
    for i in range(count):
        for j in range(i):
            area = along[i, 0] * along[j, 1] - along[i, 1] * along[j, 0]
            if area == 0.0:
                continue
            x, y = start[j, 0] - start[i, 0], start[j, 1] - start[i, 1]
            t = (x * along[j, 1] - y * along[j, 0]) / area
            u = (x * along[i, 1] - y * along[i, 0]) / area
            first, second = t * (reach[i] - square[i] * t), u * (reach[j] - square[j] * u)
            if first > 0.0 and second > 0.0 and abs(np.log(first / second)) <= 2.0 * agreement:
                out[size, 0] = start[i, 0] + t * along[i, 0]
                out[size, 1] = start[i, 1] + t * along[i, 1]
                out[size, 2] = 0.25 * np.log(first * second)
                size += 1
    return out[:size]
