"""Which of the circles about a mirror's highlights is its outline.

A mirror squeezes half of the room into its last pixels: inside its outline much stands still, outside lies the table,
smooth. And shadows never stand still. So the evidence is what the median over the frames keeps of the logarithm's
gradient [Weiss2001]: a shadow's edge that passes in some of the frames leaves no trace, an edge of reflectance stays.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d, uniform_filter1d

from calibrate.detection.ball_kind import Points
from calibrate.detection.coarse import Coarse
from calibrate.silhouette.outline import outline_with_normals, refine_on_edges
from scene.camera import Camera
from scene.spheres import Sphere

Candidate = tuple[Sphere, Points]
LEAST_SLOPE = 0.012
"""Change per pixel, relative, from which on something stands there."""
ALONG_PX = 4.0
"""What is an edge of a circle follows it for so long."""
ENOUGH = 0.65
"""Share of the best circle's worth that a mirror's outline has at least."""
LEAST_ENCLOSED = 0.55
"""Share of its points with which a mirror's outline encloses something."""
DOUBTED = 0.8
"""Worth of a mirror's outline below which wider circles are asked, too: found ones show 0.85 and more."""
MOST = 4
"""Wider circles that are looked into."""
EDGE_SLOPE = 0.03
"""Slope that counts half as an edge when such a circle is moved to its place."""
CLOSE = 0.08
"""Difference in worth up to which it is open which of two circles is a mirror's outline."""


def what_stands(coarse: Coarse) -> NDArray[np.float32]:
    """Return (h, w, 2): the slope of the stack's logarithm along u and v, per pixel, all that moves left out."""
    floor = 0.01 * float(np.quantile(coarse.images.mean(0), 0.9)) + 1e-6
    slopes = np.empty((2, *coarse.images.shape), np.float32)
    for n, image in enumerate(coarse.images):
        smooth = np.log(np.maximum(cv2.GaussianBlur(image, (0, 0), 1.0), 0) + floor)
        slopes[0, n] = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8)
        slopes[1, n] = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
    return np.ascontiguousarray(np.moveaxis(np.median(slopes, axis=1), 0, -1))


def enclosing(standing: NDArray[np.float32], camera: Camera, sphere: Sphere) -> float:
    """Return the share of the circle just inside of which clearly more stands than outside of it, 0 to 1.

    `standing` is `what_stands`; `sphere` in its pixels.
    """
    points, normals = outline_with_normals(camera, sphere, 120)
    inward, outward = max(2.5, 0.05 * sphere.radius_px), max(3.0, 0.08 * sphere.radius_px)
    offsets = np.concatenate([np.linspace(-inward, 0.75, 6), np.linspace(2.25, 2.25 + outward, 5)])
    where = (points[:, None] + offsets[:, None] * normals[:, None]).astype(np.float32)
    known = np.all((where >= 0) & (where <= [camera.width - 1, camera.height - 1]), axis=(1, 2))
    if known.sum() < 60:
        return 0.0
    slopes = cv2.remap(standing, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    # Across the circle, smoothed along it: print that runs across it counts less than what follows it.
    width = max(1, round(ALONG_PX * len(points) / (2 * np.pi * sphere.radius_px)))
    values = np.abs(uniform_filter1d(np.sum(slopes * normals[:, None], -1), width, axis=0, mode="wrap"))[known]
    inside, outside = values[:, :6].max(1), values[:, 6:].mean(1)
    least = max(LEAST_SLOPE, 0.4 * float(np.median(inside)))
    return float(np.mean((inside > 1.3 * outside) & (inside > least)))


def around(standing: NDArray[np.float32], camera: Camera, sphere: Sphere) -> list[Sphere]:
    """Return circles about as large as a mirror's `sphere` and larger that enclose what stands, with their score.

    The rim that a mirror shows is easily found, its faint outline is not: so each circle that is no more than a fifth
    of the radius off its centre is asked.
    """
    radius, turns = sphere.radius_px, np.arange(120) * (2 * np.pi / 120)
    way = np.stack([np.cos(turns), np.sin(turns)], -1)
    step = max(0.5, radius / 60)
    far = np.arange(0.7 * radius, 2.0 * radius, step)
    where = (sphere.center_px + far[:, None, None] * way).astype(np.float32)
    known = np.all((where >= 0) & (where <= [camera.width - 1, camera.height - 1]), axis=-1)
    slopes = np.abs(np.sum(cv2.remap(standing, where[..., 0], where[..., 1], cv2.INTER_LINEAR) * way, -1))
    inward, outward = round(max(2.5, 0.05 * radius) / step), round(max(3.0, 0.08 * radius) / step)
    here = np.arange(len(far))
    inside = maximum_filter1d(slopes, inward, axis=0)[np.maximum(here - inward // 2, 0)]
    beyond = here + round(2.25 / step) + outward // 2
    outside = uniform_filter1d(slopes, outward, axis=0)[np.minimum(beyond, len(far) - 1)]
    # 1 where a circle's point encloses something, 0 where not; out of the picture nothing is known.
    marks = np.where(known, (inside > 1.3 * outside) & (inside > LEAST_SLOPE), np.nan).astype(np.float32)
    shifts = np.arange(-5, 6) * (0.04 * radius)
    radii = np.arange(0.95 * radius, 1.5 * radius, step)
    scores = np.zeros((len(shifts), len(shifts), len(radii)), np.float32)
    for i, v in enumerate(shifts):
        for k, u in enumerate(shifts):
            # Beside the centre a circle's points lie at r + the shift's part along their direction, to first order.
            at = np.rint((radii[:, None] + way @ [u, v] - far[0]) / step).astype(int)
            scores[i, k] = np.nanmean(marks[np.clip(at, 0, len(far) - 1), np.arange(120)], axis=1)
    peak = (scores == maximum_filter(scores, size=5)) & (scores > LEAST_ENCLOSED)
    best = sorted(zip(*np.nonzero(peak), strict=True), key=lambda at: -scores[at])[:MOST]
    square = np.sum(standing**2, -1) + EDGE_SLOPE**2
    edges = np.stack([standing[..., 0] ** 2 - standing[..., 1] ** 2, 2 * standing[..., 0] * standing[..., 1]], -1)
    edges /= square[..., None]
    found = []
    for i, k, n in best:
        circle = replace(sphere, center_px=sphere.center_px + [shifts[k], shifts[i]], radius_px=float(radii[n]))
        found.append(refine_on_edges(edges, camera, circle))
    return found


def outline_of(group: list[Candidate], standing: NDArray[np.float32], camera: Camera) -> tuple[list[Candidate], bool]:
    """Return a group's circles that may be the mirror's outline, the best first, and whether the second is as good.

    A chrome ball shows the rim of the table as a dark disc with a sharper edge than its own outline, which differs
    from the table beside it only by the metal's reflectance. Whatever is mirrored lies inside: the outline holds all
    other circles of the group that enclose something.
    """
    shares = [sphere.score * enclosing(standing, camera, sphere) for sphere, _ in group]
    good_first = sorted(zip(shares, group, strict=True), key=lambda one: -one[0])
    kept: list[tuple[float, Candidate]] = []
    for share, one in good_first:
        if all(_apart(one[0], other[0]) > max(1.5, 0.05 * other[0].radius_px) for _, other in kept):
            kept.append((share, one))
    group = [one for _, one in kept]
    spheres = [sphere for sphere, _ in group]
    center = np.array([sphere.center_px for sphere in spheres])
    radius = np.array([sphere.radius_px for sphere in spheres])
    good = np.array([share for share, _ in kept])
    apart = np.hypot(*(center[:, None] - center[None]).T).T
    holds = apart + radius[None] < 1.05 * radius[:, None] + 0.5
    weight = np.maximum(good - 0.3, 1e-3)
    worth = np.where(good >= ENOUGH * good.max(), good + holds @ weight / weight.sum(), 0)
    best = int(np.argmax(worth))
    differs = apart[best] + np.abs(radius - radius[best]) > np.maximum(2.0, 0.08 * radius[best])
    others = [i for i in np.argsort(-worth, kind="stable") if differs[i]]
    close = bool(others) and worth[others[0]] > worth[best] - CLOSE
    return [group[best], *(group[i] for i in others)], bool(close)


def _apart(a: Sphere, b: Sphere) -> float:
    return float(np.hypot(*(a.center_px - b.center_px))) + abs(a.radius_px - b.radius_px)
