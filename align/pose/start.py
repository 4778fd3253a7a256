"""Where could the scan stand? Every orientation tried, without a start.

The scan is looked at from directions all around. Silhouette and normals of each view are sampled on
a polar grid about the silhouette's centroid; there, a turn in the image plane is a shift along the angle,
and normals written as (radial, tangential, toward the viewer) do not change with it. So all turns of
all views are scored at once, by one product of matrices, against the mask and the photometric-stereo normals.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import even_directions, looking_along
from align.pose.photographed import ACROSS, longer_side
from scene.camera import Camera
from scene.errors import AlignError
from scene.pose import Pose, rotation_from_vector
from scene.rays import RayCaster

Array = NDArray[np.float64]

VIEWS = 1200
"""View directions: neighbours are 6 degrees apart."""
RADII, ANGLES = 24, 72
"""The polar grid; a turn is found to 2.5 degrees."""
RASTER = 28
"""Rays along a side of the square raster that measures a view's area and centroid."""


@dataclass(frozen=True)
class Aim:
    """A camera turned (perspective) or shifted (orthographic) until it looks at the mask's centroid.

    Image coordinates here are x = X / -Z, y = Y / -Z of the turned frame (orthographic: X, Y in mm).
    """

    camera: Camera
    pose: Pose
    """camera_from_aim."""
    area: float
    """The mask's, in image coordinates squared."""
    reach: float
    """Greatest distance of a mask pixel from the axis, in image coordinates."""

    @classmethod
    def at(cls, camera: Camera, mask: NDArray[np.bool_]) -> "Aim":
        """Aim at a mask (H, W), along the mean of its pixels' rays."""
        from scipy.spatial.transform import Rotation

        v, u = np.nonzero(mask)
        origins, directions = camera.rays(np.stack([u, v], -1))
        # The smallest turn that takes -z to that ray: none under an orthographic camera, which is shifted.
        rotation = Rotation.align_vectors(directions.mean(0), [0.0, 0.0, -1.0])[0].as_matrix()
        pose = Pose.from_rotation_translation(rotation, [*origins[:, :2].mean(0), 0.0])
        turned = directions @ rotation
        xy = pose.inverse().apply(origins)[:, :2] + turned[:, :2] / -turned[:, 2:]
        # A pixel covers cos^3 / f^2 of solid angle, and 1 / cos^3 of that in the turned image.
        area = ((directions[:, 2] / turned[:, 2]) ** 3).sum() / (camera.fx * camera.fy)
        return cls(camera, pose, float(area), float(np.linalg.norm(xy, axis=1).max()))

    def rays(self, xy: NDArray) -> tuple[Array, Array]:
        """Return origins and unit directions (P, 3), aim frame, of image coordinates (P, 2)."""
        return Camera(1, 1, 1.0, 1.0, 0.0, 0.0, projection=self.camera.projection).rays(xy * [1, -1])

    def pixels(self, xy: NDArray) -> Array:
        """Return the camera's pixels (P, 2) of image coordinates (P, 2)."""
        origins, directions = self.rays(xy)
        return self.camera.project(self.pose.apply(origins + directions))


def find_starts(
    caster: RayCaster, camera: Camera, mask: NDArray[np.bool_], normals: NDArray | None, *, count: int
) -> list[Pose]:
    """Return the `count` best distinct poses of a scan, best first, any two at least 10 degrees apart.

    `mask` (H, W), `normals` (H, W, 3), NaN where unknown, or None: of the object.

    Under perspective the depth is the one at which the scan looks as large as the mask; an orthographic camera does not
    tell it, and the scan is put just behind the plane z = 0.
    """
    step = -(-longer_side(mask) // ACROSS)
    camera, mask = camera.every(step), mask[::step, ::step]
    aim = Aim.at(camera, mask)
    views = looking_along(even_directions(VIEWS))
    offsets = _place(caster, aim, views)
    radius = (np.arange(RADII) + 0.5) / RADII * 1.1 * aim.reach
    angle = np.linspace(0, 2 * np.pi, ANGLES, endpoint=False)
    polar = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], -1)).reshape(-1, 2)

    normals = np.full((*mask.shape, 3), np.nan) if normals is None else normals[::step, ::step]
    inside, wanted = _sample_target(aim, mask, normals, polar)
    seen, rendered = _cast_views(caster, aim, views, offsets, polar, with_normals=True)
    score = _score(inside, wanted, seen, rendered, angle, radius)

    starts, turns = [], np.zeros((0, 9))
    for flat in np.argsort(score, axis=None)[::-1]:
        view, turn = np.unravel_index(flat, score.shape)
        spin = rotation_from_vector(np.array([0, 0, angle[turn]]))
        own = (spin @ views[view]).ravel()
        # The trace of two rotations' difference is 1 + 2 cos of its angle.
        if (turns @ own < 1 + 2 * np.cos(np.radians(10))).all():
            turns = np.vstack([turns, own])
            starts.append(aim.pose @ Pose.from_rotation_translation(spin @ views[view], spin @ offsets[view]))
            if len(starts) == count:
                break
    return starts


def _place(caster: RayCaster, aim: Aim, views: Array) -> Array:
    """Return translations (V, 3), aim frame, that give each view the mask's centroid and area."""
    mesh, is_flat = caster.mesh, aim.camera.is_orthographic
    side = (np.arange(RASTER) + 0.5) / RASTER * 2 - 1
    raster = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    centers = views @ mesh.center_mm
    # A first distance from the mean projected area of a convex body, a quarter of its surface.
    first, second, third = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    surface = np.linalg.norm(np.cross(second - first, third - first), axis=1).sum() / 2
    near = 1.5 * mesh.radius_mm
    distance = np.full(len(views), near if is_flat else max(np.sqrt(surface / 4 / aim.area), near))
    middle = np.zeros((len(views), 2))
    for _ in range(2):
        offsets = np.concatenate([middle, -distance[:, None]], 1) - centers
        # The raster follows the mesh: it must hold all of it, wherever the last round put it.
        away = np.ones(len(views)) if is_flat else distance
        wide = 1.15 * mesh.radius_mm / (away if is_flat else np.sqrt(distance**2 - mesh.radius_mm**2))
        xy = (middle / away[:, None])[:, None] + wide[:, None, None] * raster
        hits = _cast_views(caster, aim, views, offsets, xy, with_normals=False)[0]
        share = hits.mean(1)
        if not share.all():
            raise AlignError("the scan cannot be seen from some side: it is no surface. Export it again.")
        middle = middle - (hits[..., None] * xy).sum(1) / hits.sum(1)[:, None] * away[:, None]
        if not is_flat:
            distance = np.maximum(distance * 2 * wide * np.sqrt(share / aim.area), 1.2 * mesh.radius_mm)
    return np.concatenate([middle, -distance[:, None]], 1) - centers


def _cast_views(
    caster: RayCaster, aim: Aim, views: Array, offsets: Array, xy: Array, *, with_normals: bool
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Cast image coordinates (V, P, 2) or (P, 2) in every view; return hits (V, P), normals (V, P, 3) aim frame."""
    count = xy.shape[-2]
    hit = np.zeros((len(views), count), bool)
    normals = np.zeros((len(views), count, 3) if with_normals else (0, count, 3), np.float32)
    step = max(1, (1 << 18) // count)
    for first in range(0, len(views), step):
        part = slice(first, first + step)
        block = np.broadcast_to(xy if xy.ndim == 2 else xy[part], (len(views[part]), count, 2))
        origins, directions = aim.rays(block.reshape(-1, 2))
        origins = origins.reshape(*block.shape[:2], 3) - offsets[part, None]
        directions = directions.reshape(*block.shape[:2], 3)
        # Row vectors times R is R^T applied: from the aim frame into the scan's.
        found = caster.cast((origins @ views[part]).reshape(-1, 3), (directions @ views[part]).reshape(-1, 3))
        hit[part] = found.hit.reshape(block.shape[:2])
        if with_normals:
            smooth = np.nan_to_num(found.interpolate(caster.mesh, caster.normals))
            # The inside, seen through a hole, has no normals; it is silhouette all the same.
            smooth[~found.front] = 0
            normals[part] = smooth.reshape(*block.shape[:2], 3) @ views[part].transpose(0, 2, 1)
    return hit, normals


def _sample_target(
    aim: Aim, mask: NDArray[np.bool_], normals: NDArray, polar: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Return mask (P,) and normals (P, 3), aim frame and averaged over a grid cell, at polar samples."""
    import cv2

    pixels = aim.pixels(polar)
    height, width = mask.shape
    # The samples are coarser than the pixels: blur first, so that each stands for its cell.
    cell = aim.reach / RADII * aim.camera.fx / 2
    known = mask & np.isfinite(normals).all(-1)
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), max(cell, 0.5))
    mean = cv2.GaussianBlur(np.where(known[..., None], normals, 0).astype(np.float32), (0, 0), max(cell, 0.5))
    u = np.clip(np.round(pixels[:, 0]), 0, width - 1).astype(int)
    v = np.clip(np.round(pixels[:, 1]), 0, height - 1).astype(int)
    within = (np.abs(pixels - np.stack([u, v], -1)) <= 0.51).all(1)
    inside = mask[v, u] & within
    vector = mean[v, u].astype(np.float64)
    length = np.linalg.norm(vector, axis=1)
    good = inside & (weight[v, u] > 0.05) & (length > 0)
    out = np.zeros((len(polar), 3))
    out[good] = (vector[good] / length[good][:, None]) @ aim.pose.rotation
    return inside, out


def _score(
    inside: NDArray[np.bool_], target: Array, seen: NDArray[np.bool_], rendered: NDArray, angle: Array, radius: Array
) -> Array:
    """Return (V, ANGLES): overlap of the silhouettes times agreement of the normals, for every view and turn."""
    shape = (RADII, ANGLES)
    area = np.repeat(radius, ANGLES)

    def polar_frame(vectors: NDArray) -> NDArray:
        x, y, z = (vectors[..., i].reshape(*vectors.shape[:-2], *shape) for i in range(3))
        return np.stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z], -3)

    def correlate(a: NDArray, views: NDArray) -> NDArray:
        # sum over the grid of a(phi) view(phi - turn): each view turned by +turn against the target.
        a = a.reshape(-1, *shape).astype(np.float32)
        turned = np.stack([np.roll(a, -turn, axis=-1).ravel() for turn in range(ANGLES)])
        return views.reshape(len(views), -1).astype(np.float32) @ turned.T

    known = np.linalg.norm(target, axis=1) > 0.5
    overlap = correlate(inside * area, seen)
    both = correlate(known * area, np.linalg.norm(rendered, axis=-1) > 0.5)
    agreement = correlate(polar_frame(target * area[:, None]), polar_frame(rendered))
    union = (inside * area).sum() + (seen * area).sum(1)[:, None] - overlap
    cosine = np.clip(agreement / np.maximum(both, 1e-6), -1, 1)
    # Angles weigh as in a Gaussian of 25 degrees: photometric-stereo normals may be 20 degrees off.
    return overlap / union * np.exp((cosine - 1) / np.radians(25) ** 2)
