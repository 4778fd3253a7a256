"""Which of the bright places on the balls is the flash: that on which the balls agree."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.balls import Ball
from calibrate.lights.directions import Shading, arc_miss_deg, mirrored_rays
from calibrate.lights.highlight import Peaks, Spots, find_peaks, find_spots
from calibrate.silhouette.mirrored_surroundings import sized
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
Index = NDArray[np.intp]
AGREE_DEG = 2.5  # error of what two balls show of one light
BY_CHANCE = 5.0  # what places of different lights cost at most: -log of how often chance makes two agree
DIMMER = 2.5  # what a place costs, times the -log of its height in the brightest one's: clipped ones are alike


def agreed_spots(camera: Camera, balls: Sequence[Ball], shading: Shading) -> list[Spots]:
    """Locate the flash on mirror balls in each frame, at the bright places on which they agree."""
    peaks = [find_peaks(ball.frames, ball.coarse, ball.sphere) for ball in balls]
    chosen = agreed(camera, [ball.sphere for ball in balls], peaks, shading)
    each = zip(balls, peaks, chosen, strict=True)
    return [find_spots(ball.frames, camera, ball.coarse, ball.sphere, one, which) for ball, one, which in each]


def agreed(camera: Camera, spheres: Sequence[Sphere], peaks: Sequence[Peaks], shading: Shading) -> list[Index]:
    """Return for each mirror which (F,) of its bright places is the flash: those on which the balls agree.

    White balls count where they and all mirrors have a diameter, which says where they stand. What the flash lights
    brightly (a table's gloss, a white wall) may be brighter in a mirror than the flash. Of all sets of one place each,
    these are looked at: all the brightest; and each place, with what agrees best with it.
    """
    if not peaks:
        return []
    is_placed = all(sphere.diameter_mm for sphere in spheres)
    placed = spheres if is_placed else [sized(sphere) for sphere in spheres]
    centers = [np.zeros(3) if camera.is_orthographic else sphere.center_mm(camera) for sphere in placed]
    rays = [mirrored_rays(camera, sphere, one.pixels)[1] for sphere, one in zip(placed, peaks, strict=True)]
    dimmer = [-DIMMER * np.log(one.strength / one.strength[:, :1]) for one in peaks]
    own = [np.where(np.isfinite(ray[..., 0]), cost, np.inf) for ray, cost in zip(rays, dimmer, strict=True)]
    for directions, clear, center in zip(shading.directions, shading.clear, shading.centers_mm, strict=True):
        if np.isfinite(center).all() and is_placed:
            centers.append(center)
            rays.append(directions[:, None])
            own.append(np.where(clear, 0.0, np.inf)[:, None])
    # What is not seen costs as much in each set.
    own = [np.where(np.isfinite(cost).any(1, keepdims=True), cost, 0.0) for cost in own]
    pairs: dict[tuple[int, int], Array] = {}
    for s, t in combinations(range(len(rays)), 2):
        miss = arc_miss_deg(centers[s], rays[s], centers[t], rays[t])
        pairs[s, t] = np.nan_to_num(np.minimum(0.5 * (miss / AGREE_DEG) ** 2, BY_CHANCE), nan=BY_CHANCE)
        # Each ball errs once, however many others it is held against.
        pairs[s, t] /= len(rays) - 1
        pairs[t, s] = pairs[s, t].swapaxes(1, 2)
    frames = np.arange(len(own[0]))

    def total(places: Index) -> Array:
        """Return the cost (F,) of one place (N, F) on each ball."""
        alone = sum(cost[frames, at] for cost, at in zip(own, places, strict=True))
        return np.asarray(alone + sum(pairs[s, t][frames, places[s], places[t]] for s, t in pairs if s < t))

    sets = [np.zeros((len(rays), len(frames)), np.intp)]
    for s in range(len(peaks)):
        for k in range(rays[s].shape[1]):
            best = [
                (pairs[s, t][:, k] + own[t]).argmin(1) if t != s else np.full(len(frames), k) for t in range(len(rays))
            ]
            sets.append(np.stack(best))
    chosen = np.stack(sets)[np.stack([total(one) for one in sets]).argmin(0), :, frames]
    return list(chosen.T[: len(peaks)])
