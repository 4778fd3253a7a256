"""What the camera sees of a mesh, and what lies inside it: ray casting by Embree, through Open3D."""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh

Array = NDArray[np.float64]


def seen_faces(
    vertices: Array, faces: NDArray[np.int64], camera: Camera, rows: slice, columns: slice
) -> NDArray[np.bool_]:
    """Return (T,) whether the camera sees a face: at a pixel's centre, or at one of its corners."""
    open3d = import_open3d()
    middle = vertices.mean(0)
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles((vertices - middle).astype(np.float32), faces.astype(np.uint32))
    seen = np.zeros(len(faces), bool)
    reach = float(np.linalg.norm(vertices - middle, axis=1).max())
    for row in range(rows.start, rows.stop, 64):
        origins, directions = camera.rays(camera.grid(slice(row, min(row + 64, rows.stop)))[:, columns])
        # Start beside the mesh: Embree's float32 keeps seven digits, and a camera may stand metres away.
        near = np.maximum(np.sum((middle - origins) * directions, -1, keepdims=True) - 1.01 * reach, 0)
        if camera.is_orthographic:
            near = np.sum((middle - origins) * directions, -1, keepdims=True) - 1.01 * reach
        rays = np.concatenate([origins + near * directions - middle, directions], -1).astype(np.float32)
        hit = scene.cast_rays(open3d.core.Tensor(rays))["primitive_ids"].numpy()
        seen[hit[hit != scene.INVALID_ID]] = True
    toward = np.array([0.0, 0.0, 1.0]) + np.zeros_like(vertices)
    if not camera.is_orthographic:
        toward = -vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    rays = np.concatenate([vertices - middle + 1e-4 * reach * toward, toward], 1).astype(np.float32)
    free = ~scene.test_occlusions(open3d.core.Tensor(rays)).numpy()
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    front = np.sum(np.cross(b - a, c - a) * toward[faces[:, 0]], 1) > 0
    return seen | (front & free[faces].any(1))


def import_open3d() -> Any:
    """Import Open3D where libusb-1.0 is not installed, as on a bare machine, too."""
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


def inside(mesh: Mesh, points: Array) -> NDArray[np.bool_]:
    """Return (P,) whether points (P, 3) lie inside a mesh; False everywhere if it is not closed."""
    near = np.linalg.norm(points - mesh.center_mm, axis=1) < mesh.radius_mm
    if near.any():
        import trimesh

        if not trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight:
            return np.zeros(len(points), bool)
        open3d = import_open3d()
        scene = open3d.t.geometry.RaycastingScene()
        scene.add_triangles((mesh.vertices - mesh.center_mm).astype(np.float32), mesh.faces.astype(np.uint32))
        query = open3d.core.Tensor((points[near] - mesh.center_mm).astype(np.float32))
        near[near] = scene.compute_occupancy(query, nsamples=3).numpy() > 0.5
    return near
