"""Which of a ball's bright points is the flash: the one on which the balls agree."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.adjustment import ray_meeting
from calibrate.lights.directions import mean_directions, mirrored_rays
from calibrate.lights.highlight import Spots
from scene.camera import Camera
from scene.normals import angular_error_deg
from scene.spheres import Sphere

Array = NDArray[np.float64]


def agreeing_spots(
    camera: Camera, spheres: list[Sphere], spots: list[Spots], measurable: bool, flags: list[list[str]]
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Choose one bright point per ball and frame: the brightest, unless others agree between balls much better.

    Returns pixels (S, F, 2), their sigma (S, F), and which was chosen (S, F), 0 for the brightest.
    """
    pixels = np.stack([s.pixels[:, 0] for s in spots])
    sigma = np.stack([s.sigma_px[:, 0] for s in spots])
    picks = np.zeros(sigma.shape, np.intp)
    if len(spheres) < 2:
        return pixels, sigma, picks
    rays = [mirrored_rays(camera, sphere, s.pixels) for sphere, s in zip(spheres, spots, strict=True)]

    def miss_deg(f: int, pick: tuple[int, ...]) -> float:
        points = np.stack([rays[s][0][f, k] for s, k in enumerate(pick)])
        directions = np.stack([rays[s][1][f, k] for s, k in enumerate(pick)])
        good = np.isfinite(directions[:, 0])
        if good.sum() < 2:
            return 0.0
        points, directions = points[good], directions[good]
        target = np.broadcast_to(mean_directions(directions[:, None])[0], directions.shape)
        if measurable:
            meeting = ray_meeting(points, directions)
            toward = meeting - points
            if np.isfinite(meeting).all() and np.sum(toward * directions) > 0:
                target = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        return float(angular_error_deg(directions, target).max())

    first = (0,) * len(spheres)
    usual = np.median([miss_deg(f, first) for f in range(pixels.shape[1])])
    for f in range(pixels.shape[1]):
        plain = miss_deg(f, first)
        if plain < max(2.0, 4 * usual):
            continue
        options = [range(max(1, int(np.isfinite(s.pixels[f, :3, 0]).sum()))) for s in spots[:4]]
        options += [range(1)] * (len(spots) - 4)
        pick = min(product(*options), key=lambda p: miss_deg(f, p) + 0.5 * sum(p))
        if miss_deg(f, pick) < 0.4 * plain:
            picks[:, f] = pick
            for s, k in enumerate(pick):
                pixels[s, f], sigma[s, f] = spots[s].pixels[f, k], spots[s].sigma_px[f, k]
                if k:
                    flags[f].append(f"a brighter point on chrome ball {s + 1} is not the flash")
    return pixels, sigma, picks
