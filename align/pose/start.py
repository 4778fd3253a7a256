"""Where could the scan stand? Every orientation tried, without a start.

The scan is looked at from directions all around, from so far away that its size alone tells the distance. Silhouette
and normals of each view are sampled on a polar grid about the silhouette's centroid; there, a turn in the image plane
is a shift along the angle, and normals written as (radial, tangential, toward the viewer) do not change with it. So all
turns of all views are scored at once, by one product of matrices, against the mask and the photometric-stereo normals.
"""

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from align.pose.photographed import step_across
from scene.camera import Camera
from scene.errors import AlignError
from scene.light_layouts import GOLDEN_ANGLE, directions_of
from scene.normals import unit
from scene.pose import Pose, rotation_from_vector
from scene.rays import RayCaster

Array = NDArray[np.float64]

VIEWS = 1200
"""View directions: neighbours are 6 degrees apart."""
RADII, ANGLES = 24, 72
"""The polar grid; a turn is found to 2.5 degrees."""
RASTER = 40
"""Rays along a side of the square raster that measures a view's area and centroid."""


def find_starts(
    caster: RayCaster, camera: Camera, mask: NDArray[np.bool_], normals: NDArray | None, *, count: int
) -> list[Pose]:
    """Return the `count` best distinct poses of a scan, best first, any two at least 10 degrees apart.

    `mask` (H, W), `normals` (H, W, 3), NaN where unknown, or None: of the object.

    Under perspective the depth is the one at which the scan looks as large as the mask; an orthographic camera does not
    tell it, and the scan is put just behind the plane z = 0.
    """
    step = step_across(mask)
    camera, mask = camera.every(step), mask[::step, ::step]
    aim, area, reach = _aim(camera, mask)
    # Fibonacci's spiral: evenly over the sphere.
    index = np.arange(VIEWS) + 0.5
    views = looking_along(directions_of(1 - 2 * index / VIEWS, GOLDEN_ANGLE * index))
    middle, seen_area = _middle(caster, views)
    # In mm per image coordinate: the distance, but of an orthographic camera.
    scale = np.ones(VIEWS) if camera.is_orthographic else np.sqrt(seen_area / area)
    radius = (np.arange(RADII) + 0.5) / RADII * 1.1 * reach
    angle = np.linspace(0, 2 * np.pi, ANGLES, endpoint=False)
    polar = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], -1)).reshape(-1, 2)

    normals = np.full((*mask.shape, 3), np.nan) if normals is None else normals[::step, ::step]
    cell = reach / RADII * camera.fx / 2
    inside, wanted = _sample_target(camera.project(aim.apply(np.insert(polar, 2, -1.0, 1))), cell, mask, normals)
    seen, rendered = _look(caster, views, middle[:, None] + scale[:, None, None] * polar)
    score = _score(inside, wanted @ aim.rotation, seen, rendered, angle, radius)

    depth = np.full(VIEWS, 1.5 * caster.mesh.radius_mm) if camera.is_orthographic else scale
    offsets = -np.column_stack([middle, np.maximum(depth, 1.2 * caster.mesh.radius_mm)])
    offsets[:, 2] -= views[:, 2] @ caster.mesh.center_mm
    starts, turns = [], np.zeros((0, 9))
    for flat in np.argsort(score, axis=None)[::-1]:
        view, turn = np.unravel_index(flat, score.shape)
        spin = rotation_from_vector(np.array([0, 0, angle[turn]]))
        own = (spin @ views[view]).ravel()
        # The trace of two rotations' difference is 1 + 2 cos of its angle.
        if (turns @ own < 1 + 2 * np.cos(np.radians(10))).all():
            turns = np.vstack([turns, own])
            starts.append(aim @ Pose.from_rotation_translation(spin @ views[view], spin @ offsets[view]))
            if len(starts) == count:
                break
    return starts


def _aim(camera: Camera, mask: NDArray[np.bool_]) -> tuple[Pose, float, float]:
    """Return camera_from_aim of a camera turned (orthographic: shifted) until it looks along the mean of a mask's rays.

    And the mask's area, and how far it reaches from the axis, in image coordinates x = X / -Z, y = Y / -Z of the aim's
    frame (orthographic: X, Y in mm).
    """
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
    return pose, float(area), float(np.linalg.norm(xy, axis=1).max())


def _middle(caster: RayCaster, views: Array) -> tuple[Array, Array]:
    """Return the centroid (V, 2) of the scan's silhouette in each view, mm, and its area (V,)."""
    side = 1.05 * caster.mesh.radius_mm * ((np.arange(RASTER) + 0.5) / RASTER * 2 - 1)
    raster = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    places = (views[:, :2] @ caster.mesh.center_mm)[:, None] + raster
    hits = _look(caster, views, places)[0]
    if not hits.any(1).all():
        raise AlignError("the scan cannot be seen from some side: it is no surface. Export it again.")
    return (hits[..., None] * places).sum(1) / hits.sum(1)[:, None], hits.sum(1) * (side[1] - side[0]) ** 2


def _look(caster: RayCaster, views: Array, xy: Array) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Return what parallel rays see at places xy (V, P, 2), mm, of each view: hits (V, P), normals (V, P, 3)."""
    hit, normals = np.zeros(xy.shape[:2], bool), np.zeros((*xy.shape[:2], 3), np.float32)
    step = max(1, (1 << 18) // xy.shape[1])
    for first in range(0, len(views), step):
        part = slice(first, first + step)
        # Row vectors times R is R^T applied: from the view's frame into the scan's.
        origins = (xy[part] @ views[part, :2]).reshape(-1, 3)
        found = caster.cast(origins, np.repeat(-views[part, 2], xy.shape[1], axis=0), lines=True)
        smooth = np.nan_to_num(found.interpolate(caster.mesh, caster.normals))
        # The inside, seen through a hole, has no normals; it is silhouette all the same.
        smooth[~found.front] = 0
        hit[part] = found.hit.reshape(hit[part].shape)
        normals[part] = smooth.reshape(normals[part].shape) @ views[part].transpose(0, 2, 1)
    return hit, normals


def _sample_target(
    pixels: Array, cell: float, mask: NDArray[np.bool_], normals: NDArray
) -> tuple[NDArray[np.bool_], Array]:
    """Return mask (P,) and normals (P, 3), camera frame, averaged over `cell` px, at pixels (P, 2); 0 where unknown."""
    import cv2

    height, width = mask.shape
    # The samples are coarser than the pixels: blur first, so that each stands for its cell.
    known = mask & np.isfinite(normals).all(-1)
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), max(cell, 0.5))
    mean = cv2.GaussianBlur(np.where(known[..., None], normals, 0).astype(np.float32), (0, 0), max(cell, 0.5))
    u = np.clip(np.round(pixels[:, 0]), 0, width - 1).astype(int)
    v = np.clip(np.round(pixels[:, 1]), 0, height - 1).astype(int)
    inside = mask[v, u] & (np.abs(pixels - np.stack([u, v], -1)) <= 0.51).all(1)
    vector = mean[v, u].astype(np.float64)
    return inside, np.where((inside & (weight[v, u] > 0.05))[:, None], unit(vector), 0.0)


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
