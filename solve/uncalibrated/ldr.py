"""Uncalibrated normals from diffuse maxima: where an image of a matte surface peaks, the normal faces the light."""

import cv2
import numpy as np
from scipy.ndimage import find_objects

from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.uncalibrated.front_end import PLAIN, SMOOTH_PX, FrontEnd, family, finish

BRIGHT, MOST_MAXIMA = 0.5, 2500
"""Maxima under this share of an image's range are none; how many of them, the brightest of their images, take part."""
AGREE, FEWEST_DISTINCT = 0.3, 25
"""Greatest difference of log lambda between the two maxima of a crossing. A pixel that is a maximum under two lights is
a bright spot of the albedo, and dropped; with fewer left than this, all in the brightest quarter are taken. The plain
reading has neither: every crossing has a vote, and there is no rescue of the sign."""
CONCENTRATED = 0.5
_NEAR = 0.25


def fit_whole(problem: Problem, samples: Samples, settings: FrontEnd) -> Whole:
    """Fit b = albedo x normal, and the lights.

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
    mask = problem.mask
    found = family(samples, mask, settings)
    clean = found.rendered() if settings.robust else samples.gray
    cautions = []
    pixel, frame, height, times = maxima(clean, mask)
    distinct = times < 2
    if settings.robust and np.count_nonzero(distinct) < FEWEST_DISTINCT:
        cautions.append(
            f"only {np.count_nonzero(distinct)} maxima move with the light, expected {FEWEST_DISTINCT}: "
            "texture hides the others."
        )
        distinct = height > 0.5 + BRIGHT / 2
    chosen = np.flatnonzero(distinct)
    chosen = chosen[np.lexsort((pixel[chosen], -height[chosen]))[:MOST_MAXIMA]]
    agreement = AGREE if settings.robust else np.inf
    numbers = crossings(found.b[pixel[chosen]], found.lights[frame[chosen]], agreement)
    if len(numbers) < 3:
        cautions.append(f"only {len(numbers)} pairs of diffuse maxima agree on a relief: tilt and depth are not known.")
        return finish(found, (0.0, 0.0, 1.0), mask, settings, *cautions)
    middle = np.median(numbers, axis=0)
    depth = float(np.exp(middle[2]))
    near = np.mean(np.all(np.abs((numbers - middle) / [depth, depth, 1]) < _NEAR, axis=1))
    if near < CONCENTRATED:
        cautions.append(
            f"{near:.0%} of the crossings of diffuse maxima are near their median, expected {CONCENTRATED:.0%}: "
            "maxima that are none (texture, gloss) outvote the others."
        )
    return finish(found, (float(middle[0]), float(middle[1]), depth), mask, settings, *cautions)


def maxima(images, mask):
    """Find the maxima of each image, away from the outline.

    `images` are (P, F) float32, those under the mask. Returns, for each maximum, pixel, frame, height (0 at the image's
    darkest, 1 at its brightest pixel), and in how many images one lies here or beside.
    """
    inside = np.pad(mask[find_objects(mask.view(np.uint8))[0]], 8)
    share = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), SMOOTH_PX)
    inner = cv2.erode(inside.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    beside = np.ones((3, 3), np.uint8)
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(len(images))
    times = np.zeros(inside.shape, np.int32)
    field = np.zeros(inside.shape, np.float32)
    places, frames, heights = [], [], []
    for frame in range(images.shape[1]):
        field[inside] = images[:, frame]
        smooth = cv2.GaussianBlur(field, (0, 0), SMOOTH_PX) / np.maximum(share, 1e-6)
        smooth[~inside] = 0
        low, high = float(smooth[inside].min()), float(smooth[inside].max())
        peak = (smooth >= cv2.dilate(smooth, beside)) & inner & (smooth > low + BRIGHT * (high - low))
        times += cv2.dilate(peak.astype(np.uint8), beside)
        place = np.flatnonzero(peak)
        places.append(place)
        frames.append(np.full(len(place), frame))
        heights.append((smooth.ravel()[place] - low) / max(high - low, 1e-30))
    place = np.concatenate(places)
    return number.ravel()[place], np.concatenate(frames), np.concatenate(heights), times.ravel()[place]


def crossings(normals, lights, agreement):
    """Return (C, 3) mu, nu, log lambda where the segments of two maxima cross; see `fit_whole`.

    Each maximum has a pseudo-normal and a pseudo-light, (M, 3) float64.
    """
    usable = np.abs(normals[:, 2]) > 1e-9
    normals, lights = normals[usable], lights[usable]
    start, along = -normals[:, :2] / normals[:, 2:], lights[:, :2]
    reach, square = np.sum(normals * lights, 1) / normals[:, 2], np.sum(along * along, 1)
    found = [np.empty((0, 3))]
    for i in range(1, len(start)):
        (x, y), (right, up) = (start[:i] - start[i]).T, along[:i].T
        area = along[i, 0] * up - along[i, 1] * right
        with np.errstate(divide="ignore", invalid="ignore"):
            t, u = (x * up - y * right) / area, (x * along[i, 1] - y * along[i, 0]) / area
            first, second = t * (reach[i] - square[i] * t), u * (reach[:i] - square[:i] * u)
            agree = (area != 0) & (first > 0) & (second > 0) & (np.abs(np.log(first / second)) <= 2 * agreement)
        t, both = t[agree], first[agree] * second[agree]
        found.append(np.column_stack([start[i] + t[:, None] * along[i], 0.25 * np.log(both)]))
    return np.concatenate(found)


METHOD = Method("ldr", {"default": FrontEnd(), "seed": PLAIN}, fit_whole=fit_whole, is_calibrated=False)
