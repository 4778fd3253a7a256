"""What the camera sees of a mesh, and what lies inside it: ray casting by Embree, through Open3D."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.ray_casting import import_open3d

Array = NDArray[np.float64]


class Sight:
    """A mesh, given in the camera frame, seen by the camera."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64], camera: Camera) -> None:
        open3d = import_open3d()
        self._tensor: Any = open3d.core.Tensor
        self._vertices, self._faces, self._camera = vertices, faces, camera
        # Embree's float32 keeps seven digits, and a camera may stand metres away: work about the mesh's middle.
        self._middle = (vertices.min(0) + vertices.max(0)) / 2
        self._reach = float(np.linalg.norm(vertices - self._middle, axis=1).max())
        self._scene: Any = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles((vertices - self._middle).astype(np.float32), faces.astype(np.uint32))

    def rows(self, rows: slice, columns: slice) -> Iterator[tuple[slice, NDArray[np.int64], Array, Array]]:
        """Yield bands of a box of the picture.

        band: Rows of the picture.
        face (h, w): The triangle that each pixel's centre sees, -1 if none.
        weights (h, w, 3): Barycentric, of the triangle's corners.
        points (h, w, 3): Where, mm; not finite where nothing is seen.
        """
        for start in range(rows.start, rows.stop, 64):
            band = slice(start, min(start + 64, rows.stop))
            face, weights, points = self.at(self._camera.grid(band)[:, columns])
            yield band, face, weights, points

    def at(self, pixels: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """Return face (...), weights and points (..., 3), as `rows` gives them, of pixels (..., 2) anywhere."""
        origins, directions = self._camera.rays(pixels)
        near = np.sum((self._middle - origins) * directions, -1, keepdims=True) - 1.01 * self._reach
        if not self._camera.is_orthographic:  # whose plane z = 0 may lie anywhere in the mesh
            near = np.maximum(near, 0)
        origins = origins + near * directions - self._middle
        hit = self._scene.cast_rays(self._tensor(np.concatenate([origins, directions], -1).astype(np.float32)))
        distance = hit["t_hit"].numpy().astype(np.float64)
        found = np.isfinite(distance)
        face = np.where(found, hit["primitive_ids"].numpy().astype(np.int64), -1)
        uv = hit["primitive_uvs"].numpy().astype(np.float64)
        weights = np.concatenate([1 - uv.sum(-1, keepdims=True), uv], -1)
        points = origins + np.where(found, distance, np.nan)[..., None] * directions + self._middle
        return face, weights, points

    def seen_faces(self, rows: slice, columns: slice) -> NDArray[np.bool_]:
        """Return (T,) whether the camera sees a face: at a pixel's centre of the box, or at one of its corners."""
        seen = np.zeros(len(self._faces), bool)
        for _, face, _, _ in self.rows(rows, columns):
            seen[face[face >= 0]] = True
        toward = np.zeros_like(self._vertices) + [0.0, 0.0, 1.0]
        if not self._camera.is_orthographic:
            toward = -self._vertices / np.linalg.norm(self._vertices, axis=1, keepdims=True)
        origins = self._vertices - self._middle + 1e-4 * self._reach * toward
        rays = np.concatenate([origins, toward], 1).astype(np.float32)
        free = ~self._scene.test_occlusions(self._tensor(rays)).numpy()
        a, b, c = (self._vertices[self._faces[:, corner]] for corner in range(3))
        front = np.sum(np.cross(b - a, c - a) * toward[self._faces[:, 0]], 1) > 0
        return seen | (front & free[self._faces].any(1))

    def face_normals(self, face: NDArray[np.int64]) -> Array:
        """Return (P, 3), the unit normals of faces (P,)."""
        a, b, c = (self._vertices[self._faces[face, corner]] for corner in range(3))
        cross = np.cross(b - a, c - a)
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return cross / np.where(length > 0, length, 1)

    def hidden(self, points: Array, normals: Array, toward: Array, end: Array | None) -> NDArray[np.bool_]:
        """Return (P,) whether something stands between points and a light.

        points, normals, toward (P, 3): On the mesh; of the face, on the side of the light; unit, toward the light.
        end (3,): Where a near light stands.
        """
        origins = points + 1e-4 * self._reach * (normals + toward)
        far = np.full(len(points), np.inf)
        if end is not None:
            far = np.linalg.norm(end - origins, axis=1)
            toward = (end - origins) / far[:, None]
        rays = self._tensor(np.concatenate([origins - self._middle, toward], 1).astype(np.float32))
        # One call for all needs one length: what is hit beyond a near light does not count.
        distance = self._scene.cast_rays(rays)["t_hit"].numpy() if end is not None else None
        return self._scene.test_occlusions(rays).numpy() if distance is None else distance < far


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
