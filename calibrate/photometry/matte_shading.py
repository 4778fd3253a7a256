"""What a matte ball's surface showed in each frame, and where the light stood by its shading alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import toward_camera
from scene.camera import Camera
from scene.frames import Frames, gray
from scene.robust import TUKEY, cluster_sums, spread, tukey
from scene.spheres import Sphere

Array = NDArray[np.float64]
MOST_PIXELS = 6000
FACING = 0.35  # cosine to the viewer under which the silhouette edge's blur, and gloss, begin
LIT = 0.2  # cosine to the light under which a large flash is half set behind the ball's horizon
DARK = 0.3  # quantile of the brightness under which pixels are taken to be unlit to begin with
FEWEST_PIXELS = 40
RINGS, ANGLES = 4, 12  # of the patches
AROUND, GLARE = (1.1, 2.5), 0.95  # radii about a ball of what lights it from below, and the quantile of its glare
WHITE = 0.75  # albedo of a white ball, for what its surroundings add to it
MATTE, MIRROR = 0.9, 0.6
"""Share of the brightness' variance over a ball that n.l explains: of a matte ball more, of a mirror less."""


@dataclass(frozen=True)
class Surface:
    """A matte ball's surface and what P of its pixels showed in F frames."""

    points: Array  # (P, 3)
    normals: Array  # (P, 3)
    values: NDArray[np.float32]  # (F, P, 3)
    clipped: NDArray[np.bool_]  # (F, P)
    block: NDArray[np.intp]  # (P,) which patch of the ball a pixel lies in: errors agree within a patch
    center: Array  # (3,)
    radius: float  # the ball's, in the points' unit
    ambient: NDArray[np.float32]  # (P, 3) the ambient frame's light, which was taken off; zero without


def read_surface(frames: Frames, camera: Camera, sphere: Sphere) -> Surface:
    """Read the pixels of the ball that face the camera, evenly thinned to `MOST_PIXELS`."""
    rows, columns = np.nonzero(sphere.mask(camera))
    pixels = np.stack([columns, rows], -1)
    normals, points = sphere.normals(camera, pixels)
    view = toward_camera(camera, points)
    keep = np.flatnonzero(np.sum(normals * view, 1) > FACING)
    keep = keep[:: max(1, len(keep) // MOST_PIXELS)]
    pixels, points, normals = pixels[keep], points[keep], normals[keep]
    count, place = len(frames), (sphere.center_mm(camera), sphere.radius_mm)
    if not len(keep):
        none = np.zeros((count, 0, 3), np.float32)
        return Surface(points, normals, none, none[..., 0] > 0, np.zeros(0, np.intp), *place, none[0])
    (left, top), (right, bottom) = pixels.min(0), pixels.max(0) + 1
    band, side = slice(int(top), int(bottom)), slice(int(left), int(right))
    at = (pixels[:, 1] - top, pixels[:, 0] - left)
    values = np.stack([frames.read(band, [f], columns=side)[0][at] for f in range(count)])
    clipped = np.stack([frames.saturated(band, [f], columns=side)[0][at] for f in range(count)])
    offset = pixels - sphere.center_px
    angle = np.arctan2(offset[:, 1], offset[:, 0]) + np.pi
    ring = np.minimum(np.hypot(*offset.T) / sphere.radius_px * RINGS, RINGS - 1).astype(np.intp)
    block = (angle / (2 * np.pi) * ANGLES).astype(np.intp) % ANGLES + ring * ANGLES
    ambient = frames.read(band, [0], columns=side, subtract_ambient=False)[0][at] - values[0]
    return Surface(points, normals, values, clipped, block, *place, ambient)


def brightness_beside(frames: Frames, sphere: Sphere) -> NDArray[np.float32]:
    """Return (F,), the mean brightness that the flash adds around a ball, without the brightest."""
    (u, v), far = sphere.center_px, AROUND[1] * sphere.radius_px
    rows = slice(max(int(v - far), 0), min(int(v + far) + 1, frames.height))
    columns = slice(max(int(u - far), 0), min(int(u + far) + 1, frames.width))
    y, x = np.mgrid[rows, columns]
    away = np.hypot(x - u, y - v) / sphere.radius_px
    ring = (away > AROUND[0]) & (away < AROUND[1])
    out = np.zeros(len(frames), np.float32)
    for f in range(len(frames) if ring.any() else 0):
        values = gray(frames.read(rows, [f], columns=columns)[0][ring])
        out[f] = np.minimum(values, np.quantile(values, GLARE)).mean()
    # Without an ambient frame what is there in all frames may be the room's light.
    return out if frames.ambient is not None else out - out.min()


def shading_directions(surface: Surface, beside: NDArray | None = None) -> tuple[Array, Array]:
    """Return distant directions (F, 3) and their sigma (F,), degrees, from the shading alone.

    I = max(0, n.b) + a + w L (1 - n_z) / 2, b's direction is the light's; the lit side is found by turns with b. The
    last is what a table, as bright as the picture around the ball, L, throws on a ball of albedo w: it would draw b
    away from the table by some degrees. `beside` (F,) is L, of `brightness_beside`; None: there is no table.
    """
    count = len(surface.values)
    directions = np.full((count, 3), np.nan)
    sigma = np.full(count, np.nan)
    thrown = (1 - surface.normals[:, 2]) / 2
    for f in range(count):
        values = surface.values[f].mean(1).astype(np.float64)
        if beside is not None:
            values -= WHITE * beside[f] * thrown
        good = ~surface.clipped[f]
        use = good & (values > np.quantile(values, DARK))
        for _ in range(10):
            if use.sum() < FEWEST_PIXELS:
                break
            design = np.column_stack([surface.normals[use], np.ones(use.sum())])
            weight = tukey_weights(design, values[use])
            normal = np.linalg.pinv(design.T @ (weight[:, None] * design))
            b = normal @ (design.T @ (weight * values[use]))
            length = np.linalg.norm(b[:3])
            if not length > 0:
                directions[f] = sigma[f] = np.nan
                break
            directions[f] = b[:3] / length
            residual = values[use] - design @ b
            sums = cluster_sums((weight * residual)[:, None] * design, surface.block[use])
            covariance = normal @ (sums.T @ sums) @ normal * len(sums) / max(len(sums) - 4, 1)
            across = np.eye(3) - np.outer(directions[f], directions[f])
            sigma[f] = np.rad2deg(np.sqrt(np.trace(across @ covariance[:3, :3] @ across) / 2) / length)
            lit = good & (surface.normals @ directions[f] > LIT)
            if np.array_equal(lit, use):
                break
            use = lit
    return directions, sigma


def contradicts_kind(frames: Frames, camera: Camera, sphere: Sphere) -> str | None:
    """Say whether a ball shades like one of the other kind."""
    surface = read_surface(frames, camera, sphere)
    explained = []
    for values, clipped in zip(surface.values.mean(-1, dtype=np.float64), surface.clipped, strict=True):
        use = ~clipped & (values > np.quantile(values, DARK)) if len(values) else clipped
        if use.sum() >= FEWEST_PIXELS and np.var(values[use]) > 0:
            design = np.column_stack([surface.normals[use], np.ones(use.sum())])
            rest = values[use] - design @ np.linalg.lstsq(design, values[use], rcond=None)[0]
            explained.append(1 - np.var(rest) / np.var(values[use]))
    if not explained:
        return None
    share = float(np.median(explained))
    other = {"chrome": "white", "white": "chrome"}[sphere.kind]
    if not (share > MATTE if sphere.kind == "chrome" else share < MIRROR):
        return None
    u, v = sphere.center_px
    return (
        f"spheres: the ball at ({u:.0f}, {v:.0f}) px is said to be {sphere.kind}, but n.l explains {share:.0%} of its "
        f"shading (a white ball: above {MATTE:.0%}, a chrome one: below {MIRROR:.0%}). If it is {other}, correct its "
        "kind in session.toml."
    )


def tukey_weights(design: Array, values: Array) -> Array:
    """Return the weights (P,) at which a robust linear fit comes to rest."""
    weight = np.ones(len(values))
    for _ in range(12):
        weighted = weight[:, None] * design
        residual = values - design @ np.linalg.lstsq(design.T @ weighted, values @ weighted, rcond=None)[0]
        weight = tukey(residual, TUKEY * max(spread(residual), 1e-7))
    return weight
