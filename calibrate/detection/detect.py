"""Every ball in the frames, without clicks: circles of static edges, judged by how their insides behave."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.choice import Judged, Suspect, choose, considered, matte_rays, mirror_rays, own_log_odds
from calibrate.detection.circles import distinct, overlap, static_circles
from calibrate.detection.coarse import Box, Coarse
from calibrate.detection.evidence import Change, Points, bright_points, changes, shaded
from calibrate.detection.mirror_outline import (
    Candidate,
    by_mirrored_table,
    by_points,
    circles_about,
    static_slopes,
)
from calibrate.silhouette.ball_silhouette import TABLE_FROM_PX, OutlineFit, fit_outline
from calibrate.silhouette.explained_profiles import laws_of
from calibrate.silhouette.mirrored_fit import MirroredTable
from calibrate.silhouette.mirrored_surroundings import shared_plane
from calibrate.silhouette.mirrored_table import Beside
from draw.readable import share
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

THREADS = 2  # outlines that are fitted side by side
SMALL_PX = 20.0  # radius under which the flash's image is so blurred that a mirror is asked on less evidence
LEAST_SUPPORT = 0.4  # share of a mirror's outline that must stand still where no table is seen in it
ALIKE = 4, 2  # circles of static slopes, and of static edges, that may be a mirror's outline
LEAST_SHADING = 0.8  # share of its brightness that shading must explain for a circle to be looked at as a matte ball
LEAST_BRIGHT = (
    0.01  # share of the picture's bright parts at which a matte ball begins: below is a dark backdrop's noise
)
LEAST_LEFT, MOST_GAIN = (3e-3, 1e-2), 0.05
"""Limits of features: what shading leaves, what of the outline is not seen; what another body's shading explains."""
LEAST_MIRRORED, LEAST_AREA, USUAL_PX, LARGEST_PX = 0.9, 2e-3, 30.0, 90.0  # of others: where they begin, or end
BESIDE, SEEN = (1.1, 1.5), 0.05  # radii around a ball, and share of the picture's bright parts at which these are seen
GROWN = 0.98, 1.02  # of its radius: circles beside a mirror's
HINT_SIDE, HINT_MARGIN_PX = 1.3, 4  # radii, and pixels, around a hint that are looked into; `HINT_LEAST_PX` at least
HINT_LEAST_PX = 24
MOST_HINTED = 3  # circles about a hint, of which two may be a mirror's outlines


@dataclass(frozen=True)
class Rejected:
    """A circle that is not taken for a ball of its kind; `reason` says why."""

    kind: Kind
    center_px: NDArray[np.float64]
    radius_px: float
    score: float
    probability: float
    reason: str


class _Circles(NamedTuple):
    """Circles about one mirror's highlights, coarse pixels."""

    about: list[Sphere]  # of static edges, the likeliest outline first
    pointed: list[Sphere]  # in which the light was seen as a wandering point, the best first


def detect(
    frames: Frames,
    camera: Camera,
    coarse: Coarse,
    *,
    wanted: dict[Kind, int] | None = None,
    taken: tuple[Sphere, ...] = (),
) -> tuple[list[OutlineFit], tuple[Rejected, ...]]:
    """Find the balls: the likeliest set, never more of a kind than were wanted; and the circles that are none.

    `coarse` holds the same frames, shrunk. `wanted`: how many of each kind were asked for; None: whatever there is.
    Circles on the balls that are `taken` already are left alone.
    """
    suspects = considered(find_suspects(frames, camera, coarse, [coarse.from_full(s) for s in taken]))
    if wanted and not wanted.get("white"):
        # A glossy ball that is asked for as a mirror serves as one.
        suspects = [replace(s, sphere=replace(s.sphere, kind="chrome")) if s.glossy else s for s in suspects]
    chosen, left = choose(suspects, wanted)
    found: list[OutlineFit] = []
    places = list(chosen)
    for one in sorted(left, key=lambda one: -one.log_odds):
        if not any(overlap(one.suspect.sphere, other.suspect.sphere) for other in places):
            places.append(one)
    rejected = [_rejected(coarse, one, one.suspect.doubt) for one in places[len(chosen) :]]
    starts = [coarse.sphere_to_full(one.suspect.sphere) for one in chosen]
    shown = [one.suspect.table for one in chosen]
    tables = [table for table in shown if table]
    plane = shared_plane([table.plane for table in tables])
    # Also where no table was seen in small: here it is seen without the other balls, which hide it.
    laws = laws_of([table.is_fresnels for table in tables])

    def outline(start: Sphere, table: MirroredTable | None) -> OutlineFit | None:
        others = [*taken, *(other for other in starts if other is not start)]
        known = Beside(plane, laws, others)
        return fit_outline(frames, camera, start, search_px=coarse.search_px, shown=table, beside=known)

    with ThreadPoolExecutor(THREADS) as threads:
        fits = list(threads.map(outline, starts, shown))
    for one, fit in zip(chosen, fits, strict=True):
        if fit is None:
            rejected.append(_rejected(coarse, one, "its outline cannot be followed at full size"))
        else:
            found.append(replace(fit, is_open=_unexplained(coarse, fit)))
    return found, tuple(sorted(rejected, key=lambda r: -r.probability))


def _unexplained(coarse: Coarse, fit: OutlineFit) -> bool:
    """Whether a ball stands on a table that is seen, and is a mirror that does not show it."""
    if fit.by_table or fit.sphere.kind == "white" or fit.sphere.radius_px < TABLE_FROM_PX:
        return False
    small, mean = coarse.from_full(fit.sphere), coarse.images.mean(0)
    box = coarse.box(small, BESIDE[1])
    rows, columns = box.grid
    far = np.hypot(columns - small.center_px[0], rows - small.center_px[1]) / small.radius_px
    beside = mean[box][(far > BESIDE[0]) & (far < BESIDE[1])]
    return bool(len(beside) and np.median(beside) > SEEN * np.quantile(mean, 0.9))


def _rejected(coarse: Coarse, one: Judged, doubt: str) -> Rejected:
    sphere = coarse.sphere_to_full(one.suspect.sphere)
    reason = f"a {sphere.kind} ball with a probability of {share(one.probability)} %{doubt and ': '}{doubt}"
    return Rejected(sphere.kind, sphere.center_px, sphere.radius_px, sphere.score, one.probability, reason)


def find_suspects(frames: Frames, camera: Camera, coarse: Coarse, taken: Sequence[Sphere] = ()) -> list[Suspect]:
    """Return the circles, coarse pixels, that may be balls, not on those `taken`; one place may hold several."""
    change = changes(coarse)
    circles = [c for c in static_circles(coarse) if not any(overlap(c, other) for other in taken)]
    seen = [(circle, bright_points(change, circle)) for circle in circles]
    pointed = [(c, p) for c, p in seen if p and (p.wander or (p.may_wander and c.radius_px < SMALL_PX))]
    matte = _matte(coarse, seen)
    # They hide the table from a mirror.
    balls = [*taken, *(one.sphere for one in matte if own_log_odds(one) > 0)]
    return _mirrors(frames, camera, coarse, change, pointed, balls) + matte


def _matte(coarse: Coarse, circles: list[tuple[Sphere, Points | None]]) -> list[Suspect]:
    """Return the circles that shade about as matte balls do."""
    suspects: list[Suspect] = []
    mean = coarse.images.mean(0)
    least = LEAST_BRIGHT * np.quantile(mean, 0.99)
    for circle, points in circles:
        there = mean[coarse.box(circle)]
        if not there.size or np.median(there) < least:
            continue
        seen = shaded(coarse, circle, least=LEAST_SHADING)
        if seen is not None:
            beyond = [float(np.clip(gain, -MOST_GAIN, MOST_GAIN)) for gain in (seen.flatter, seen.taller)]
            unseen = -np.log(max(1 - circle.score, LEAST_LEFT[1]))
            features = [1, -np.log(max(1 - seen.share, LEAST_LEFT[0])), *beyond, unseen, _size(circle)]
            sphere = replace(circle, kind="white")
            glossy = points is not None and points.wander
            suspects.append(Suspect(sphere, "white", np.array(features), matte_rays(coarse, sphere, seen), glossy))
    return suspects


def _size(sphere: Sphere) -> float:
    """Return the log radius; larger than the scenes' to which weights were fitted, a ball is neither more nor less."""
    return float(np.log(min(sphere.radius_px, LARGEST_PX) / USUAL_PX))


def _mirrors(
    frames: Frames,
    camera: Camera,
    coarse: Coarse,
    change: list[Change],
    pointed: list[Candidate],
    balls: list[Sphere],
) -> list[Suspect]:
    """Return the circles that show the light as a wandering point, those that mirror the table beside them first.

    `balls`, coarse pixels: others, which hide the table.
    """
    suspects: list[Suspect] = []
    shown: list[tuple[MirroredTable, _Circles]] = []
    static = static_slopes(coarse)

    def is_taken(seed: Sphere) -> bool:
        return any(overlap(seed, coarse.from_full(table.sphere)) for table, _ in shown)

    def mirrored(circles: _Circles, tables: list[MirroredTable]) -> MirroredTable | None:
        # A table that one mirror shows is the others', too.
        others = [*(coarse.sphere_to_full(ball) for ball in balls), *(table.sphere for table in tables)]
        others = [ball for ball in others if not overlap(coarse.from_full(ball), circles.pointed[0])]
        beside = Beside(shared_plane([table.plane for table in tables]), others=others)
        for some in circles:
            full = [coarse.sphere_to_full(circle) for circle in some]
            table = by_mirrored_table(frames, camera, full, blur_px=coarse.factor, beside=beside)
            if table is not None:
                return table
        return None

    def look(circles: _Circles) -> None:
        table = mirrored(circles, [table for table, _ in shown])
        if table is not None:
            shown.append((table, circles))

    again: list[_Circles] = []
    for group in by_points(pointed):
        first = [circle for circle, _ in group]
        if is_taken(first[0]):
            continue
        circles = _Circles(circles_about(static, first[0]) or first[:1], first)
        look(circles)
        if not shown:
            again.append(circles)
        for circle in [c for c in circles.about[: ALIKE[0]] if c.score >= LEAST_SUPPORT] + first[: ALIKE[1]]:
            suspects += _mirror(coarse, change, circle, None)
    # Where the table lies was not known yet.
    for circles in again if shown else ():
        if not is_taken(circles.pointed[0]):
            look(circles)
    # All stand on one table: of two that show different ones, one errs.
    for n, (table, circles) in enumerate(shown):
        tables = [other for other, _ in shown if other is not table]
        plane = shared_plane([other.plane for other in tables])
        if plane and table.plane.contradicts(plane):
            other = mirrored(circles, tables)
            shown[n] = other if other and other.explained > table.explained else table, circles
    mirrors = [_mirror(coarse, change, coarse.from_full(table.sphere), table) for table, _ in shown]
    return [*chain.from_iterable(mirrors), *suspects]


def _mirror(coarse: Coarse, change: list[Change], circle: Sphere, shown: MirroredTable | None) -> list[Suspect]:
    """Return a circle as a mirror, if it may be one. `shown`: the table beside it, where that explains it."""
    points, seen = bright_points(change, circle), shaded(coarse, circle)
    if points is None or seen is None or not points.may_wander:
        return []
    table = [0, 0, circle.score] if shown is None else [1, max(circle.score - LEAST_MIRRORED, 0), 0]
    area = np.log(max(points.area, LEAST_AREA))
    shares = [seen.share]
    if shown is not None:
        # Chance shades a mirror, but not in a circle beside; what is matte shades wherever it is looked at.
        beside = [shaded(coarse, replace(circle, radius_px=grown * circle.radius_px)) for grown in GROWN]
        shares += [one.share for one in beside if one]
    features = [1, *table, area, float(np.clip(min(shares), 0, 1)), points.inside, _size(circle)]
    sphere = replace(circle, kind="chrome")
    rays = mirror_rays(coarse, change, sphere)
    return [Suspect(sphere, "chrome", np.array(features, np.float64), rays, glossy=True, table=shown)]


def around_hint(coarse: Coarse, hint: Sphere, *, reach_px: float) -> list[Sphere]:
    """Return circles of static edges, full-size pixels, near a circle given by hand; the best supported first.

    Centre and radius may lie `reach_px`, full-size, from the hint's.
    """
    small, reach = coarse.from_full(hint), reach_px / coarse.factor
    side = HINT_SIDE * small.radius_px + 2 * reach + HINT_MARGIN_PX
    left, top = corner = np.maximum(np.floor(small.center_px - side), 0).astype(int)
    right, bottom = np.ceil(small.center_px + side).astype(int) + 1
    box = Box(slice(top, bottom), slice(left, right))
    if min(coarse.images[0][box].shape) < HINT_LEAST_PX:
        return []
    crop = coarse.crop(box)

    def near(sphere: Sphere) -> bool:
        off = np.hypot(*(sphere.center_px + corner - small.center_px))
        return bool(max(off, abs(sphere.radius_px - small.radius_px)) < reach)

    circles = [sphere for sphere in static_circles(crop) if near(sphere)]
    found = distinct(circles)[:MOST_HINTED]
    if hint.kind == "chrome":
        about = circles_about(static_slopes(crop), replace(small, center_px=small.center_px - corner))
        found = distinct([circle for circle in about if near(circle)][:2] + found[:1])
    return [coarse.sphere_to_full(replace(s, kind=hint.kind, center_px=s.center_px + corner)) for s in found]
