"""Chrome, white, or no ball at all: decided by what the inside does while the light moves.

A mirror shows the flash as a point that wanders; a matte ball shades as n.l with one l a frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse
from calibrate.lights.directions import toward_camera
from calibrate.robust import spread
from scene.normals import unit
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
Stack = NDArray[np.float32]
FEWEST_PIXELS, FEWEST_SHADED = 60, 20  # of a disc, to look for bright points, and for shading
WIDEST_PX = 21
"""A flash mirrored in the largest ball is narrower than this, coarse pixels; a mirrored table or white ball is not."""
LARGEST_PX = 150.0  # radius of a ball up to which that holds; a larger one is looked at in smaller pictures
SHARPNESS_PX = 1.2  # blur: of clipped points the larger is the flash, the smaller its image in another ball
DISC, FRONT = 0.97, 0.8
"""Share of the radius that is looked at, and within which a flash on the camera's side must be mirrored."""
POINT_AREA, POINT_CONTRAST, POINT_TRAVEL, POINT_INSIDE = 0.05, 6.0, 0.03, 0.8
"""Limits of `Points`: a smaller area, and more of the others, is a light that shows as a wandering point."""
MAYBE = 1.7, 0.4, 0.6  # the same, of the area, contrast and `inside`, up to which it may be one all the same
LIT_SHARE = 0.05  # of the median frame's peak, from which a frame shows a point at all
MATTE = 0.9  # share of a frame's variance that shading explains on a matte ball
MIRRORS, MIRRORS_MOVING = 0.3, 0.2  # the same that it explains at most on a mirror, and of what moves on it
OPPOSITE = -1.0  # of what moves on it: shading is so wrong there that a mirror may look like shading otherwise
FLAT = 0.7  # height over width of the body whose shading is compared with a ball's
FLATTER = 0.012  # advantage of the flat body's shading that bounce and gloss on a ball make
CLIPPED_SHARE = 0.02  # of a disc's pixels near its maximum from which they are clipped
GRAZING, TERMINATOR = 0.2, 0.1  # cosines to the viewer, and to the light, under which a pixel is not asked
KEPT = 0.95  # gloss, a scratch, a terminator softened by a large flash: the worst twentieth is not held against a ball
STRETCHES, BALLS_STRETCH = 0.6, 0.28
"""Logarithms of the scales that are tried, and of those that two balls under near lights show."""
CLEARLY = 0.6  # share of the best ball's residual under which a stretched track fits clearly better
ALIKE = 0.13
"""How far, in radii, a highlight may lie from where another ball has it: lights at unequal distances do that."""


class Points(NamedTuple):
    """The brightest change on a disc, frame by frame."""

    area: float  # median over frames of the share of the disc above half of its brightest change: small for a mirror
    contrast: float  # median over frames of the brightest change over its 90th percentile on the disc
    travel: float  # how far the brightest point moves, rms, in radii
    inside: float  # share of frames with the brightest point in `FRONT`, where a flash on the camera's side must be
    track: Array  # (F, 2) the brightest points, from the centre, in radii

    @property
    def wander(self) -> bool:
        """Whether the light shows as a point that wanders: a mirror, or a gloss."""
        return self._within(1.0, 1.0, 1.0)

    @property
    def may_wander(self) -> bool:
        """Whether it may be one: on a small mirror, or in a circle that is not the mirror's outline."""
        return self._within(*MAYBE)

    def _within(self, area: float, contrast: float, inside: float) -> bool:
        small = self.area <= area * POINT_AREA and self.contrast >= contrast * POINT_CONTRAST
        return small and self.travel >= POINT_TRAVEL and self.inside >= inside * POINT_INSIDE


class Change(NamedTuple):
    """A shrunken stack, and what moves in it."""

    coarse: Coarse
    values: Stack  # (F, h, w)


@dataclass(frozen=True)
class Behaviour:
    """What a candidate's inside does over the frames.

    `lambert` is the share of a frame's variance over the disc that max(0, n.b_f) + a_f explains; median over the
    frames, so that a shadow that falls on the ball in some of them does not count. `moving` is the same where the
    disc's darkest frame is subtracted, pixel by pixel: even surroundings that a mirror shows in all frames may look
    like shading, what moves on it does not.
    """

    points: Points
    lambert: float
    directions: Array  # (F, 3) unit b_f of that fit: rough light directions
    flatness: float = 0.0  # how much more of it the shading of a body explains that is `FLAT` times as high as a ball
    moving: float = 0.0
    mirrors: bool = False  # the disc shows, along its rim, the table beside it as a mirror ball does

    @property
    def kind(self) -> Kind | None:
        if self.mirrors:
            return "chrome"
        if self.lambert >= MATTE:
            return "white" if self.flatness <= FLATTER else None
        # Glossy things of any shape show a point, too, and shade.
        is_mirror = self.moving < (MIRRORS_MOVING if self.lambert < MIRRORS else OPPOSITE)
        return "chrome" if self.points.wander and is_mirror else None

    @property
    def reason(self) -> str:
        """Why it is neither, in words."""
        if self.lambert >= MATTE:
            return "it shades like a flatter body than a ball (a dome, a pebble)"
        points = self.points
        shading = f"shading follows n.l only to {max(self.lambert, 0):.0%} (a matte ball: above 90 %)"
        if points.area > POINT_AREA or points.contrast < POINT_CONTRAST:
            measured = f"half-peak area {points.area:.0%} of the disc, contrast {points.contrast:.1f}"
            return f"{shading}; no single bright point ({measured})"
        if points.travel < POINT_TRAVEL:
            return f"{shading}; its bright point stands still"
        if points.inside < POINT_INSIDE:
            return f"{shading}; its bright point runs to the rim, where no flash in front can be mirrored"
        return f"{shading}; it shows the light as a point, but shades more than a mirror does (a glossy thing)"

    @property
    def track(self) -> Array:
        """Where the light's half-way normal lies on the unit disc, (F, 2), v down."""
        if self.kind == "chrome":
            return self.points.track
        half = self.directions + [0.0, 0.0, 1.0]
        return half[:, :2] * [1, -1] / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)


def changes(coarse: Coarse) -> list[Change]:
    """Return what moves and is small in the stack, and in the same at half the size, for balls that fill the picture.

    Less its median, less what is wider than a flash.
    """
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (WIDEST_PX, WIDEST_PX))
    out: list[Change] = []
    while not out or min(coarse.images.shape[1:]) > 2 * LARGEST_PX:
        coarse = coarse.halved() if out else coarse
        change = coarse.images - np.median(coarse.images, axis=0)
        for one in change:
            one[:] = cv2.GaussianBlur(cv2.morphologyEx(one, cv2.MORPH_TOPHAT, kernel), (0, 0), SHARPNESS_PX)
        out.append(Change(coarse, change))
    return out


def bright_points(changes: list[Change], sphere: Sphere) -> Points | None:
    """Return the brightest change on the disc; None if too little of it is in the picture.

    `sphere` in pixels of the first of the `changes`; its circle is taken for its outline.
    """
    octave = int(np.clip(np.ceil(np.log2(sphere.radius_px / LARGEST_PX)), 0, len(changes) - 1))
    coarse, change = changes[octave]
    sphere = coarse.from_full(changes[0].coarse.sphere_to_full(sphere))
    box = coarse.box(sphere)
    rows, columns = box.grid
    if min(rows.shape) < 4:
        return None
    (u, v), r = sphere.center_px, sphere.radius_px
    inside = np.hypot(columns - u, rows - v) < DISC * r
    if inside.sum() < FEWEST_PIXELS:
        return None
    values = change[:, *box][:, inside]
    best = values.argmax(1)
    peak = values[np.arange(len(values)), best].astype(np.float64)
    # Of the large disc every few pixels say how much of it is bright.
    some = values[:, :: max(1, values.shape[1] // 4000)]
    area = np.mean(some > 0.5 * peak[:, None], axis=1)
    # A mirrored table is noise next to the flash: the contrast's floor keeps 0 / 0 out.
    ninety = np.maximum(np.quantile(some, 0.9, axis=1), 1e-3 * np.maximum(peak, 1e-6))
    lit = peak > LIT_SHARE * np.median(peak)
    track = (np.stack([columns[inside], rows[inside]], -1)[best] - sphere.center_px) / r
    travel = float(np.sqrt(np.mean(np.sum((track - track.mean(0)) ** 2, 1))))
    within = float(np.mean(np.hypot(*track.T) < FRONT))
    return Points(float(np.median(area[lit])), float(np.median((peak / ninety)[lit])), travel, within, track)


def observe(
    coarse: Coarse, sphere: Sphere, points: Points, *, mirrors: bool = False, most_pixels: int = 1000
) -> Behaviour:
    """Return how the disc behaves. `sphere` in coarse pixels, `points` its `bright_points`, `mirrors`: `Behaviour`."""
    rows, columns = coarse.box(sphere, 1.1, max(1, int(1.1 * sphere.radius_px / 40))).grid
    normals, places = sphere.normals(coarse.camera, np.stack([columns, rows], -1).astype(np.float64))
    view = toward_camera(coarse.camera, places)
    facing = np.sum(view * normals, -1, keepdims=True)
    inside = facing[..., 0] > GRAZING
    if inside.sum() < FEWEST_SHADED:
        return Behaviour(points, 0.0, np.zeros((len(coarse.images), 3)), mirrors=mirrors)
    every = max(1, int(inside.sum()) // most_pixels)
    values = coarse.images[:, rows[inside][::every], columns[inside][::every]].astype(np.float64)
    normals = normals[inside][::every]
    lambert, directions = _lambert(values, normals)
    flatness = moving = 0.0
    if lambert >= MATTE:
        flat = normals + (1 / FLAT - 1) * (facing * view)[inside][::every]
        flatness = _lambert(values, unit(flat))[0] - lambert
    elif points.wander:
        moving, _ = _lambert(values - values.min(0), normals)
    return Behaviour(points, lambert, directions, flatness, moving, mirrors)


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
        clipped = image >= DISC * max(image.max(), 1e-9)
        clipped &= clipped.mean() > CLIPPED_SHARE
        use = ~clipped & (image > np.quantile(image, 0.2))
        b = np.zeros(4)
        for _ in range(6):
            if use.sum() < FEWEST_SHADED:
                break
            rows = design[use]
            b = np.linalg.solve(rows.T @ rows + 1e-9 * np.eye(4), rows.T @ image[use])
            residual = image - (np.maximum(normals @ b[:3], 0) + b[3])
            limit = 3 * spread(residual[use]) + 1e-6
            use = ~clipped & (normals @ b[:3] > TERMINATOR * np.linalg.norm(b[:3])) & (np.abs(residual) < limit)
        seen = image[~clipped]
        if len(seen) < FEWEST_SHADED:
            continue
        residual = seen - (np.maximum(normals @ b[:3], 0) + b[3])[~clipped]
        kept = np.argsort(residual**2)[: int(KEPT * len(residual))]
        shares[f] = 1 - np.mean(residual[kept] ** 2) / max(seen[kept].var(), 1e-12)
        directions[f] = b[:3] / max(np.linalg.norm(b[:3]), 1e-12)
    known = shares[np.isfinite(shares)]
    return float(np.median(known)) if len(known) else 0.0, directions


def alike(a: Behaviour, b: Behaviour) -> float:
    """Return the share of frames in which two balls see the lights alike, 0 to 1.

    Notes
    -----
    Where each frame's half-way normal lies on the one disc is predicted from where it lies on the other by a scale
    and a shift: near lights move the track by some tenths of the radius and scale it a little. A circle that is not
    the ball's outline, and a body that is no ball, stretch the track: a mirror half as high as it is wide by a half. So
    where only such a scale fits, none of the frames counts. A shadow on a ball spoils single frames.
    """
    first, second = a.track, b.track
    best: dict[bool, tuple[float, float]] = {True: (np.inf, 0.0), False: (np.inf, 0.0)}
    for scale in np.exp(np.linspace(-STRETCHES, STRETCHES, 25)):
        shift = second - scale * first
        residual = np.hypot(*(shift - np.median(shift, axis=0)).T)
        near = bool(abs(np.log(scale)) <= BALLS_STRETCH)
        share = float(np.mean(residual < ALIKE * max(1.0, scale)))
        best[near] = (min(best[near][0], float(np.median(residual))), max(best[near][1], share))
    stretched = best[False][0] < CLEARLY * best[True][0] and best[False][1] >= best[True][1]
    return 0.0 if stretched else best[True][1]
