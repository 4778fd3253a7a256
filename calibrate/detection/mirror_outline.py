"""Which circle about a mirror's highlights is its outline.

A chrome ball shows the edge of the table as a dark disc, some 0.7 of its radius wide, with a sharper edge than its own
outline: that differs from the table beside it only by the metal's reflectance. So every circle about the highlights on
which static edges agree is a hypothesis, and the mirror's law decides: inside its outline the ball shows the table
that the same photographs show outside of it (`fit_mirrored_table`).

Static is what the median over the frames keeps of the logarithm's gradient [Weiss2001]: a shadow's edge that passes in
some of the frames leaves no trace, an edge of reflectance stays.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.detection.circles import gradient, rank
from calibrate.detection.coarse import Coarse
from calibrate.detection.evidence import Points
from calibrate.silhouette.mirrored_fit import SURE, MirroredTable
from calibrate.silhouette.mirrored_table import NOTHING_KNOWN, Beside, fit_mirrored_table, mirrored_share
from calibrate.silhouette.outline import circles_apart, sampled, share_in_picture
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
Candidate = tuple[Sphere, Points]
Slopes = NDArray[np.float32]
SAME_POINTS, SAME_POINTS_PX = 0.7, 2.0
"""Share of the frames in which circles of one mirror show the light at one place, to so many pixels."""
LOG_FLOOR = 0.01  # of the mean's 0.9 quantile, added before the logarithm
RAYS, MOST_EDGES = 96, 10  # directions in which edges are looked for, and edges along each, the steepest
NEAREST, FARTHEST = 0.5, 2.0  # radii of the circle that is known between which they are looked for
LEAST_SLOPE = 0.02  # change per pixel, relative, from which on there is a static edge,
ALONG = 0.8  # and the share of its gradient that points along the ray
TRIPLES = 2000  # circles that are tried, each through three edges of different directions
OFF_CENTER = 0.45  # radii by which a circle's centre may differ from the known one's
OFF_START = 0.12  # radii from which on the rays are sent out again from the centre of the circle found
TOLERANCE_PX, TOLERANCE = 0.75, 0.012  # distance, and share of the radius, at which an edge supports a circle
LEAST_SUPPORT = 0.3  # share of the rays that must support a circle
MOST_SUPPORTED = 40  # circles that are looked at, the best supported
SAME_PX, SAME_SHARE = 1.5, 0.05  # px, and radii, within which two circles are the same one
HORIZON, HORIZON_SIGMA = 0.7, 0.08
"""Radius of the table's edge as a ball shows it, in its own: sin 45 degrees for a table seen from above; its spread."""
TRIED = 4  # circles about a mirror on which its law is tried, the likeliest by their edges; and as many by the share
LEAST_EXPLAINED = 0.9  # share from which on a circle, fitted roughly or as it is, is worth a whole fit
WHOLE = 2  # different circles, those that the table explains best, from which a whole fit begins
FARTHEST_MOVED = 0.3  # radii by which the law may move a circle
FRAMES = 6  # in which it is tried


def by_points(candidates: list[Candidate]) -> list[list[Candidate]]:
    """Return groups of circles that show the light at the same places: one mirror, its outline and what it mirrors."""
    groups: list[list[Candidate]] = []
    places: list[Array] = []
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


def circles_about(static: Slopes, sphere: Sphere) -> list[Sphere]:
    """Return the circles about a mirror on which static edges agree, the likeliest outline first.

    `static` is `static_slopes`; `sphere`, in its pixels, any circle that holds the mirror's highlights. The score is
    the share of directions that show an edge on the circle.
    """
    kept = _supported(static, sphere)
    if kept and np.hypot(*(kept[0].center_px - sphere.center_px)) > OFF_START * kept[0].radius_px:
        kept = _supported(static, kept[0])
    return sorted(kept, key=lambda one: -_worth(one, kept))


def _supported(static: Slopes, sphere: Sphere) -> list[Sphere]:
    """Return the different circles that edges along the rays from one's centre support, the best supported first."""
    places, turn = _edges_along_rays(static, sphere)
    if len(turn) < RAYS // 4:
        return []
    centers, radii = _through_three(places, turn, sphere)
    support = np.array([_support(places, turn, *circle)[0] for circle in zip(centers, radii, strict=True)])
    kept: list[Sphere] = []
    for n in np.argsort(-support, kind="stable"):
        if support[n] < LEAST_SUPPORT or len(kept) == MOST_SUPPORTED:
            break
        one = replace(sphere, center_px=centers[n], radius_px=float(radii[n]))
        if all(_differ(one, other) for other in kept):
            near = places[_support(places, turn, one.center_px, one.radius_px)[1]]
            # The circle nearest to its edges: x^2 + y^2 = 2 x u + 2 y v + (r^2 - u^2 - v^2).
            design = np.column_stack([2 * near, np.ones(len(near))])
            u, v, rest = np.linalg.lstsq(design, np.sum(near**2, 1), rcond=None)[0]
            center, radius = np.array([u, v]), float(np.sqrt(max(rest + u * u + v * v, 1.0)))
            share, _ = _support(places, turn, center, radius)
            kept.append(replace(one, center_px=center, radius_px=radius, score=share))
    return kept


def _support(places: Array, turn: NDArray[np.intp], center: Array, radius: float) -> tuple[float, NDArray[np.bool_]]:
    """Return the share of the rays with an edge on a circle, and which edges (E,) lie on it."""
    near = np.abs(np.hypot(*(places - center).T) - radius) < max(TOLERANCE_PX, TOLERANCE * radius)
    return len(np.unique(turn[near])) / RAYS, near


def _edges_along_rays(static: Slopes, sphere: Sphere) -> tuple[Array, NDArray[np.intp]]:
    """Return the places (E, 2) of static edges along rays from the centre, and the number (E,) of each one's ray."""
    turns = np.arange(RAYS) * (2 * np.pi / RAYS)
    way = np.stack([np.cos(turns), np.sin(turns)], -1)
    far = np.arange(NEAREST * sphere.radius_px - 1, FARTHEST * sphere.radius_px + 1, max(0.5, sphere.radius_px / 200))
    places = sphere.center_px + far[:, None, None] * way
    slopes = sampled(static, places)
    along, steepness = np.abs(np.sum(slopes * way, -1)), np.hypot(slopes[..., 0], slopes[..., 1])
    here = along[1:-1]
    peak = (here >= along[:-2]) & (here > along[2:]) & (here > LEAST_SLOPE) & (here > ALONG * steepness[1:-1])
    height, width = static.shape[:2]
    peak &= np.all((places >= 1) & (places <= [width - 2, height - 2]), -1)[1:-1]
    strength = np.where(peak, here, 0)
    if len(strength) > MOST_EDGES:
        peak &= strength >= np.partition(strength, -MOST_EDGES, axis=0)[-MOST_EDGES]
    at, turn = np.nonzero(peak)
    return places[at + 1, turn], turn


def _through_three(places: Array, turn: NDArray[np.intp], sphere: Sphere) -> tuple[Array, Array]:
    """Return centres (C, 2) and radii (C,) of circles through three edges that lie well apart."""
    three = np.random.default_rng(0).integers(0, len(turn), (4 * TRIPLES, 3))
    turns = np.sort(turn[three], axis=1)
    apart = np.diff(turns, axis=1, append=turns[:, :1] + RAYS).min(1)
    a, b, c = places[three[apart > RAYS // 6][:TRIPLES]].swapaxes(0, 1)
    ab, ac = b - a, c - a
    cross = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    square_b, square_c = np.sum(ab**2, 1), np.sum(ac**2, 1)
    offset = np.stack([ac[:, 1] * square_b - ab[:, 1] * square_c, ab[:, 0] * square_c - ac[:, 0] * square_b], -1)
    offset /= np.where(cross == 0, np.nan, cross)[:, None]
    centers, radii = a + offset, np.hypot(*offset.T)
    near = np.hypot(*(centers - sphere.center_px).T) < OFF_CENTER * radii
    near &= (radii > NEAREST * sphere.radius_px) & (radii < FARTHEST * sphere.radius_px)
    return centers[near], radii[near]


def _worth(one: Sphere, circles: list[Sphere]) -> float:
    """Return how likely a circle is an outline: its own support, and that of a table's edge mirrored in it."""

    def horizon(other: Sphere) -> float:
        inside = np.hypot(*(other.center_px - one.center_px)) + other.radius_px < one.radius_px
        ratio = other.radius_px / one.radius_px
        return other.score * float(np.exp(-0.5 * ((ratio - HORIZON) / HORIZON_SIGMA) ** 2)) if inside else 0.0

    return one.score + max(horizon(other) for other in circles)


def by_mirrored_table(
    frames: Frames, camera: Camera, circles: list[Sphere], *, blur_px: float, beside: Beside = NOTHING_KNOWN
) -> MirroredTable | None:
    """Return the outline in which a ball mirrors the table beside it best, or None.

    Its score is the share explained of what the picture's border leaves of it.

    `circles` are those about its highlights, the likeliest first. `beside`: what is known of what stands beside it.
    """
    fit = partial(fit_mirrored_table, frames.some(FRAMES), camera, blur_px=blur_px, beside=beside)
    share = partial(mirrored_share, frames, camera, blur_px=blur_px, beside=beside)
    tables = _rough(fit, circles[:TRIED])
    if all(table.explained < SURE for table in tables):
        # Not before: of a plain table every circle mirrors much.
        tables += _rough(fit, sorted(circles[TRIED:], key=lambda one: -share(one))[:TRIED])
    tables = sorted(tables, key=lambda one: -one.explained)
    starts = [one.begin[:2] for one in _different(tables)[:WHOLE] if one.explained > LEAST_EXPLAINED]
    # On a texture the outline may be no static edge, but the table's edge in the ball is one.
    about = replace(circles[0], radius_px=circles[0].radius_px / HORIZON)
    for sphere, plane in [*starts, (about, None)]:
        if plane is None and share(sphere) < LEAST_EXPLAINED:
            continue
        best = fit(sphere, start=plane)
        if best and best.is_seen(beside.plane):
            seen = share_in_picture(camera, best.sphere)
            return best._replace(sphere=replace(best.sphere, score=seen * best.explained))
    return None


def _different(tables: list[MirroredTable]) -> list[MirroredTable]:
    """Return the first of each circle."""
    kept: list[MirroredTable] = []
    for one in tables:
        if all(_differ(one.sphere, other.sphere) for other in kept):
            kept.append(one)
    return kept


def _differ(one: Sphere, other: Sphere) -> bool:
    return circles_apart(one, other) > max(SAME_PX, SAME_SHARE * one.radius_px)


def _rough(fit: Callable[..., MirroredTable | None], circles: list[Sphere]) -> list[MirroredTable]:
    """Return the rough fits of circles that stay near them; not of one that another's sure fit has found already."""
    tables: list[MirroredTable] = []
    for circle in circles:
        if all(one.explained < SURE or _differ(one.sphere, circle) for one in tables):
            one = fit(circle, rough=True)
            if one and circles_apart(one.sphere, circle) < FARTHEST_MOVED * circle.radius_px:
                tables.append(one)
    return tables
