"""The recovered surface as a mesh that MeshLab, trimesh and others open: a vertex a pixel, torn where the depth is."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.meshes.ply import write_ply
from formats.picture_files import srgb_from_linear
from scene.camera import Camera
from solve.surface.integration import TORN_PX, IntegratedSurface


@dataclass(frozen=True)
class SurfaceMesh:
    """A surface as triangles.

    Vertices (V, 3) in mm, camera frame; unit normals (V, 3) toward the camera's side; colors (V, 3): albedo, sRGB, the
    99th percentile at nine tenths of white; faces (T, 3), counter-clockwise seen from the camera.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    colors: NDArray[np.uint8]
    faces: NDArray[np.int64]

    def write(self, path: Path) -> None:
        """Write binary PLY [Turk1994]."""
        places, normals = self.vertices.astype(np.float32), self.normals.astype(np.float32)
        columns = {"x y z": places, "nx ny nz": normals, "red green blue": self.colors}
        write_ply(path, columns, self.faces, "millimetres; camera frame: x right, y up, z toward the viewer")


def mesh_of(surface: IntegratedSurface, normals: NDArray, albedo: NDArray, camera: Camera) -> SurfaceMesh:
    """Return the mesh of a surface.

    Normals and albedo (H, W, 3) are those of a method's estimate. No face spans two neighbours that lie farther than
    `TORN_PX` off each other's tangent planes. Each square of four pixels gives two triangles, where it is whole; where
    one corner is missing, the triangle of the other three is given.
    """
    inside = np.isfinite(surface.z_mm)
    number = np.full(inside.shape, -1)
    number[inside] = np.arange(np.count_nonzero(inside))
    right, down = surface.gap_right <= TORN_PX, surface.gap_down <= TORN_PX
    # a b    The square's corners; which of its four sides hold.
    # c d
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    top, bottom, left, far = right[:-1, :-1], right[1:, :-1], down[:-1, :-1], down[:-1, 1:]
    first, second = top & left, bottom & far
    # Where the diagonal b-c does not serve two triangles, a-d may serve one.
    third, fourth = ~first & ~second & left & bottom, ~first & ~second & top & far
    faces = [
        np.stack([corner[chosen] for corner in corners], -1)
        for chosen, corners in ((first, (a, c, b)), (second, (b, c, d)), (third, (a, c, d)), (fourth, (a, d, b)))
    ]
    points = surface.points_mm(camera)[inside]
    return SurfaceMesh(points, np.asarray(normals, np.float64)[inside], _colors(albedo[inside]), np.concatenate(faces))


def _colors(albedo: NDArray) -> NDArray[np.uint8]:
    known = np.nan_to_num(np.asarray(albedo, np.float64))
    top = float(np.percentile(known, 99)) if known.size else 0.0
    linear = 0.9 * known / top if top > 0 else np.zeros_like(known)
    return np.round(255 * srgb_from_linear(linear)).astype(np.uint8)
