"""Ray casting against a mesh: the one place that touches Open3D's Embree.

Open3D's RaycastingScene drives Intel's Embree [Wald2014]. Embree works in float32: rays are
cast in the mesh's own coordinates, moved to the middle of the mesh, so that a scan far from its
origin loses no digits.
"""

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.mesh import Mesh

Array = NDArray[np.float64]

CHUNK = 1 << 19
"""Rays per call: bounds memory at some 40 MB, whatever the image's size."""


def import_open3d() -> Any:
    """Return the module open3d, where libusb-1.0 is not installed, too.

    Open3D is linked against it; the copy that a Python package brings is loaded first.
    """
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


@dataclass(frozen=True)
class Hits:
    """What P rays met.

    Parameters
    ----------
    hit : (P,) bool
    distance : (P,) float64
        Millimetres along the unit direction; inf where nothing was met.
    face : (P,) int64
        Index of the triangle, -1 where nothing was met.
    weights : (P, 3) float64
        Barycentric weights of the triangle's corners.
    front : (P,) bool
        The triangle was hit from outside; through a hole in the scan a ray meets the inside of its other wall.
    """

    hit: NDArray[np.bool_]
    distance: Array
    face: NDArray[np.int64]
    weights: Array
    front: NDArray[np.bool_]

    def interpolate(self, mesh: Mesh, values: NDArray) -> Array:
        """Return per-vertex `values` (V, k) at the hits (P, k); NaN where nothing was met."""
        out = np.full((len(self.hit), values.shape[1]), np.nan)
        corners = mesh.faces[self.face[self.hit]]
        out[self.hit] = np.einsum("pc,pck->pk", self.weights[self.hit], values[corners])
        return out


class RayCaster:
    """A mesh, ready to be hit by rays given in the mesh's own frame.

    Parameters
    ----------
    mesh : Mesh
    normals : (V, 3) float, optional
        Unit normals at the vertices, in place of the mesh's own: without the scan's noise.
    """

    def __init__(self, mesh: Mesh, normals: NDArray | None = None) -> None:
        open3d = import_open3d()
        self.mesh, self._given = mesh, normals
        self._tensor: Any = open3d.core.Tensor
        self._scene: Any = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._points(mesh.vertices), self._tensor(mesh.faces.astype(np.uint32)))

    @cached_property
    def normals(self) -> NDArray:
        """(V, 3) unit normals at the vertices."""
        return self.mesh.vertex_normals if self._given is None else self._given

    def cast(self, origins: NDArray, directions: NDArray, *, lines: bool = False) -> Hits:
        """Return the first hits of rays (P, 3), (P, 3) unit; origins in mm.

        `lines`: what lies behind the origins is met too, as by an orthographic camera, whose rays begin at any z.
        """
        count = len(directions)
        distance = np.full(count, np.inf)
        face = np.full(count, -1, np.int64)
        weights = np.zeros((count, 3))
        for start in range(0, count, CHUNK):
            part = slice(start, start + CHUNK)
            # Start beside the mesh: float32 keeps 7 digits, and a camera may stand metres away.
            near = np.einsum("pk,pk->p", self.mesh.center_mm - origins[part], directions[part])
            near = near - 1.01 * self.mesh.radius_mm
            near = near if lines else np.maximum(near, 0.0)
            answer = self._scene.cast_rays(
                self._rays(origins[part] + near[:, None] * directions[part], directions[part])
            )
            t = answer["t_hit"].numpy()
            distance[part] = t + near
            face[part] = np.where(np.isfinite(t), answer["primitive_ids"].numpy().astype(np.int64), -1)
            weights[part, 1:] = answer["primitive_uvs"].numpy()
        weights[:, 0] = 1 - weights[:, 1] - weights[:, 2]
        facing = np.einsum("pk,pk->p", self.mesh.face_normals[np.maximum(face, 0)], directions)
        return Hits(face >= 0, distance, face, weights, (face >= 0) & (facing < 0))

    def blocked(self, points: NDArray, directions: NDArray, far: NDArray | float = np.inf) -> NDArray[np.bool_]:
        """Return (P,) whether something stands between each point (P, 3) and `far` (P,) mm along its direction."""
        out = np.zeros(len(points), bool)
        reach = np.broadcast_to(np.minimum(far, 4 * self.mesh.radius_mm), len(points))[:, None]
        for start in range(0, len(points), CHUNK):
            part = slice(start, start + CHUNK)
            # Embree counts lengths in the ray's own: 1 is where each ray's reach ends.
            rays = self._rays(points[part], reach[part] * directions[part])
            out[part] = self._scene.test_occlusions(rays, tfar=1.0).numpy()
        return out

    def distance(self, points: NDArray) -> Array:
        """Return (P,), mm, how far points (P, 3) lie from the surface."""
        return self._scene.compute_distance(self._points(points)).numpy().astype(np.float64)

    def inside(self, points: NDArray) -> NDArray[np.bool_]:
        """Return (P,) whether points (P, 3) lie inside the mesh; False everywhere if it is not closed."""
        near = np.linalg.norm(points - self.mesh.center_mm, axis=1) < self.mesh.radius_mm
        if near.any() and self.mesh.is_closed:
            near[near] = self._scene.compute_occupancy(self._points(points[near]), nsamples=3).numpy() > 0.5
            return near
        return np.zeros(len(points), bool)

    def _points(self, points: NDArray) -> Any:
        return self._tensor((points - self.mesh.center_mm).astype(np.float32))

    def _rays(self, origins: NDArray, directions: NDArray) -> Any:
        return self._tensor(np.concatenate([origins - self.mesh.center_mm, directions], 1).astype(np.float32))

    def __reduce__(self) -> tuple:
        # Embree's tree cannot travel to another process; it is built again there, in milliseconds.
        return RayCaster, (self.mesh, self._given)
