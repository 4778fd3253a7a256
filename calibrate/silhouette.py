"""A ball's outline to hundredths of a pixel: the cone that a sphere cuts, three unknowns, no free ellipse."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.limb import MATTE, MIRROR, MIRROR_CLOSE, MIRROR_FREE, SHARPEST_PX, STEP_PX, Limb, Shifts, measure
from calibrate.outline import moved, offset_jacobian, outline_with_normals
from calibrate.standing import agree, find_edges, kernel_reach_px, robust_step
from calibrate.strips import image_strips, read_strips
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
Reader = Callable[[Array, Array, Array], NDArray[np.float32]]
"""Takes points (N, 2), normals (N, 2) and offsets (M,) to strips (F, N, M)."""
SECTORS = 24
"""Errors along an outline come in arcs (a shadow, a reflection): an arc counts as one observation."""
SOFTEST = 8
"""Softness, in that of a sharp picture, up to which an outline is looked for."""
LEAST_SEEN = 0.25
EDGE_FLOOR_PX, EDGE_FLOOR_SHARE = 0.05, 0.35
"""What shifts an outline that is fitted on the steepest places alone, beyond its edges' scatter."""
LIMB_FLOOR_PX, LIMB_FLOOR_SHARE = 0.01, 0.5
"""The same of a limb's profile: a constant, and a share of what another profile would change."""
PROFILE_PX = 0.1
"""What a single profile errs by, however little noise it has: the limb is never quite the model's."""


@dataclass(frozen=True)
class OutlineFit:
    """A fitted ball.

    Parameters
    ----------
    sphere : Sphere
        With `sigma_px` and `score`, the share of the outline on which an edge was found where the fit is.
    covariance : (3, 3) float64
        Of (center u, center v, radius), px^2.
    residual_px : float
        Robust spread of the edges about the outline.
    blur_px : float
        Standard deviation of the blur under which the limb is seen; NaN where only its edge was fitted.
    """

    sphere: Sphere
    covariance: Array
    residual_px: float
    blur_px: float = np.nan


def fit_outline(frames: Frames, camera: Camera, sphere: Sphere, *, search_px: float) -> OutlineFit | None:
    """Fit the ball's outline in all frames at full size.

    Parameters
    ----------
    frames : Frames
    camera : Camera
    sphere : Sphere
        The start.
    search_px : float
        How far from the start the outline may lie.

    Returns
    -------
    OutlineFit or None
        None if less than a quarter of the outline shows an edge.
    """

    def read(points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
        return read_strips(frames, points, normals, offsets)

    best: list[OutlineFit] = []
    best_softness = softness = 1
    while softness <= SOFTEST and (softness == 1 or sphere.radius_px > 20 * softness):
        fits = _fit_edges(read, camera, sphere, max(search_px, 1.5 * softness), softness)
        if fits and (not best or fits[0].sphere.score > best[0].sphere.score + 0.15):
            best, best_softness = fits, softness
        if best and best[0].sphere.score >= 0.6:
            break
        softness *= 2
    if not best:
        return None
    return _fit_limb(read, camera, best, sphere, float(best_softness)) or best[0]


def fit_mask(mask: NDArray[np.bool_], camera: Camera, sphere: Sphere) -> OutlineFit | None:
    """Fit the outline to a given silhouette (H, W) bool."""
    image = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)

    def read(points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
        return image_strips(image, points, normals, offsets)

    fits = _fit_edges(read, camera, sphere, max(3.0, 0.06 * sphere.radius_px), 1)
    return fits[0] if fits else None


def best_outline(fits: list[OutlineFit], kind: Kind) -> OutlineFit | None:
    """Return the best of some fits of one ball, or None of none.

    On a matte ball the one on which most of the outline agrees wins; a mirror's outline runs beside the rims that
    it mirrors, all of them inside, and so of equals the outermost wins.
    """
    if not fits:
        return None
    if kind == "white":
        return max(fits, key=lambda fit: fit.sphere.score / max(fit.residual_px, 0.15))
    best = max(fit.sphere.score for fit in fits)
    return max((fit for fit in fits if fit.sphere.score >= 0.9 * best), key=lambda fit: fit.sphere.radius_px)


def _fit_edges(read: Reader, camera: Camera, sphere: Sphere, search_px: float, softness: int) -> list[OutlineFit]:
    """Fit the outline to the steepest places across it, from three radii; return the fits, the best first."""
    starts = [np.array([0.0, 0.0, share * search_px]) for share in (-0.5, 0.0, 0.5)]
    fits = _agreements(read, camera, sphere, starts, search_px, softness)
    best = best_outline(fits, sphere.kind)
    if best is None:
        return []
    again = _agreements(read, camera, best.sphere, [np.zeros(3)], 2.0 * softness, softness)
    return [*(again or [best]), *(fit for fit in fits if fit is not best)]


def _agreements(
    read: Reader, camera: Camera, sphere: Sphere, starts: list[Array], search_px: float, softness: int
) -> list[OutlineFit]:
    """Return the outlines, near each start, on which edges agree."""
    count = int(np.clip(2 * np.pi * sphere.radius_px, 120, 720))
    points, normals = outline_with_normals(camera, sphere, count)
    jacobian = offset_jacobian(camera, sphere, points, normals)
    reach = search_px + 1 + kernel_reach_px(softness)
    offsets = np.arange(-reach, reach + 0.01, STEP_PX)
    spacing = float(np.linalg.norm(np.roll(points, -1, 0) - points, axis=1).mean())
    strips = read(points, normals, offsets)
    edges = find_edges(strips, offsets, spacing, softness=softness, search_px=search_px + 1)
    out: list[OutlineFit] = []
    for start in starts if edges else []:
        one = agree(edges, jacobian, start=start, reach_px=search_px, closest_px=0.35 * softness)
        if one is None or np.abs(one.shift).max() > 3 * search_px or one.score < LEAST_SEEN:
            continue
        floor = (EDGE_FLOOR_PX * softness) ** 2 + (EDGE_FLOOR_SHARE * one.spread) ** 2
        seen = replace(moved(sphere, one.shift), score=one.score, sigma_px=float(np.sqrt(floor)))
        out.append(OutlineFit(seen, floor * np.eye(3), one.spread))
    return out


def _fit_limb(
    read: Reader, camera: Camera, edges: list[OutlineFit], start: Sphere, softness: float
) -> OutlineFit | None:
    """Fit the outline with the limb's own profile, from where its edges are steepest; None where it does not hold."""
    edge = edges[0]
    if start.kind == "white":
        # Where the ball is as bright as the table its edges are its terminators': the profiles decide among the starts.
        tried: list[_Settled] = []
        for sphere in [*(fit.sphere for fit in edges), start]:
            if all(_apart(sphere, other.sphere) > 0.3 for other in tried):
                fit = _settle(read, camera, sphere, Limb(MATTE, sphere.radius_px, softness), free_blur=True)
                tried += [fit] if fit else []
        if not tried:
            return None
        last = min(tried, key=lambda fit: fit.doubt)
        floor = LIMB_FLOOR_PX**2
    else:
        first = _settle(read, camera, edge.sphere, Limb(MIRROR, start.radius_px, softness, 0.7), free_blur=True)
        if first is None:
            return None
        last = _settle(read, camera, first.sphere, replace(first.limb, terms=MIRROR_CLOSE), free_blur=False)
        last = last or first
        gap = max(_apart(last.sphere, other) for other in (first.sphere, edge.sphere))
        floor = LIMB_FLOOR_PX**2 + (LIMB_FLOOR_SHARE * gap) ** 2 / 3
        if _apart(last.sphere, edge.sphere) > 0.6 * softness + 0.4:
            return None
    covariance = last.covariance + floor * np.eye(3)
    sigma = float(np.sqrt((covariance[0, 0] + covariance[1, 1]) / 2))
    sphere = replace(last.sphere, sigma_px=sigma, score=edge.sphere.score)
    return OutlineFit(sphere, covariance, edge.residual_px, last.limb.blur_px)


def _apart(a: Sphere, b: Sphere) -> float:
    """Return how far two outlines differ, px."""
    return float(np.hypot(np.hypot(*(a.center_px - b.center_px)), a.radius_px - b.radius_px))


@dataclass(frozen=True)
class _Settled:
    sphere: Sphere
    limb: Limb
    covariance: Array
    doubt: float


def _settle(read: Reader, camera: Camera, sphere: Sphere, limb: Limb, *, free_blur: bool) -> _Settled | None:
    """Move the outline, and the blur, until the limb's profiles fit."""
    mirror = limb.mirror > 0
    for turn in range(10):
        count = int(np.clip(2 * np.pi * sphere.radius_px, 120, 480))
        points, normals = outline_with_normals(camera, sphere, count)
        jacobian = offset_jacobian(camera, sphere, points, normals)
        reach = 2.6 * limb.blur_px + 2
        inward = reach
        if mirror:  # what a mirror shows farther in is no longer what lies around the ball
            share, blurs = (0.12, 2.0) if "slope" in limb.terms else (0.06, 1.5)
            inward = min(reach, max(share * sphere.radius_px, blurs * limb.blur_px + 0.5))
        offsets = np.arange(-inward, reach + 0.01, STEP_PX)
        strips = read(points, normals, offsets)
        limb = replace(limb, radius_px=sphere.radius_px)
        weighty = 1.0
        if mirror:
            limb, weighty = _reflectance(strips, offsets, limb)
        shifts = measure(strips, offsets, limb)
        weight = weighty * shifts.information / (1 + PROFILE_PX**2 * shifts.information) * (np.abs(shifts.offset) < 1.5)
        rows = np.tile(jacobian, (len(strips), 1))
        tukey = max(0.3 * max(1, limb.blur_px), 0.6**turn)
        step = robust_step(rows, shifts.offset, weight, tukey)
        if step is None or np.abs(step).max() > 2 * limb.blur_px + 1:
            return None
        sphere = moved(sphere, step)
        change = shifts.blur_px / limb.blur_px - 1 if free_blur else 0.0
        limb = replace(limb, blur_px=limb.blur_px * (1 + change))
        if turn >= 4 and np.abs(step).max() < 1e-3 and abs(change) < 2e-3:
            break
    residual = shifts.offset - rows @ step
    kept = weight * np.maximum(1 - (residual / tukey) ** 2, 0) ** 2
    sector = np.tile(np.arange(count) * SECTORS // count, len(strips))
    covariance = _clustered_covariance(rows, residual, kept, sector)
    return None if covariance is None else _Settled(sphere, limb, covariance, shifts.doubt)


def _reflectance(strips: NDArray[np.float32], offsets: Array, limb: Limb) -> tuple[Limb, Array]:
    """Return the limb with its reflectance as the strips show it, and which profiles (P,) show a mirror's limb.

    What a mirror shows at its limb is dimmer than what lies behind it. Where it is brighter, the ball's own shadow
    lies beside it and is mirrored in less than a pixel.
    """
    seen: Shifts = measure(strips, offsets, replace(limb, terms=MIRROR_FREE, mirror=0.0))
    ratio = seen.amplitudes[:, 0] / np.maximum(seen.amplitudes[:, 2], 1e-4)
    clear = (ratio > 0.2) & (ratio < 0.97) & (seen.information > 0)
    if clear.mean() < 0.2:
        return limb, np.ones(len(ratio))
    calm = clear & (seen.misfit < 2)
    reflectance = float(np.median(ratio[calm])) if calm.sum() > 20 else limb.mirror
    return replace(limb, mirror=reflectance), clear.astype(np.float64)


def _clustered_covariance(jacobian: Array, residual: Array, weight: Array, sector: NDArray[np.intp]) -> Array | None:
    """Return the (3, 3) covariance of a weighted fit whose errors agree within a sector.

    Notes
    -----
    The sandwich H^-1 (sum_s g_s g_s^T) H^-1, g_s = sum over the sector's edges of w r J, times S / (S - 3).
    Thousands of edges on one outline are not thousands of observations: the same arc errs alike in all frames.
    """
    normal = jacobian.T @ (weight[:, None] * jacobian)
    scores = weight[:, None] * residual[:, None] * jacobian
    sums = np.stack([scores[sector == s].sum(0) for s in np.unique(sector[weight > 0])])
    if len(sums) < 5 or np.linalg.cond(normal) > 1e8:
        return None
    inverse = np.linalg.inv(normal)
    return inverse @ (sums.T @ sums) @ inverse * len(sums) / (len(sums) - 3)
