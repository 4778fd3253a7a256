"""What a matte ball's surface showed in each frame, and where the light stood by its shading alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import toward_camera
from calibrate.photometry.table_normal import TOWARD_CAMERA
from scene.camera import Camera
from scene.frames import Frames, gray
from scene.robust import MAD, TUKEY, cluster_sums, spread, tukey
from scene.spheres import Sphere

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MOST_PIXELS = 6000
FACING = 0.35  # cosine to the viewer under which the silhouette edge's blur, and gloss, begin
TERMINATOR = 0.1  # cosine to the light under which a large flash is half set behind the ball's horizon
FEWEST_PIXELS, FEWEST_SHADED = 40, 20  # that tell a direction, and on which shading is fitted at all
RINGS, ANGLES = 4, 12  # of the patches
AROUND, GLARE = (1.1, 2.5), 0.95  # radii about a ball of what lights it from below, and the quantile of its glare
SENT_BACK = 0.5
"""Share of the table's brightness that a white ball's underside sends on: its albedo of 0.75, less because it shades
the table under it. With 0.5 the bend along the view is 0 in the mean on the scenes of `directions.SURROUNDINGS_DEG`."""


@dataclass(frozen=True)
class MatteSurface:
    """A matte ball's surface and what P of its pixels showed in F frames."""

    points: Array  # (P, 3)
    normals: Array  # (P, 3)
    values: NDArray[np.float32]  # (F, P, 3)
    clipped: NDArray[np.bool_]  # (F, P)
    block: NDArray[np.intp]  # (P,) which patch of the ball a pixel lies in: errors agree within a patch
    center: Array  # (3,)
    radius: float  # the ball's, in the points' unit
    ambient: NDArray[np.float32]  # (P, 3) the ambient frame's light, which was taken off; zero without
    table: Array  # (3,) the unit normal of the table that it stands on


def read_surface(frames: Frames, camera: Camera, sphere: Sphere, table: Array = TOWARD_CAMERA) -> MatteSurface:
    """Read the pixels of the ball that face the camera, evenly thinned to `MOST_PIXELS`; `table` (3,): its normal."""
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
        return MatteSurface(points, normals, none, none[..., 0] > 0, np.zeros(0, np.intp), *place, none[0], table)
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
    return MatteSurface(points, normals, values, clipped, block, *place, ambient, table)


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


def shading_directions(surface: MatteSurface, beside: NDArray | None = None) -> tuple[Array, Array]:
    """Return distant directions (F, 3) and their sigma (F,), degrees, from the shading alone; NaN where it is little.

    I = max(0, n.b) + a + s L (1 - n.t) / 2, b's direction is the light's. The last is what a table of normal t, as
    bright as the picture around the ball, L, throws on it (s: `SENT_BACK`): it would draw b away from the table by some
    degrees.
    `beside` (F,) is L, of `brightness_beside`; None: there is no table.
    """
    values, normals = surface.values.mean(-1, dtype=np.float64), surface.normals
    directions, sigma = np.full((len(values), 3), np.nan), np.full(len(values), np.nan)
    if not len(normals):
        return directions, sigma
    if beside is not None:
        values = values - SENT_BACK * beside[:, None] * (1 - normals @ surface.table) / 2
    b, use, residual = lambert(values, normals, surface.clipped)
    length = np.linalg.norm(b[:, :3], axis=1)
    for f in np.flatnonzero((use.sum(1) >= FEWEST_PIXELS) & (length > 0)):
        directions[f] = b[f, :3] / length[f]
        design = np.column_stack([normals[use[f]], np.ones(use[f].sum())])
        normal = np.linalg.pinv(design.T @ design)
        sums = cluster_sums(residual[f, use[f], None] * design, surface.block[use[f]])
        covariance = normal @ (sums.T @ sums) @ normal * len(sums) / max(len(sums) - 4, 1)
        across = np.eye(3) - np.outer(directions[f], directions[f])
        sigma[f] = np.rad2deg(np.sqrt(np.trace(across @ covariance[:3, :3] @ across) / 2) / length[f])
    return directions, sigma


def lambert(values: Array, normals: Array, clipped: Mask) -> tuple[Array, Mask, Array]:
    """Fit values (F, P) by max(0, n.b) + a, frame by frame; return (b, a) (F, 4), which pixels were used, what is left.

    By turns: which pixels are lit, then least squares on those, with the brightest residuals (gloss) and clipped
    samples left out. 0 where too few are.
    """
    design = np.column_stack([normals, np.ones(len(normals))])
    products = (design[:, :, None] * design[:, None, :]).reshape(len(design), 16)
    use = ~clipped & (values > np.quantile(values, 0.2, axis=1, keepdims=True))
    b, residual = np.zeros((len(values), 4)), values.copy()
    for _ in range(6):
        enough = use.sum(1) >= FEWEST_SHADED
        if not enough.any():
            break
        weight = use[enough].astype(np.float64)
        normal = (weight @ products).reshape(-1, 4, 4) + 1e-9 * np.eye(4)
        b[enough] = np.linalg.solve(normal, ((weight * values[enough]) @ design)[..., None])[..., 0]
        cosine = b[:, :3] @ normals.T
        residual = values - (np.maximum(cosine, 0) + b[:, 3:])
        size = np.abs(residual)
        sizes = np.sort(np.where(use, size, np.inf)[enough], axis=1)
        limit = 3 * MAD * np.take_along_axis(sizes, use[enough].sum(1, keepdims=True) // 2, 1) + 1e-6
        strength = np.linalg.norm(b[enough, :3], axis=1, keepdims=True)
        use[enough] = ~clipped[enough] & (cosine[enough] > TERMINATOR * strength) & (size[enough] < limit)
    return b, use, residual


def tukey_weights(design: Array, values: Array) -> Array:
    """Return the weights (P,) at which a robust linear fit comes to rest."""
    weight = np.ones(len(values))
    for _ in range(12):
        weighted = weight[:, None] * design
        residual = values - design @ np.linalg.lstsq(design.T @ weighted, values @ weighted, rcond=None)[0]
        weight = tukey(residual, TUKEY * max(spread(residual), 1e-7))
    return weight
