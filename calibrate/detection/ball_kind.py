"""Chrome, white, or no ball at all: told by what the inside does while the light moves.

A mirror shows the flash as a point that wanders; a matte ball shades as n.l with one l a frame.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
FEWEST_PIXELS = 60
WIDEST_PX = 21
"""A flash mirrored in the largest ball is narrower than this, coarse pixels; a mirrored table or white ball is not."""
FLAT = 0.7
"""Height over width from which on a body's shading is told from a ball's."""
FLATTER = 0.012
"""Advantage of the flat body's shading that bounce and gloss on a ball make."""


@dataclass(frozen=True)
class Points:
    """The brightest change on a disc, frame by frame.

    Parameters
    ----------
    area : float
        Median over frames of the share of the disc that exceeds half of its brightest change: small for a mirror.
    contrast : float
        Median over frames of the brightest change over its 90th percentile on the disc.
    travel : float
        How far the brightest point moves, rms, in radii.
    inside : float
        Share of frames with the brightest point within 0.8 of the radius, where a flash on the camera's side must be.
    track : (F, 2) float64
        The brightest points, from the centre, in radii.
    """

    area: float
    contrast: float
    travel: float
    inside: float
    track: Array

    @property
    def wander(self) -> bool:
        """Whether the light shows as a point that wanders: a mirror, or a gloss."""
        return self.area <= 0.05 and self.contrast >= 6 and self.travel >= 0.03 and self.inside >= 0.8


@dataclass(frozen=True)
class Behaviour:
    """What a candidate's inside does over the frames.

    Parameters
    ----------
    points : Points
    lambert : float
        Share of a frame's variance over the disc that max(0, n.b_f) + a_f explains; median over the frames, so that
        a shadow that falls on the ball in some of them does not count.
    directions : (F, 3) float64
        Unit b_f of that fit: rough light directions.
    flatness : float
        How much more of it the shading of a body explains that is `FLAT` times as high as a ball: a pebble, a dome.
    moving : float
        The share where the disc's darkest frame is subtracted, pixel by pixel: even surroundings that a mirror shows
        in all frames may look like shading, what moves on it does not.
    """

    points: Points
    lambert: float
    directions: Array
    flatness: float = 0.0
    moving: float = 0.0

    @property
    def kind(self) -> Kind | None:
        if self.lambert >= 0.9:
            return "white" if self.flatness <= FLATTER else None
        # Glossy things of any shape show a point, too, and shade.
        is_mirror = self.moving < (0.2 if self.lambert < 0.3 else -1)
        return "chrome" if self.points.wander and is_mirror else None

    @property
    def reason(self) -> str:
        """Why it is neither, in words."""
        if self.lambert >= 0.9:
            return "it shades like a flatter body than a ball (a dome, a pebble)"
        points = self.points
        parts = [f"shading follows n.l only to {max(self.lambert, 0):.0%} (a matte ball: above 90 %)"]
        if points.area > 0.05 or points.contrast < 6:
            measured = f"half-peak area {points.area:.0%} of the disc, contrast {points.contrast:.1f}"
            parts.append(f"no single bright point ({measured})")
        elif points.travel < 0.03:
            parts.append("its bright point stands still")
        elif points.inside < 0.8:
            parts.append("its bright point runs to the rim, where no flash in front can be mirrored")
        else:
            parts.append("it shows the light as a point, but shades more than a mirror does (a glossy thing)")
        return "; ".join(parts)


def changes(images: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what moves and is small in the stack (F, h, w): less its median, less what is wider than a flash.

    Smoothed a little: of clipped points the larger is the flash, the smaller its image in another ball.
    """
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (WIDEST_PX, WIDEST_PX))
    change = images - np.median(images, axis=0)
    for one in change:
        one[:] = cv2.GaussianBlur(cv2.morphologyEx(one, cv2.MORPH_TOPHAT, kernel), (0, 0), 1.2)
    return change


def bright_points(change: NDArray[np.float32], sphere: Sphere) -> Points | None:
    """Return the brightest change on the disc in `changes`; None if too little of it is in the picture.

    `sphere` in the stack's pixels; its circle is taken for its outline.
    """
    u, v, r = *sphere.center_px, sphere.radius_px
    height, width = change.shape[1:]
    top, left = max(int(v - r), 0), max(int(u - r), 0)
    bottom, right = min(int(v + r) + 2, height), min(int(u + r) + 2, width)
    if bottom - top < 4 or right - left < 4:
        return None
    rows, columns = np.mgrid[top:bottom, left:right]
    inside = np.hypot(columns - u, rows - v) < 0.97 * r
    if inside.sum() < FEWEST_PIXELS:
        return None
    values = change[:, top:bottom, left:right][:, inside]
    best = values.argmax(1)
    peak = values[np.arange(len(values)), best].astype(np.float64)
    # Of the large disc every few pixels tell how much of it is bright.
    some = values[:, :: max(1, values.shape[1] // 4000)]
    area = np.mean(some > 0.5 * peak[:, None], axis=1)
    # A mirrored table is noise next to the flash: the contrast's floor keeps 0 / 0 out.
    ninety = np.maximum(np.quantile(some, 0.9, axis=1), 1e-3 * np.maximum(peak, 1e-6))
    lit = peak > 0.05 * np.median(peak)
    place = np.stack([columns[inside], rows[inside]], -1)[best]
    track = (place - sphere.center_px) / r
    travel = float(np.sqrt(np.mean(np.sum((track - track.mean(0)) ** 2, 1))))
    within = float(np.mean(np.hypot(*track.T) < 0.8))
    return Points(float(np.median(area[lit])), float(np.median((peak / ninety)[lit])), travel, within, track)


def observe(coarse: Coarse, sphere: Sphere, points: Points, *, most_pixels: int = 1000) -> Behaviour:
    """Return how the disc behaves. `sphere` in coarse pixels, `points` its `bright_points`."""
    u, v, r = *sphere.center_px, 1.1 * sphere.radius_px
    height, width = coarse.images.shape[1:]
    step = max(1, int(r / 40))
    rows, columns = np.mgrid[
        max(int(v - r), 0) : min(int(v + r) + 2, height) : step, max(int(u - r), 0) : min(int(u + r) + 2, width) : step
    ]
    normals, places = sphere.normals(coarse.camera, np.stack([columns, rows], -1).astype(np.float64))
    view = np.broadcast_to([0.0, 0.0, 1.0], places.shape)
    if not coarse.camera.is_orthographic:
        view = -places / np.linalg.norm(places, axis=-1, keepdims=True)
    facing = np.sum(view * normals, -1, keepdims=True)
    inside = facing[..., 0] > 0.2
    if inside.sum() < 20:
        return Behaviour(points, 0.0, np.zeros((len(coarse.images), 3)))
    every = max(1, int(inside.sum()) // most_pixels)
    values = coarse.images[:, rows[inside][::every], columns[inside][::every]].astype(np.float64)
    normals = normals[inside][::every]
    lambert, directions = _lambert(values, normals)
    flatness = 0.0
    if lambert >= 0.9:
        flat = normals + (1 / FLAT - 1) * (facing * view)[inside][::every]
        flatness = _lambert(values, flat / np.linalg.norm(flat, axis=1, keepdims=True))[0] - lambert
    moving = 0.0
    if points.wander and lambert < 0.9:
        moving, _ = _lambert(values - values.min(0), normals)
    return Behaviour(points, lambert, directions, flatness, moving)


def _lambert(values: Array, normals: Array) -> tuple[float, Array]:
    """Return the share of variance that shading explains, and the fit's directions (F, 3).

    Notes
    -----
    Per frame, I = max(0, n.b) + a by alternating: which pixels are lit, then least squares on those, with
    the brightest residuals (gloss) and clipped samples left out. The attached shadow counts in the score.
    """
    design = np.column_stack([normals, np.ones(len(normals))])
    shares = np.full(len(values), np.nan)
    directions = np.zeros((len(values), 3))
    for f, image in enumerate(values):
        clipped = image >= 0.97 * max(image.max(), 1e-9)
        clipped &= clipped.mean() > 0.02
        use = ~clipped & (image > np.quantile(image, 0.2))
        b = np.zeros(4)
        for _ in range(6):
            if use.sum() < 20:
                break
            rows = design[use]
            b = np.linalg.solve(rows.T @ rows + 1e-9 * np.eye(4), rows.T @ image[use])
            residual = image - (np.maximum(normals @ b[:3], 0) + b[3])
            limit = 3 * 1.4826 * np.median(np.abs(residual[use])) + 1e-6
            use = ~clipped & (normals @ b[:3] > 0.1 * np.linalg.norm(b[:3])) & (np.abs(residual) < limit)
        seen = image[~clipped]
        if len(seen) < 20:
            continue
        residual = seen - (np.maximum(normals @ b[:3], 0) + b[3])[~clipped]
        # Gloss, a scratch, a terminator softened by a large flash: the worst twentieth is not held against the ball.
        kept = np.argsort(residual**2)[: int(0.95 * len(residual))]
        shares[f] = 1 - np.mean(residual[kept] ** 2) / max(seen[kept].var(), 1e-12)
        directions[f] = b[:3] / max(np.linalg.norm(b[:3]), 1e-12)
    known = shares[np.isfinite(shares)]
    return float(np.median(known)) if len(known) else 0.0, directions
