"""Chrome, white, or no ball at all: told by what the inside does while the light moves.

A mirror shows the flash as a point that wanders; a matte ball shades as n.l with one l a frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.coarse import Coarse
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
FEWEST_PIXELS = 60
FLAT = 0.7
"""Height over width from which on a body's shading is told from a ball's."""


@dataclass(frozen=True)
class Behaviour:
    """What a candidate's inside does over the frames.

    Parameters
    ----------
    spot_area : float
        Median over frames of the share of the disc that exceeds half of its brightest change: small for a mirror.
    spot_contrast : float
        Median over frames of the brightest change over its 90th percentile on the disc.
    spot_travel : float
        How far the brightest point moves, rms, in radii.
    spot_inside : float
        Share of frames with the brightest point within 0.8 of the radius, where a flash on the camera's side must be.
    track : (F, 2) float64
        The brightest points, from the centre, in radii.
    lambert : float
        Share of a frame's variance over the disc that max(0, n.b_f) + a_f explains; median over the frames, so that
        a shadow that falls on the ball in some of them does not count.
    directions : (F, 3) float64
        Unit b_f of that fit: rough light directions.
    flatness : float
        How much more of it the shading of a body explains that is `FLAT` times as high as a ball: a pebble, a dome.
    """

    spot_area: float
    spot_contrast: float
    spot_travel: float
    spot_inside: float
    track: Array
    lambert: float
    directions: Array
    flatness: float = 0.0

    @property
    def has_point(self) -> bool:
        """Whether it shows the light as a point that wanders: a mirror, or a gloss."""
        is_point = self.spot_area <= 0.05 and self.spot_contrast >= 6
        return is_point and self.spot_travel >= 0.03 and self.spot_inside >= 0.8

    @property
    def kind(self) -> Kind | None:
        if self.lambert >= 0.9:
            return "white" if self.flatness <= 0 else None
        # Glossy things of any shape show a point, too, and shade.
        return "chrome" if self.has_point and self.lambert < 0.3 else None

    @property
    def reason(self) -> str:
        """Why it is neither, in words."""
        if self.lambert >= 0.9:
            return "it shades like a flatter body than a ball (a dome, a pebble)"
        parts = [f"shading follows n.l only to {max(self.lambert, 0):.0%} (a matte ball: above 90 %)"]
        if self.spot_area > 0.05 or self.spot_contrast < 6:
            measured = f"half-peak area {self.spot_area:.0%} of the disc, contrast {self.spot_contrast:.1f}"
            parts.append(f"no single bright point ({measured})")
        elif self.spot_travel < 0.03:
            parts.append("its bright point stands still")
        else:
            parts.append("its bright point runs to the rim, where no flash in front can be mirrored")
        return "; ".join(parts)


def observe(coarse: Coarse, sphere: Sphere, *, most_pixels: int = 2500) -> Behaviour | None:
    """Return how the disc behaves; None if too little of it is in the picture. `sphere` in coarse pixels."""
    u, v, r = *sphere.center_px, sphere.radius_px
    reach = 1.1 * r
    height, width = coarse.images.shape[1:]
    top, left = max(int(v - reach), 0), max(int(u - reach), 0)
    bottom, right = min(int(v + reach) + 2, height), min(int(u + reach) + 2, width)
    if bottom - top < 4 or right - left < 4:
        return None
    rows, columns = np.mgrid[top:bottom, left:right]
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    normals, points = sphere.normals(coarse.camera, pixels)
    view = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    if not coarse.camera.is_orthographic:
        view = -points / np.linalg.norm(points, axis=-1, keepdims=True)
    facing = np.sum(view * normals, -1, keepdims=True)
    inside = facing[..., 0] > 0.2
    if inside.sum() < FEWEST_PIXELS:
        return None
    values = coarse.images[:, top:bottom, left:right][:, inside].astype(np.float64)
    area, contrast, track = _spot(values, (pixels[inside] - sphere.center_px) / r)
    travel = float(np.sqrt(np.mean(np.sum((track - track.mean(0)) ** 2, 1))))
    within = float(np.mean(np.hypot(*track.T) < 0.8))
    step = max(1, int(inside.sum()) // most_pixels)
    normals, values = normals[inside][::step], values[:, ::step]
    lambert, directions = _lambert(values, normals)
    flatness = 0.0
    if lambert >= 0.9:
        flat = normals + (1 / FLAT - 1) * (facing * view)[inside][::step]
        flatness = _lambert(values, flat / np.linalg.norm(flat, axis=1, keepdims=True))[0] - lambert
    return Behaviour(area, contrast, travel, within, track, lambert, directions, flatness)


def _spot(values: Array, pixels: Array) -> tuple[float, float, Array]:
    """Return area, contrast and track of the brightest change over time; see `Behaviour`."""
    change = values - np.median(values, axis=0)
    best = change.argmax(1)
    peak = change[np.arange(len(change)), best]
    area = np.mean(change > 0.5 * peak[:, None], axis=1)
    # A mirrored table is noise next to the flash: the contrast's floor keeps 0 / 0 out.
    ninety = np.maximum(np.quantile(change, 0.9, axis=1), 1e-3 * np.maximum(peak, 1e-6))
    lit = peak > 0.05 * np.median(peak)
    return float(np.median(area[lit])), float(np.median((peak / ninety)[lit])), pixels[best]


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
            b = np.linalg.lstsq(design[use], image[use], rcond=None)[0]
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
