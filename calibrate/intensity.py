"""A matte ball as a photometer: how bright each flash was, per channel, and what light was left over."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
MOST_PIXELS = 6000
FACING = 0.35
"""Cosine to the viewer under which the limb's blur and gloss begin."""
LIT = 0.2
"""Share of the brightest shading under which a large flash is half set behind the ball's horizon."""
FEWEST_PIXELS = 40
BLOCKS = 24


@dataclass(frozen=True)
class Skin:
    """A matte ball's surface and what it showed.

    Parameters
    ----------
    points, normals : (P, 3) float64
    values : (F, P, 3) float32
    clipped : (F, P) bool
    block : (P,) int
        Which patch of the ball a pixel lies in: errors agree within a patch.
    """

    points: Array
    normals: Array
    values: NDArray[np.float32]
    clipped: NDArray[np.bool_]
    block: NDArray[np.intp]


@dataclass(frozen=True)
class Photometry:
    """What the ball measured.

    Parameters
    ----------
    intensities : (F, 3) float64
        Pixel value of the ball's skin facing each light at the reference point. NaN where it could not be read.
    sigma : (F,) float64
        Relative, from the scatter between patches of the ball.
    ambient : (3,) float64
        Pixel value of light that is there in all frames alike, on the ball's skin.
    residual : float
        Relative rms of the fit, all frames.
    clipped : (F,) float64
        Share of the ball's pixels that are clipped.
    """

    intensities: Array
    sigma: Array
    ambient: Array
    residual: float
    clipped: Array


def read_skin(frames: Frames, camera: Camera, sphere: Sphere) -> Skin:
    """Read the pixels of the ball that face the camera, evenly thinned to `MOST_PIXELS`."""
    rows, columns = np.nonzero(sphere.mask(camera))
    pixels = np.stack([columns, rows], -1)
    normals, points = sphere.normals(camera, pixels)
    if camera.is_orthographic:
        facing = normals[:, 2]
    else:
        facing = -np.sum(normals * points, 1) / np.linalg.norm(points, axis=1)
    keep = np.flatnonzero(facing > FACING)
    keep = keep[:: max(1, len(keep) // MOST_PIXELS)]
    pixels, points, normals = pixels[keep], points[keep], normals[keep]
    if not len(keep):
        empty = np.zeros((len(frames), 0, 3), np.float32)
        return Skin(points, normals, empty, np.zeros((len(frames), 0), bool), np.zeros(0, np.intp))
    (left, top), (right, bottom) = pixels.min(0), pixels.max(0) + 1
    band, side = slice(int(top), int(bottom)), slice(int(left), int(right))
    at = (pixels[:, 1] - top, pixels[:, 0] - left)
    values = np.stack([frames.read(band, [f], columns=side)[0][at] for f in range(len(frames))])
    clipped = np.stack([frames.saturated(band, [f], columns=side)[0][at] for f in range(len(frames))])
    offset = pixels - sphere.center_px
    angle = np.arctan2(offset[:, 1], offset[:, 0]) + np.pi
    outer = np.hypot(*offset.T) > 0.6 * sphere.radius_px
    block = (angle / (2 * np.pi) * (BLOCKS // 2)).astype(np.intp) % (BLOCKS // 2) + outer * (BLOCKS // 2)
    return Skin(points, normals, values, clipped, block)


def measure(skin: Skin, directions: Array, positions: Array | None, reference: Array) -> Photometry:
    """Read each light's intensity from the ball's shading.

    Parameters
    ----------
    skin : Skin
    directions : (F, 3) float
        Unit, for distant lights.
    positions : (F, 3) float or None
        mm, for near lights.
    reference : (3,) float
        Where the intensities hold, mm.

    Notes
    -----
    Near: I = E max(0, n.(q - x)) |q - ref|^2 / |q - x|^3 + a; distant: I = E n.l + a. Per frame, Tukey-weighted
    least squares on the lit side without clipped samples, so that gloss and the table's bounce are outvoted.
    The intercepts are then split, both parts not negative, into what is there in all frames (the ambient)
    and what grows with the flash (the bounce). A fit of n.l alone would read 6 % high.
    """
    count = len(skin.values)
    intensities = np.full((count, 3), np.nan)
    intercepts = np.full((count, 3), np.nan)
    sigma = np.full(count, np.nan)
    squares = []
    for f in range(count):
        if positions is None:
            shading = skin.normals @ directions[f]
        else:
            toward = positions[f] - skin.points
            distance = np.linalg.norm(toward, axis=1)
            shading = np.sum(skin.normals * toward, 1) * np.sum((positions[f] - reference) ** 2) / distance**3
        use = (shading > LIT * shading.max(initial=0)) & ~skin.clipped[f]
        if use.sum() < FEWEST_PIXELS:
            continue
        design = np.column_stack([shading[use], np.ones(use.sum())])
        values = skin.values[f][use].astype(np.float64)
        weight = _tukey_weights(design, values.mean(1))
        normal = np.linalg.inv(design.T @ (weight[:, None] * design))
        solution = normal @ (design.T @ (weight[:, None] * values))
        intensities[f], intercepts[f] = solution
        residual = values.mean(1) - design @ solution.mean(1)
        score = (weight * residual)[:, None] * design
        sums = np.stack([score[skin.block[use] == b].sum(0) for b in np.unique(skin.block[use])])
        variance = (normal @ (sums.T @ sums) @ normal)[0, 0] * len(sums) / max(len(sums) - 2, 1)
        level = max(solution[0].mean(), 1e-12)
        sigma[f] = np.sqrt(variance) / level
        squares.append(np.average(residual**2, weights=weight) / level**2)
    return Photometry(
        intensities,
        sigma,
        _ambient(intensities, intercepts),
        float(np.sqrt(np.mean(squares))) if squares else np.nan,
        skin.clipped.mean(1) if skin.clipped.size else np.zeros(count),
    )


def shading_directions(skin: Skin) -> tuple[Array, Array]:
    """Return distant directions (F, 3) and their sigma (F,), degrees, from the shading alone.

    For a session without chrome. I = max(0, n.b) + a, b's direction is the light's; the lit side is found
    by turns with b.
    """
    count = len(skin.values)
    directions = np.full((count, 3), np.nan)
    sigma = np.full(count, np.nan)
    for f in range(count):
        values = skin.values[f].mean(1).astype(np.float64)
        good = ~skin.clipped[f]
        use = good & (values > np.quantile(values, 0.3))
        for _ in range(10):
            if use.sum() < FEWEST_PIXELS:
                break
            design = np.column_stack([skin.normals[use], np.ones(use.sum())])
            weight = _tukey_weights(design, values[use])
            normal = np.linalg.pinv(design.T @ (weight[:, None] * design))
            b = normal @ (design.T @ (weight * values[use]))
            length = np.linalg.norm(b[:3])
            directions[f] = b[:3] / length
            residual = values[use] - design @ b
            score = (weight * residual)[:, None] * design
            sums = np.stack([score[skin.block[use] == k].sum(0) for k in np.unique(skin.block[use])])
            covariance = normal @ (sums.T @ sums) @ normal * len(sums) / max(len(sums) - 4, 1)
            across = np.eye(3) - np.outer(directions[f], directions[f])
            sigma[f] = np.rad2deg(np.sqrt(np.trace(across @ covariance[:3, :3] @ across) / 2) / length)
            use = good & (skin.normals @ directions[f] > LIT)
    return directions, sigma


def _tukey_weights(design: Array, values: Array) -> Array:
    """Return the weights (P,) at which a robust linear fit comes to rest."""
    weight = np.ones(len(values))
    for _ in range(12):
        root = np.sqrt(weight)[:, None]
        residual = values - design @ np.linalg.lstsq(design * root, values * root[:, 0], rcond=None)[0]
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-7)
        weight = np.maximum(1 - (residual / (4.685 * scale)) ** 2, 0) ** 2
    return weight


def _ambient(intensities: Array, intercepts: Array) -> Array:
    """Split intercepts (F, 3) = ambient + bounce * intensity; return the ambient (3,), not negative."""
    seen = np.isfinite(intensities[:, 0])
    if not seen.any():
        return np.full(3, np.nan)
    return np.array(
        [
            nnls(np.column_stack([np.ones(seen.sum()), intensities[seen, c]]), intercepts[seen, c])[0][0]
            for c in range(3)
        ]
    )
