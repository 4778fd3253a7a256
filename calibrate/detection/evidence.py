"""What the inside of a circle shows over the frames: a wandering point, as a mirror does, or shading, as a matte ball.

A mirror shows the flash as a point that wanders; a matte ball shades as n.l with one l a frame.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse
from calibrate.lights.directions import toward_camera
from calibrate.photometry.matte_shading import FEWEST_SHADED, lambert
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Stack = NDArray[np.float32]
FEWEST_PIXELS = 60  # of a disc, to look for bright points
WIDEST_PX = 21
"""A flash mirrored in the largest ball is narrower than this, coarse pixels; a mirrored table or white ball is not."""
LARGEST_PX = 150.0  # radius of a ball up to which that holds; a larger one is looked at in smaller pictures
SHARPNESS_PX = 1.2  # blur: of clipped points the larger is the flash, the smaller its image in another ball
DISC, FRONT = 0.97, 0.8
"""Share of the radius that is looked at, and within which a flash on the camera's side must be mirrored."""
POINT_AREA, POINT_CONTRAST, POINT_TRAVEL, POINT_INSIDE = 0.05, 6.0, 0.03, 0.8
"""Limits of `Points`: a smaller area, and more of the others, is a light that shows as a wandering point."""
MAYBE = 1.7, 0.4, 0.6  # shares of the area's, contrast's and `inside`'s limits that may be one all the same
LIT_SHARE = 0.05  # of the median frame's peak, from which a frame shows a point at all
PEAKS, PEAKS_APART = 2, 0.16  # brightest points of a frame that may be the flash, and how far apart they are, radii
PEAK_LIT, PEAK_SECOND = 0.25, 0.2  # of the median frame's peak, and of the frame's own, from which a point may be it
SHADE_PIXELS = 500  # of a disc, evenly thinned, on which shading is fitted
CLIPPED_SHARE = 0.02  # of a disc's pixels near its maximum from which they are clipped
GRAZING = 0.2  # cosine to the viewer under which a pixel is not asked
KEPT = 0.95  # gloss, a scratch, a terminator softened by a large flash: the worst twentieth is not held against a ball
SHADED_FRAME = 0.2  # of the brighter frames' median, under which a frame shows the disc in another thing's shadow
MATTE, MIRROR = 0.95, 0.6  # share of its brightness that n.l explains: of a matte ball more, of a mirror less
FLAT, TALL = 0.7, 4 / 3  # heights over widths of bodies whose shading is compared with a ball's


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


class Shaded(NamedTuple):
    """How well a disc shades as a matte ball does.

    `share` is the part of a frame's variance over the disc that max(0, n.b_f) + a_f explains; median over the frames
    that are not in the dark, so that a shadow that falls on the ball does not count.
    """

    share: float
    flatter: float  # how much more of it the shading of a body `FLAT` times as high as a ball explains,
    taller: float  # and that of one `TALL` times as high
    directions: Array  # (F, 3) unit b_f: rough light directions
    lit: Mask  # (F,) frames in which the disc is not in the dark


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


class _Disc(NamedTuple):
    """The changes on a disc, at the size at which it is looked at."""

    coarse: Coarse
    sphere: Sphere
    values: Stack  # (F, h, w) of its box
    rows: NDArray[np.intp]  # (h, w)
    columns: NDArray[np.intp]  # (h, w)
    inside: Mask  # (h, w)


def _disc(changes: list[Change], sphere: Sphere) -> _Disc | None:
    octave = int(np.clip(np.ceil(np.log2(sphere.radius_px / LARGEST_PX)), 0, len(changes) - 1))
    coarse, change = changes[octave]
    sphere = coarse.from_full(changes[0].coarse.sphere_to_full(sphere))
    box = coarse.box(sphere)
    rows, columns = box.grid
    if min(rows.shape) < 4:
        return None
    (u, v), r = sphere.center_px, sphere.radius_px
    inside = np.hypot(columns - u, rows - v) < DISC * r
    return _Disc(coarse, sphere, change[:, *box], rows, columns, inside) if inside.sum() >= FEWEST_PIXELS else None


def bright_points(changes: list[Change], sphere: Sphere) -> Points | None:
    """Return the brightest change on the disc; None if too little of it is in the picture.

    `sphere` in pixels of the first of the `changes`; its circle is taken for its outline.
    """
    disc = _disc(changes, sphere)
    if disc is None:
        return None
    values = disc.values[:, disc.inside]
    best = values.argmax(1)
    peak = values[np.arange(len(values)), best].astype(np.float64)
    # Of the large disc every few pixels say how much of it is bright.
    some = values[:, :: max(1, values.shape[1] // 4000)]
    area = np.mean(some > 0.5 * peak[:, None], axis=1)
    # A mirrored table is noise next to the flash: the contrast's floor keeps 0 / 0 out.
    ninety = np.maximum(np.quantile(some, 0.9, axis=1), 1e-3 * np.maximum(peak, 1e-6))
    lit = peak > LIT_SHARE * np.median(peak)
    places = np.stack([disc.columns[disc.inside], disc.rows[disc.inside]], -1)
    track = (places[best] - disc.sphere.center_px) / disc.sphere.radius_px
    travel = float(np.sqrt(np.mean(np.sum((track - track.mean(0)) ** 2, 1))))
    within = float(np.mean(np.hypot(*track.T) < FRONT))
    return Points(float(np.median(area[lit])), float(np.median((peak / ninety)[lit])), travel, within, track)


def brightest(changes: list[Change], sphere: Sphere) -> tuple[Array, Mask]:
    """Return the places (F, PEAKS, 2), in the ball's own pixels, of a frame's brightest points, and which may be it."""
    disc = _disc(changes, sphere)
    count = len(changes[0].values)
    places, strength = np.full((count, PEAKS, 2), np.nan), np.zeros((count, PEAKS))
    if disc is None:
        return places, strength > 0
    apart = 2 * int(PEAKS_APART / 2 * disc.sphere.radius_px) + 1
    for f, values in enumerate(disc.values):
        inside = np.where(disc.inside, values, -1)
        row, column = np.nonzero((inside >= cv2.dilate(inside, np.ones((max(3, apart),) * 2, np.uint8))) & disc.inside)
        best = np.argsort(-values[row, column], kind="stable")[:PEAKS]
        at = row[best], column[best]
        places[f, : len(best)] = np.stack([disc.columns[at], disc.rows[at]], -1)
        strength[f, : len(best)] = values[at]
    shown = strength > np.maximum(PEAK_LIT * np.median(strength[:, 0]), PEAK_SECOND * strength[:, :1])
    return changes[0].coarse.to_coarse(disc.coarse.to_full(places)), shown


def shaded(coarse: Coarse, sphere: Sphere, *, least: float = -np.inf) -> Shaded | None:
    """Return how a disc, coarse pixels, shades; None with too few pixels, or where less than `least` is explained."""
    rows, columns = coarse.box(sphere, 1.1, max(1, int(1.1 * sphere.radius_px / 40))).grid
    normals, places = sphere.normals(coarse.camera, np.stack([columns, rows], -1).astype(np.float64))
    view = toward_camera(coarse.camera, places)
    facing = np.sum(view * normals, -1, keepdims=True)
    inside = facing[..., 0] > GRAZING
    if inside.sum() < FEWEST_SHADED:
        return None
    some = slice(None, None, max(1, int(inside.sum()) // SHADE_PIXELS))
    values = coarse.images[:, rows[inside][some], columns[inside][some]].astype(np.float64)
    brightness = values.mean(1)
    lit = brightness > SHADED_FRAME * np.median(brightness[brightness >= np.median(brightness)])
    if not lit.any():
        return None
    normals, along = normals[inside][some], (facing * view)[inside][some]
    share, directions = _shading(values, normals, lit)
    if share < least:
        return None
    flat, tall = (_shading(values, unit(normals + (1 / height - 1) * along), lit)[0] for height in (FLAT, TALL))
    return Shaded(share, flat - share, tall - share, directions, lit)


def contradicts_kind(coarse: Coarse, sphere: Sphere) -> str | None:
    """Say whether a ball, full-size pixels, shades like one of the other kind."""
    seen = shaded(coarse, coarse.from_full(sphere))
    if seen is None or not (seen.share > MATTE if sphere.kind == "chrome" else seen.share < MIRROR):
        return None
    u, v = sphere.center_px
    return (
        f"spheres: the ball at ({u:.0f}, {v:.0f}) px is said to be {sphere.kind}, but n.l explains {seen.share:.0%} of "
        f"its shading (a white ball: above {MATTE:.0%}, a chrome one: below {MIRROR:.0%}). If it is "
        f"{'white' if sphere.kind == 'chrome' else 'chrome'}, correct its kind in session.toml."
    )


def _shading(values: Array, normals: Array, lit: Mask) -> tuple[float, Array]:
    """Return the share of variance that shading explains, the attached shadow's too, and directions (F, 3)."""
    clipped = values >= DISC * np.maximum(values.max(1, keepdims=True), 1e-9)
    clipped &= clipped.mean(1, keepdims=True) > CLIPPED_SHARE
    b, _, residual = lambert(values, normals, clipped)
    seen = (~clipped).sum(1)
    order = np.argsort(np.where(clipped, np.inf, residual**2), axis=1)
    kept = np.arange(values.shape[1]) < (KEPT * seen).astype(int)[:, None]
    left, level = (np.take_along_axis(a, order, 1) for a in (residual, values))
    number = np.maximum(kept.sum(1), 1)
    mean = (level * kept).sum(1) / number
    variance = ((level - mean[:, None]) ** 2 * kept).sum(1) / number
    shares = 1 - (left**2 * kept).sum(1) / number / np.maximum(variance, 1e-12)
    shares = shares[lit & (seen >= FEWEST_SHADED)]
    return float(np.median(shares)) if len(shares) else 0.0, unit(b[:, :3] + 1e-12)
