"""The recovered surface as a mesh that MeshLab, trimesh and others open: a vertex a pixel, torn where the depth is."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.meshes.ply import write_ply
from formats.picture_files import srgb_from_linear
from scene.camera import Camera
from scene.mesh import Mesh
from solve.surface.integration import TORN_PX, IntegratedSurface


def mesh_of(surface: IntegratedSurface, normals: NDArray, albedo: NDArray, camera: Camera) -> Mesh:
    """Return the mesh of a surface, camera frame, its colours the albedo, the 99th percentile at nine tenths of white.

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
    known = np.nan_to_num(np.asarray(albedo[inside], np.float64))
    top = float(np.percentile(known, 99)) if known.size else 0.0
    colours = 0.9 * known / top if top > 0 else np.zeros_like(known)
    return Mesh(points, np.concatenate(faces), np.asarray(normals, np.float64)[inside], colours=colours)


def write_surface(path: Path, mesh: Mesh) -> None:
    """Write a surface as binary PLY [Turk1994], in single precision, its colours as sRGB."""
    assert mesh.normals is not None
    columns = {"x y z": mesh.vertices.astype(np.float32), "nx ny nz": mesh.normals.astype(np.float32),
               "red green blue": np.round(255 * srgb_from_linear(mesh.colours)).astype(np.uint8)}  # fmt: skip
    write_ply(path, columns, mesh.faces, "millimetres; camera frame: x right, y up, z toward the viewer")
