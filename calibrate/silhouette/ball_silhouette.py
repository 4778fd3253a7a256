"""A ball's outline to hundredths of a pixel: the cone that a sphere cuts, three unknowns, no free ellipse."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.cone_fit import (
    MATTE,
    MIRROR,
    MIRROR_CLOSE,
    MIRROR_START,
    STEP_PX,
    ConeFit,
    EdgeModel,
    Reader,
    fit_cone,
)
from calibrate.silhouette.mirrored_fit import MirroredTable
from calibrate.silhouette.mirrored_table import NOTHING_KNOWN, Beside, fit_mirrored_table
from calibrate.silhouette.outline import (
    KERNEL_REACH,
    agree,
    difference,
    find_edges,
    image_strips,
    moved,
    offset_jacobian,
    outline_with_normals,
    read_strips,
)
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
SOFTEST = 8  # softness, in that of a sharp picture, up to which an outline is looked for,
SOFT_RADII = 20  # and the ball's least radius for each
READ = 12  # frames in which an outline is read: it does not move, and more of them show the same again
LEAST_SEEN = 0.25  # share of the outline that must show an edge,
WELL_SEEN = 0.6  # and from which no softer edge is looked for
SOFTER_BETTER = 0.15  # by which a softer edge must be seen along more of the outline
SEARCH = 0.05  # radii by which a chrome ball's outline is searched around its coarse circle, at least
SEARCH_MASK = 0.06  # the same around a given mask's circle, 3 px at least
TABLE_FROM_PX = 12.0  # least radius for the mirrored table
TABLE_FLOOR_PX, TABLE_BLURS = 0.03, 20.0
"""What bends the mirrored table's outline beyond its residuals' scatter, sigma: on a large ball; radius, in blurs, of a
ball so small that the blur mixes what it mirrors, and as much comes to it. The first grows as a table seen aslant, by
1 / cos^2 of the angle: it shines, and the ball sees it from where the camera does not. By 44 balls of 15 to 73 px in
scenes of two generators by others."""
FLOOR_PX = 0.01  # what shifts an outline that is fitted by its profiles, beyond their residuals' scatter;
EDGE_FLOOR_PX, EDGE_FLOOR_SHARE = 0.05, 0.35  # the same by the steepest places alone: for softness 1, of their spread
SAME_PX = 0.3  # under which two places to start from are the same one
INSIDE_PX, INSIDE_DOUBT_PX, PROFILE_DOUBT_PX = 0.2, 0.25, 0.15
"""How far inside its outline, for softness 1, a mirror's steepest place lies, and how far that may err; the same of its
radius by profiles of one reflectance. A metal reflects all that meets it at its outline: there is no edge. In scenes of
two generators by others the steepest places lay 0.1 and 0.3 px inside (medians of 30 balls of 15 to 74 px); by profiles
13 of 15 radii are then within two sigma."""
PROFILE_SHARE = 0.5  # share of what another profile would change of a mirror's outline
BLUR_DOUBT_PX, BLUR_DOUBT = 1.3, 0.01
"""Relative error of the blur: read at a mirror's edge of radius r, the first over r; read on a matte ball."""
BLUR_AGREES = 0.15  # relative, up to which a mirror's blur and the matte balls' are the same


@dataclass(frozen=True)
class OutlineFit:
    """A fitted ball."""

    sphere: Sphere  # with `sigma_px` and `score`, the share of the outline on which an edge was found where the fit is
    covariance: Array  # (3, 3) of (u, v, radius), px^2
    residual_px: float  # robust spread of the edges about the outline
    blur_px: float = np.nan  # standard deviation of the blur; NaN where only the steepest places were fitted
    by_table: bool = False  # the table that a chrome ball mirrors was found and fits
    is_open: bool = False  # a mirror that does not show the table beside it: it may be the horizon in a larger one

    @property
    def clearness(self) -> float:
        return self.sphere.score / max(self.residual_px, 0.15)


def fit_outline(
    frames: Frames,
    camera: Camera,
    sphere: Sphere,
    *,
    search_px: float,
    shown: MirroredTable | None = None,
    beside: Beside = NOTHING_KNOWN,
) -> OutlineFit | None:
    """Fit the ball's outline at full size, in about `READ` of the frames together.

    The outline may lie `search_px` from the start. `shown`: the table that the ball mirrors, where that is known
    already; what other balls show of it, in `beside`, is not asked then. None if less than a quarter of the outline
    shows an edge.
    """
    read = _reader(frames)
    best: list[OutlineFit] = []
    best_softness = softness = 1
    while softness <= SOFTEST and (softness == 1 or sphere.radius_px > SOFT_RADII * softness):
        fits = _fit_edges(read, camera, sphere, max(search_px, 1.5 * softness), softness)
        if fits and (not best or fits[0].sphere.score > best[0].sphere.score + SOFTER_BETTER):
            best, best_softness = fits, softness
        if best and best[0].sphere.score >= WELL_SEEN:
            break
        softness *= 2
    if not best:
        return None
    if sphere.kind == "white":
        return _fit_matte(read, camera, best, sphere, float(best_softness)) or best[0]
    known = shown, beside._replace(plane=None) if shown else beside
    fit = _fit_chrome(frames, read, camera, best[0], sphere, known, float(best_softness))
    return fit or _by_edges(best[0], best_softness)


def table_floor_px(radius_px: float, blur_px: float, steepness: float = 0.0) -> float:
    """Return the least sigma of an outline that is fitted by the table that the ball mirrors, px.

    `steepness`: tangent of the angle between the table's normal and the view.
    """
    return TABLE_FLOOR_PX * (1 + steepness**2) * float(np.hypot(1, (TABLE_BLURS * blur_px / radius_px) ** 2))


def with_blur(frames: Frames, camera: Camera, fit: OutlineFit, blur_px: float) -> OutlineFit:
    """Return a chrome ball's fit with the blur that matte balls of the same photographs show, where they agree on it.

    What a mirror squeezes into its last pixels looks like blur; a matte ball tells the two apart.
    """
    if fit.sphere.kind != "chrome" or fit.by_table or not abs(fit.blur_px / blur_px - 1) < BLUR_AGREES:
        return fit
    read = _reader(frames)
    model = EdgeModel(MIRROR, fit.sphere.radius_px, blur_px, MIRROR_START)
    first = fit_cone(read, camera, fit.sphere, model, free_blur=False)
    again = _fit_mirror(read, camera, fit, first, BLUR_DOUBT) if first else fit
    return again if _apart(again.sphere, fit.sphere) < 0.5 * blur_px else fit


def fit_mask(mask: NDArray[np.bool_], camera: Camera, sphere: Sphere) -> OutlineFit | None:
    """Fit the outline to a given silhouette (H, W) bool."""
    image = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)

    def read(points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
        return image_strips(image, points, normals, offsets)

    fits = _fit_edges(read, camera, sphere, max(3.0, SEARCH_MASK * sphere.radius_px), 1)
    return fits[0] if fits else None


def best_outline(fits: list[OutlineFit], kind: Kind) -> OutlineFit:
    """Return the best of some fits of one ball.

    On a matte ball the one on which most of the outline agrees wins; a mirror's outline runs beside the rims that
    it mirrors, all of them inside, and so of equals the outermost wins.
    """
    if kind == "white":
        return max(fits, key=lambda fit: fit.clearness)
    best = max(fit.sphere.score for fit in fits)
    return max((fit for fit in fits if fit.sphere.score >= 0.9 * best), key=lambda fit: fit.sphere.radius_px)


def _reader(frames: Frames) -> Reader:
    some = frames.some(READ)

    def read(points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
        return read_strips(some, points, normals, offsets)

    return read


def _fit_edges(read: Reader, camera: Camera, sphere: Sphere, search_px: float, softness: int) -> list[OutlineFit]:
    """Fit the outline to the steepest places across it, from several radii; return the fits, the best first."""
    if sphere.kind == "chrome":
        # What a mirror shows along its rim draws the coarse circle inward, by some hundredths of its radius.
        search_px = max(search_px, SEARCH * sphere.radius_px)
        starts = [(share * search_px, reach * search_px) for reach in (1.0, 0.4) for share in (0.0, 0.4, 0.8)]
    else:
        starts = [(share * search_px, search_px) for share in (-0.5, 0.0, 0.5)]
    fits = _agreements(read, camera, sphere, starts, search_px, softness)
    if not fits:
        return []
    best = max(fits, key=lambda fit: fit.clearness)
    again = _agreements(read, camera, best.sphere, [(0.0, 2.0 * softness)], 2.0 * softness, softness)
    others = [fit for fit in fits if fit is not best]
    if again:
        # The nearest of those that show enough: a mirror's rims run beside its outline.
        enough, start = 0.8 * max(fit.sphere.score for fit in again), best.sphere
        best = min((fit for fit in again if fit.sphere.score >= enough), key=lambda fit: _apart(fit.sphere, start))
    return [best, *others]


def _agreements(
    read: Reader, camera: Camera, sphere: Sphere, starts: list[tuple[float, float]], search_px: float, softness: int
) -> list[OutlineFit]:
    """Return the outlines on which edges agree, from each start: what the radius is more, and the reach at first."""
    count = int(np.clip(2 * np.pi * sphere.radius_px, 120, 720))
    points, normals = outline_with_normals(camera, sphere, count)
    jacobian = offset_jacobian(camera, sphere, points, normals)
    reach = search_px + 1 + KERNEL_REACH * softness
    offsets = np.arange(-reach, reach + 0.01, STEP_PX)
    spacing = float(np.linalg.norm(np.roll(points, -1, 0) - points, axis=1).mean())
    strips = read(points, normals, offsets)
    out: list[OutlineFit] = []
    # Each frame by the mean of all, where there are others: a single one by itself shows edges that it has not.
    even = [strips / (np.maximum(strips.mean(0), 0) + 0.02 * np.nanmean(strips))] if len(strips) > 1 else []
    for values in [strips, *even]:
        edges = find_edges(values, offsets, spacing, softness=softness, search_px=search_px + 1)
        if edges is None:
            continue
        for more, first_reach in starts:
            start = np.array([0.0, 0.0, more])
            one = agree(edges, jacobian, start=start, reach_px=first_reach, closest_px=0.35 * softness)
            if one is None or np.abs(one.shift).max() > 1.5 * search_px or one.score < LEAST_SEEN:
                continue
            floor = (EDGE_FLOOR_PX * softness) ** 2 + (EDGE_FLOOR_SHARE * one.spread) ** 2
            seen = replace(moved(sphere, one.shift), score=one.score, sigma_px=float(np.sqrt(floor)))
            out.append(OutlineFit(seen, floor * np.eye(3), one.spread))
    return out


def _fit_matte(
    read: Reader, camera: Camera, edges: list[OutlineFit], start: Sphere, softness: float
) -> OutlineFit | None:
    """Fit the profiles of a matte ball's edge; None where they do not hold.

    Where the ball is as bright as the table its edges are its terminators': the profiles decide among the starts.
    """
    tried: list[ConeFit] = []
    for sphere in [*(fit.sphere for fit in edges), start]:
        if all(_apart(sphere, other.sphere) > SAME_PX for other in tried):
            fit = fit_cone(read, camera, sphere, EdgeModel(MATTE, start.radius_px, softness), free_blur=True)
            tried += [fit] if fit else []
    if not tried:
        return None
    best = min(tried, key=lambda fit: fit.misfit)
    nearest = min(edges, key=lambda fit: _apart(fit.sphere, best.sphere))
    return _finished(nearest, best.sphere, best.covariance, best.model.blur_px)


def _fit_chrome(
    frames: Frames,
    read: Reader,
    camera: Camera,
    edge: OutlineFit,
    start: Sphere,
    known: tuple[MirroredTable | None, Beside],
    softness: float,
) -> OutlineFit | None:
    """Fit a chrome ball by the table that it mirrors, else by a mirror's smooth profile; None if neither holds."""
    sphere, (shown, beside) = edge.sphere, known
    farthest = softness + SEARCH * sphere.radius_px
    # A small mirror's rims draw the edge away from where the search began.
    places = [sphere, *([start] if _apart(sphere, start) > SAME_PX else [])]
    tries = [(near, None, softness) for near in places]
    if shown:
        tries = [(shown.sphere, shown.plane.values, shown.blur_px), *tries]
    for near, begin, blur_px in tries if sphere.radius_px > TABLE_FROM_PX else ():
        table = fit_mirrored_table(frames, camera, near, blur_px=blur_px, beside=beside, start=begin)
        if table and table.is_seen(beside.plane) and _apart(table.sphere, near) < farthest:
            floor = table_floor_px(table.sphere.radius_px, table.blur_px, table.plane.steepness)
            doubt = np.hypot(floor, table.left_px)
            covariance = table.covariance + doubt**2 * np.eye(3)
            return replace(_finished(edge, table.sphere, covariance, table.blur_px), by_table=True)
    model = EdgeModel(MIRROR, sphere.radius_px, softness, MIRROR_START)
    first = fit_cone(read, camera, sphere, model, free_blur=True)
    if first is None:
        return None
    fit = _fit_mirror(read, camera, edge, first, BLUR_DOUBT_PX / sphere.radius_px)
    return fit if _apart(fit.sphere, sphere) < 0.6 * softness + 0.4 else None


def _fit_mirror(read: Reader, camera: Camera, edge: OutlineFit, first: ConeFit, blur_doubt: float) -> OutlineFit:
    """Fit a mirror's profiles where its blur is known to `blur_doubt`, relative."""
    last = fit_cone(read, camera, first.sphere, first.model._replace(terms=MIRROR_CLOSE), free_blur=False) or first
    sharper = last.model._replace(blur_px=(1 - blur_doubt) * last.model.blur_px)
    other = fit_cone(read, camera, last.sphere, sharper, free_blur=False)
    # What the model may err by: other profiles, another blur.
    doubts = [PROFILE_SHARE * difference(first.sphere, last.sphere)]
    doubts += [difference(other.sphere, last.sphere)] if other else []
    covariance = last.covariance + sum(np.outer(d, d) for d in doubts) + np.diag([0.0, 0.0, PROFILE_DOUBT_PX**2])
    return replace(_finished(edge, last.sphere, covariance, last.model.blur_px), is_open=edge.is_open)


def _by_edges(edge: OutlineFit, softness: float) -> OutlineFit:
    """Return a mirror's outline by its steepest places."""
    covariance = edge.covariance + (INSIDE_DOUBT_PX * softness) ** 2 * np.eye(3)
    return _finished(edge, moved(edge.sphere, np.array([0.0, 0.0, INSIDE_PX * softness])), covariance, np.nan)


def _finished(edge: OutlineFit, sphere: Sphere, covariance: Array, blur_px: float) -> OutlineFit:
    covariance = covariance + FLOOR_PX**2 * np.eye(3)
    sigma = float(np.sqrt(np.trace(covariance) / 3))
    return OutlineFit(replace(sphere, sigma_px=sigma, score=edge.sphere.score), covariance, edge.residual_px, blur_px)


def _apart(a: Sphere, b: Sphere) -> float:
    return float(np.linalg.norm(difference(a, b)))
