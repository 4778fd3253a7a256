"""What the camera sees of a mesh, and which of its points lie in shadow."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.rays import RayCaster

Array = NDArray[np.float64]
Seen = tuple[NDArray[np.int64], Array, Array]
"""Face (...), -1 if none; barycentric weights of its corners (..., 3); points (..., 3), mm, not finite where none."""
LIFT = 1e-4
"""Of the mesh's radius: how far rays start from the surface that they leave."""


@dataclass(frozen=True, eq=False)
class Sight:
    """What is seen: a mesh, in the camera frame, before the camera and under the lights, near or distant.

    normals (H, W, 3): Of what each pixel sees, where they are better known than by the mesh's vertices; NaN: unknown.
    """

    mesh: Mesh
    camera: Camera
    lights: Lights
    normals: NDArray[np.float32] | None = None

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh)

    def rows(self, rows: slice, columns: slice) -> Iterator[tuple[slice, NDArray[np.int64], Array, Array]]:
        """Yield bands of a box of the picture: its rows, and what each of its pixels' centres sees."""
        for start in range(rows.start, rows.stop, 64):
            band = slice(start, min(start + 64, rows.stop))
            yield band, *self.at(self.camera.grid(band)[:, columns])

    def at(self, pixels: Array) -> Seen:
        """Return what pixels (..., 2) anywhere see."""
        origins, directions = (part.reshape(-1, 3) for part in self.camera.rays(pixels))
        # The orthographic camera's plane z = 0 may lie anywhere in the mesh.
        hits = self._caster.cast(origins, directions, lines=self.camera.is_orthographic)
        points = origins + np.where(hits.hit, hits.distance, np.nan)[:, None] * directions
        shape = pixels.shape[:-1]
        return hits.face.reshape(shape), hits.weights.reshape(*shape, 3), points.reshape(*shape, 3)

    def seen_faces(self, rows: slice, columns: slice) -> NDArray[np.bool_]:
        """Return (T,) whether the camera sees a face: at a pixel's centre of the box, or at one of its corners."""
        mesh = self.mesh
        seen = np.zeros(len(mesh.faces), bool)
        for _, face, _, _ in self.rows(rows, columns):
            seen[face[face >= 0]] = True
        toward = np.zeros_like(mesh.vertices) + [0.0, 0.0, 1.0]
        if not self.camera.is_orthographic:
            toward = -mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
        free = ~self._caster.blocked(mesh.vertices + LIFT * mesh.radius_mm * toward, toward)
        front = np.sum(mesh.face_normals * toward[mesh.faces[:, 0]], 1) > 0
        return seen | (front & free[mesh.faces].any(1))

    def shadows(self, points: Array, normals: Array, flat: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return (P, F) attached and cast: the light is behind the surface; it is before it, but something is between.

        `normals`, `flat` (P, 3): those that are shaded with, and the faces'; on the side that is seen.
        """
        lights = self.lights
        attached = np.empty((len(points), len(lights)), bool)
        cast = np.zeros_like(attached)
        # Light by light: all vectors of a hundred lights would not fit beside a picture's maps.
        for index in range(len(lights)):
            end = None if lights.positions_mm is None else lights.positions_mm[index]
            toward = np.broadcast_to(lights.directions[index], points.shape) if end is None else unit(end - points)
            attached[:, index] = (np.sum(toward * normals, 1) <= 0) | (np.sum(toward * flat, 1) <= 0)
            facing = ~attached[:, index]
            toward, far = toward[facing], np.inf
            origins = points[facing] + LIFT * self.mesh.radius_mm * (flat[facing] + toward)
            if end is not None:
                far = np.linalg.norm(end - origins, axis=1)
                toward = (end - origins) / far[:, None]
            cast[facing, index] = self._caster.blocked(origins, toward, far)
        return attached, cast
