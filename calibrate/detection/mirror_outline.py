"""Which of the circles about a mirror's highlights is its outline.

A mirror squeezes half of the room into its last pixels: inside its outline many edges are static, outside lies the
table, smooth. And shadows are never static. So the evidence is what the median over the frames keeps of the
logarithm's gradient [Weiss2001]: a shadow's edge that passes in some of the frames leaves no trace, an edge of
reflectance stays.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d, uniform_filter1d

from calibrate.detection.ball_kind import Points
from calibrate.detection.circles import gradient, rank, refine_on_edges
from calibrate.detection.coarse import Coarse
from calibrate.silhouette.outline import across, circles_apart, inside_picture, outline_with_normals, sampled
from scene.camera import Camera
from scene.spheres import Sphere

Candidate = tuple[Sphere, Points]
Slopes = NDArray[np.float32]
SAME_POINTS, SAME_POINTS_PX = 0.7, 2.0
"""Share of the frames in which circles of one mirror show the light at one place, to so many pixels."""
LOG_FLOOR = 0.01  # of the mean's 0.9 quantile, added before the logarithm
LEAST_SLOPE = 0.012  # change per pixel, relative, from which on there is a static edge
INSIDE_PX, INSIDE_SHARE, OUTSIDE_PX, OUTSIDE_SHARE = 2.5, 0.05, 3.0, 0.08
"""How far to both sides of a circle its edges are looked at: pixels at least, radii; from `GAP_PX` outside on."""
GAP_PX = 2.25
MORE = 1.3  # times as strong as outside must the edges inside of a mirror's outline be
ALONG_PX = 4.0  # what is an edge of a circle follows it for so long
ENOUGH = 0.65  # share of the best circle's worth that a mirror's outline has at least
LEAST_ENCLOSED = 0.55  # share of its points with which a mirror's outline encloses something
MOST = 4  # wider circles that are looked into
EDGE_SLOPE = 0.03  # slope that counts half as an edge when such a circle is moved to its place
CLOSE = 0.08  # difference in worth up to which it is open which of two circles is a mirror's outline
POINTS = 120  # of a circle


def by_points(candidates: list[Candidate]) -> list[list[Candidate]]:
    """Return groups of circles that show the light at the same places: one mirror, its outline and what it mirrors."""
    groups: list[list[Candidate]] = []
    places: list[NDArray[np.float64]] = []
    for sphere, points in sorted(candidates, key=lambda c: -rank(c[0])):
        here = sphere.center_px + sphere.radius_px * points.track
        for group, there in zip(groups, places, strict=True):
            if np.mean(np.hypot(*(here - there).T) < SAME_POINTS_PX) >= SAME_POINTS:
                group.append((sphere, points))
                break
        else:
            groups.append([(sphere, points)])
            places.append(here)
    return groups


def static_slopes(coarse: Coarse) -> Slopes:
    """Return (h, w, 2): the slope of the stack's logarithm along u and v, per pixel, all that moves left out."""
    floor = LOG_FLOOR * float(np.quantile(coarse.images.mean(0), 0.9)) + 1e-6
    slopes = np.empty((2, *coarse.images.shape), np.float32)
    for n, image in enumerate(coarse.images):
        slopes[:, n] = gradient(np.log(np.maximum(cv2.GaussianBlur(image, (0, 0), 1.0), 0) + floor))
    return np.ascontiguousarray(np.moveaxis(np.median(slopes, axis=1), 0, -1))


def enclosing(static: Slopes, camera: Camera, sphere: Sphere) -> float:
    """Return the share of the circle just inside of which the edges are clearly stronger than outside of it, 0 to 1.

    `static` is `static_slopes`; `sphere` in its pixels.
    """
    points, normals = outline_with_normals(camera, sphere, POINTS)
    inward, outward = _reach(sphere.radius_px)
    offsets = np.concatenate([np.linspace(-inward, 0.75, 6), np.linspace(GAP_PX, GAP_PX + outward, 5)])
    where = across(points, normals, offsets).astype(np.float32)
    known = inside_picture(camera, where).all(1)
    if known.sum() < POINTS / 2:
        return 0.0
    slopes = sampled(static, where)
    # Across the circle, smoothed along it: print that runs across it counts less than what follows it.
    width = max(1, round(ALONG_PX * len(points) / (2 * np.pi * sphere.radius_px)))
    values = np.abs(uniform_filter1d(np.sum(slopes * normals[:, None], -1), width, axis=0, mode="wrap"))[known]
    inside, outside = values[:, :6].max(1), values[:, 6:].mean(1)
    least = max(LEAST_SLOPE, 0.4 * float(np.median(inside)))
    return float(np.mean((inside > MORE * outside) & (inside > least)))


def _reach(radius_px: float) -> tuple[float, float]:
    """Return how far inside and outside of a circle its edges are looked at, px."""
    return max(INSIDE_PX, INSIDE_SHARE * radius_px), max(OUTSIDE_PX, OUTSIDE_SHARE * radius_px)


def wider_circles(static: Slopes, camera: Camera, sphere: Sphere) -> list[Sphere]:
    """Return circles about as large as a mirror's `sphere` and larger that enclose static edges, with their score.

    The rim that a mirror shows is easily found, its faint outline is not: so each circle that is no more than a fifth
    of the radius off its centre is asked.
    """
    radius, turns = sphere.radius_px, np.arange(POINTS) * (2 * np.pi / POINTS)
    way = np.stack([np.cos(turns), np.sin(turns)], -1)
    step = max(0.5, radius / 60)
    far = np.arange(0.7 * radius, 2.0 * radius, step)
    where = (sphere.center_px + far[:, None, None] * way).astype(np.float32)
    slopes = np.abs(np.sum(sampled(static, where) * way, -1))
    inward, outward = (round(reach / step) for reach in _reach(radius))
    here = np.arange(len(far))
    inside = maximum_filter1d(slopes, inward, axis=0)[np.maximum(here - inward // 2, 0)]
    beyond = here + round(GAP_PX / step) + outward // 2
    outside = uniform_filter1d(slopes, outward, axis=0)[np.minimum(beyond, len(far) - 1)]
    # 1 where a circle's point encloses something, 0 where not; out of the picture nothing is known.
    encloses = (inside > MORE * outside) & (inside > LEAST_SLOPE)
    marks = np.where(inside_picture(camera, where), encloses, np.nan).astype(np.float32)
    shifts = np.arange(-5, 6) * (0.04 * radius)
    radii = np.arange(0.95 * radius, 1.5 * radius, step)
    scores = np.zeros((len(shifts), len(shifts), len(radii)), np.float32)
    for i, v in enumerate(shifts):
        for k, u in enumerate(shifts):
            # Beside the centre a circle's points lie at r + the shift's part along their direction, to first order.
            at = np.rint((radii[:, None] + way @ [u, v] - far[0]) / step).astype(int)
            scores[i, k] = np.nanmean(marks[np.clip(at, 0, len(far) - 1), np.arange(POINTS)], axis=1)
    peak = (scores == maximum_filter(scores, size=5)) & (scores > LEAST_ENCLOSED)
    best = sorted(zip(*np.nonzero(peak), strict=True), key=lambda at: -scores[at])[:MOST]
    du, dv = static[..., 0], static[..., 1]
    square = (du**2 + dv**2 + EDGE_SLOPE**2)[..., None]
    edges = np.asarray(np.stack([du**2 - dv**2, 2 * du * dv], -1) / square, np.float32)
    found = []
    for i, k, n in best:
        circle = replace(sphere, center_px=sphere.center_px + [shifts[k], shifts[i]], radius_px=float(radii[n]))
        found.append(refine_on_edges(edges, camera, circle))
    return found


def outline_of(group: list[Candidate], static: Slopes, camera: Camera) -> tuple[list[Candidate], bool]:
    """Return a group's circles that may be the mirror's outline, the best first, and whether the second is as good.

    A chrome ball shows the rim of the table as a dark disc with a sharper edge than its own outline, which differs
    from the table beside it only by the metal's reflectance. Whatever is mirrored lies inside: the outline holds all
    other circles of the group that enclose something.
    """
    shares = [sphere.score * enclosing(static, camera, sphere) for sphere, _ in group]
    kept: list[tuple[float, Candidate]] = []
    for share, one in sorted(zip(shares, group, strict=True), key=lambda one: -one[0]):
        if all(circles_apart(one[0], other[0]) > max(1.5, 0.05 * other[0].radius_px) for _, other in kept):
            kept.append((share, one))
    group = [one for _, one in kept]
    center = np.array([sphere.center_px for sphere, _ in group])
    radius = np.array([sphere.radius_px for sphere, _ in group])
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
