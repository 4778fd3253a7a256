"""Ground-truth normals: the registered scan, seen through the camera, and how sure each normal is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.embree import Hits, RayCaster
from align.motion import nudge
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.pose import Pose

Array = NDArray[np.float64]

GRAZING_DEG = 80.0
"""Beyond this angle between normal and view a pixel covers six times its width of surface, and more."""
EDGE_FOOTPRINTS = 2.0
"""Neighbours whose depths miss each other's tangent plane by more pixel widths than this lie across a depth edge."""
SPREAD_DEG = 60.0
"""Corner normals of one face that differ by more lie across a crease finer than the scan."""
BAND_PIXELS = 1 << 19
NOISE_DRAWS = 6


@dataclass(frozen=True)
class Truth:
    """What the scan says of each pixel.

    Parameters
    ----------
    normals : (H, W, 3) float32
        Unit, camera frame; NaN where unknown: off the scan, at depth edges and holes, at grazing angles, on
        back faces, across creases finer than the scan.
    depth_mm : (H, W) float32
        -z of the point, NaN off the scan.
    sigma_deg : (H, W) float32
        Expected (rms) angle between `normals` and the real normal: pose and scan noise; NaN where normals are.
    mask : (H, W) bool
        The scan's silhouette, with the pixels whose normal is unknown.
    """

    normals: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    sigma_deg: NDArray[np.float32]
    mask: NDArray[np.bool_]


def ground_truth(mesh: Mesh, pose: Pose, camera: Camera, *, covariance: NDArray | None = None) -> Truth:
    """Cast a ray through every pixel's centre and read the scan's normals.

    Parameters
    ----------
    mesh : Mesh
        The scan, mm.
    pose : Pose
        camera_from_scan.
    camera : Camera
        Perspective or orthographic; distortion is honoured.
    covariance : (6, 6) float, optional
        Of the pose, as in `Registration.covariance`; without it, sigma is the scan's part alone.

    Returns
    -------
    truth : Truth

    Notes
    -----
    Normals are the vertices' area-weighted ones, interpolated over the face. The pose's part of sigma is what
    the normal at the pixel changes by when the pose moves one sigma along each axis of its covariance
    (so curvature counts, and the ray's new hit with it); the scan's part is what its own noise, estimated from
    the vertices, does to its normals. Interpolation between vertices is not in it.
    """
    caster = RayCaster(mesh)
    height, width = camera.height, camera.width
    normals = np.full((height, width, 3), np.nan, np.float32)
    depth = np.full((height, width), np.nan, np.float32)
    sigma = np.full((height, width), np.nan, np.float32)
    scatter = normal_noise_deg(mesh)
    top, bottom = _rows(mesh, pose, camera)
    step = max(1, BAND_PIXELS // width)
    for first in range(top, bottom, step):
        last = min(first + step, bottom)
        # One row more on each side: its depth decides about edges.
        rows = slice(max(first - 1, 0), min(last + 1, height))
        inner = slice(first - rows.start, last - rows.start)
        pixels = camera.grid(rows)
        shape = pixels.shape[:2]
        hits = caster.look(camera, pose, pixels.reshape(-1, 2))
        if not hits.hit.any():
            continue
        origins, directions = camera.rays(pixels)
        points = origins + directions * np.where(hits.hit, hits.distance, np.nan).reshape(*shape, 1)
        smooth = unit(pose.rotate(hits.interpolate(mesh, mesh.vertex_normals))).reshape(*shape, 3)
        good = _reliable(mesh, pose, camera, hits, points, smooth, directions)[inner]
        depth[first:last] = -points[inner, :, 2]
        normals[first:last] = np.where(good[..., None], smooth[inner], np.nan)
        v, u = np.nonzero(good)
        here = pixels[inner][v, u]
        square = hits.interpolate(mesh, scatter[:, None] ** 2).reshape(shape)[inner][v, u]
        if covariance is not None:
            square = square + _pose_variance(caster, pose, camera, here, smooth[inner][v, u], covariance)
        sigma[first + v, u] = np.sqrt(square)
    return Truth(normals, depth, sigma, np.isfinite(depth))


def _rows(mesh: Mesh, pose: Pose, camera: Camera) -> tuple[int, int]:
    """Return the range of rows that can see the mesh."""
    v = camera.project(pose.apply(mesh.vertices))[:, 1]
    if np.isnan(v).any():
        return 0, camera.height
    return max(int(v.min()) - 2, 0), min(int(v.max()) + 3, camera.height)


def _reliable(
    mesh: Mesh, pose: Pose, camera: Camera, hits: Hits, points: Array, normals: Array, directions: Array
) -> NDArray[np.bool_]:
    """Return (h, w): the pixel sees one piece of well-sampled surface, from its front."""
    shape = points.shape[:2]
    face = np.maximum(hits.face, 0)
    facing = -np.einsum("hwk,hwk->hw", normals, directions)
    front = -np.einsum("hwk,hwk->hw", pose.rotate(mesh.face_normals[face]).reshape(*shape, 3), directions)
    good = hits.hit.reshape(shape) & (facing > np.cos(np.radians(GRAZING_DEG))) & (front > 0)
    corners = mesh.vertex_normals[mesh.faces[face]]
    closest = np.minimum.reduce([np.einsum("pk,pk->p", corners[:, i], corners[:, i - 1]) for i in range(3)])
    good &= closest.reshape(shape) > np.cos(np.radians(SPREAD_DEG))
    depth = np.ones(shape) if camera.is_orthographic else -points[..., 2]
    footprint = depth / camera.fx
    for axis in (0, 1):
        a = tuple(slice(None, -1) if k == axis else slice(None) for k in range(2))
        b = tuple(slice(1, None) if k == axis else slice(None) for k in range(2))
        across = points[b] - points[a]
        miss = np.minimum(
            np.abs(np.einsum("hwk,hwk->hw", across, normals[a])), np.abs(np.einsum("hwk,hwk->hw", across, normals[b]))
        )
        # A neighbour off the scan gives NaN, and is an edge: silhouette or hole.
        edge = ~(miss < EDGE_FOOTPRINTS * footprint[a])
        good[a] &= ~edge
        good[b] &= ~edge
    return good


def _pose_variance(
    caster: RayCaster, pose: Pose, camera: Camera, pixels: NDArray, normals: Array, covariance: NDArray
) -> Array:
    """Return (P,), degrees squared: the normals' change over one sigma of each axis of the pose's covariance."""
    mesh = caster.mesh
    pivot = pose.apply(mesh.center_mm)
    # The axes are found in lengths (radians times the scan's radius): radians and millimetres do not mix.
    length = np.array([mesh.radius_mm] * 3 + [1.0] * 3)
    values, axes = np.linalg.eigh(covariance * length * length[:, None])
    total = np.zeros(len(pixels))
    for value, axis in zip(values, axes.T, strict=True):
        if value <= 0:
            continue
        moved = nudge(pose, axis * np.sqrt(value) / length, pivot)
        after = unit(moved.rotate(caster.look(camera, moved, pixels).interpolate(mesh, mesh.vertex_normals)))
        total += np.nan_to_num(angular_error_deg(after, normals) ** 2)
    return total


def normal_noise_deg(mesh: Mesh, *, seed: int = 0) -> Array:
    """Return (V,) the rms angle by which the scan's own noise turns the interpolated normal around each vertex.

    The noise's size comes from the mesh: the part of its roughness that neither slope nor curvature explains
    (the graph's Laplacian, twice, along the normal), compared with what that filter makes of white noise on
    the same mesh; then that noise is added in a few draws, and the normals' answer averaged: at the vertices,
    for where it is large, and at random points of the faces, for how large it is between them.
    """
    from scipy.sparse import csr_matrix, diags

    count = len(mesh.vertices)
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, 1, axis=1).ravel()
    ones = np.ones(2 * len(start))
    graph = csr_matrix((ones, (np.concatenate([start, end]), np.concatenate([end, start]))), (count, count))
    graph.data[:] = 1
    graph = diags(1 / np.maximum(np.asarray(graph.sum(1)).ravel(), 1)) @ graph
    generator = np.random.default_rng(seed)

    def rough(along: Array) -> Array:
        once = along - graph @ along
        return once - graph @ once

    normals = mesh.vertex_normals
    offset = mesh.vertices - graph @ mesh.vertices
    bump = np.einsum("vk,vk->v", offset, normals)
    white = generator.standard_normal(count)
    sigma_mm = np.median(np.abs(bump - graph @ bump)) / max(float(np.median(np.abs(rough(white)))), 1e-12)
    weights = generator.dirichlet(np.ones(3), len(mesh.faces))
    smooth = np.einsum("tc,tck->tk", weights, normals[mesh.faces])
    total, between = np.zeros(count), 0.0
    for _ in range(NOISE_DRAWS):
        shaken = Mesh(
            mesh.vertices + normals * (sigma_mm * generator.standard_normal(count))[:, None], mesh.faces
        ).vertex_normals
        total += np.nan_to_num(angular_error_deg(shaken, normals)) ** 2
        inside = np.einsum("tc,tck->tk", weights, shaken[mesh.faces])
        between += float(np.mean(np.nan_to_num(angular_error_deg(inside, smooth)) ** 2))
    at_corners = float(np.mean(np.einsum("tc,tc->t", weights, total[mesh.faces])))
    shrink = between / at_corners if at_corners > 0 else 1.0
    # Few draws scatter from vertex to vertex; neighbours share their noise.
    return np.sqrt(graph @ (total / NOISE_DRAWS) * shrink)
