"""A mesh with what a material needs of it: normals, texture coordinates, colours; its files; the built-in shapes.

Files count texture coordinates from the bottom (v up); `ObjectMesh` from the top.
"""

import os
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.meshes.ply_write import write_ply
from formats.meshes.scan_files import read_mesh_file
from formats.pictures import linear_from_srgb
from scene.errors import AlignError, RenderError
from scene.mesh import Mesh
from scene.same_rows import first_of_same

Array = NDArray[np.float64]
MESHES_KEPT = 8
"""In memory, of files that were read: the same file is not read again, and is the same mesh."""


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """Triangles, and what is known at their corners.

    Parameters
    ----------
    vertices : (V, 3) float64
        mm.
    faces : (T, 3) int64
        Counter-clockwise seen from outside.
    normals : (V, 3) float64 or None
        Interpolated over a face; None: every face is flat. Length 1, or shorter where they are means of others.
    texcoords : (V, 2) float64 or None
        (s, t), t down: see `twin.description.materials.Texture`.
    colours : (V, 3) float64 or None
        Linear reflectance.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array | None = None
    texcoords: Array | None = None
    colours: Array | None = None

    def moved(self, matrix: Array) -> "ObjectMesh":
        """Return the mesh after an affine map (4, 4); one that mirrors turns the faces over, so that out stays out."""
        linear = matrix[:3, :3]
        normals, faces = self.normals, self.faces
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        if normals is not None and not np.array_equal(linear, np.eye(3)):
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals @ np.linalg.inv(linear)
            now = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals * (length / np.where(now > 0, now, 1))
        vertices = self.vertices @ linear.T + matrix[:3, 3]
        return replace(self, vertices=vertices, faces=faces, normals=normals)


def smooth(vertices: Array, faces: NDArray[np.int64], texcoords: Array | None, colours: Array | None) -> ObjectMesh:
    """Return a mesh whose normals are those of its faces, weighted by area; vertices at one place share theirs."""
    # Adding zero makes -0 and 0 the same bits.
    first = first_of_same(vertices + 0.0)
    normals = Mesh(vertices, first[faces]).vertex_normals[first]
    return ObjectMesh(vertices, faces, normals, texcoords, colours)


@lru_cache(MESHES_KEPT)
def facets(mesh: ObjectMesh) -> ObjectMesh:
    """Return the mesh with every face flat; the same one each time."""
    return replace(mesh, normals=None)


def read_mesh(path: Path) -> ObjectMesh:
    """Read a mesh as it stands in its file: nothing is mended. The same one where it was read before.

    Parameters
    ----------
    path : Path
        .ply, .obj, .stl, .off, .glb. Colours of the vertices: whole numbers are sRGB, r, g, b in floating point linear.
        Normals: those of a .ply that has them, else smooth ones.

    Raises
    ------
    RenderError
        It cannot be read, has no faces, or corners that are no positions.
    """
    state = os.stat(path) if path.is_file() else None
    return _read_mesh(path, state and (state.st_mtime_ns, state.st_size))


@lru_cache(MESHES_KEPT)
def _read_mesh(path: Path, _state: object) -> ObjectMesh:
    try:
        found = read_mesh_file(path)
    except AlignError as error:
        raise RenderError(str(error)) from error
    coded = found.colours is not None and not found.linear
    colours = linear_from_srgb(found.colours / 255) if coded else found.colours  # type: ignore[operator]
    mesh = ObjectMesh(found.vertices, found.faces, found.normals, _turned_over(found.texcoords), colours)
    return mesh if mesh.normals is not None else smooth(mesh.vertices, mesh.faces, mesh.texcoords, mesh.colours)


def write_mesh(path: Path, mesh: ObjectMesh) -> None:
    """Write a mesh as binary PLY, in the precision that it has: positions, normals, s and t, linear r, g, b."""
    columns = {
        "x y z": mesh.vertices, "nx ny nz": mesh.normals, "s t": _turned_over(mesh.texcoords), "r g b": mesh.colours
    }  # fmt: skip
    known = {names: np.asarray(values, float) for names, values in columns.items() if values is not None}
    write_ply(path, known, mesh.faces)


def _turned_over(texcoords: Array | None) -> Array | None:
    return None if texcoords is None else texcoords * [1, -1] + [0, 1]


SHAPES = ("sphere", "square", "disc", "cube", "cylinder", "cone")


@cache
def built_in(name: str) -> ObjectMesh:
    """Return a shape of size 1 with texture coordinates.

    `sphere`: radius 1; `square`: -1 to 1 in x and y, facing z; `disc`: radius 1, facing z; `cube`: -1 to 1;
    `cylinder`: radius 1, z from -1 to 1, open; `cone`: radius 1 at z = 0, its tip at z = 1, open.
    """
    if name == "square":
        return _facets(np.eye(3)[None], offset=0.0)
    if name == "cube":
        # Cyclic turns of the axes, and each with two axes negated: six proper rotations, one a face.
        turns = [np.roll(np.eye(3), k, 0) for k in range(3)]
        return _facets(np.array(turns + [turn * [1, -1, -1] for turn in turns]), offset=1.0)
    down, around = {"sphere": (128, 256), "disc": (1, 128), "cylinder": (1, 256), "cone": (64, 256)}[name]
    t, s = np.meshgrid(np.linspace(0, 1, down + 1), np.linspace(0, 1, around + 1), indexing="ij")
    angle = 2 * np.pi * s
    one, zero = 1 + 0 * t, 0 * t
    radius, z, across, along = {
        "sphere": (np.sin(np.pi * t), np.cos(np.pi * t)) * 2,
        "disc": (t, zero, zero, one),
        "cylinder": (one, 1 - 2 * t, one, zero),
        "cone": (t, 1 - t, one / np.sqrt(2), one / np.sqrt(2)),
    }[name]
    points, normals = (
        np.stack([aside * np.cos(angle), aside * np.sin(angle), up], -1).reshape(-1, 3)
        for aside, up in ((radius, z), (across, along))
    )
    corner = np.arange((down + 1) * (around + 1)).reshape(down + 1, around + 1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    cross = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    # At a pole or a tip one of the two triangles has no area.
    faces = faces[np.linalg.norm(cross, axis=1) > 1e-12]
    texcoords = np.stack([s, t], -1).reshape(-1, 2)
    if name == "disc":
        texcoords = (points[:, :2] * [1, -1] + 1) / 2
    used, faces = np.unique(faces, return_inverse=True)
    return ObjectMesh(points[used], faces.reshape(-1, 3), normals[used], texcoords[used])


def _facets(rotations: Array, offset: float) -> ObjectMesh:
    """Return squares that face the z axes of rotations (F, 3, 3), so far from the origin."""
    corners = np.array([[-1, -1, offset], [1, -1, offset], [1, 1, offset], [-1, 1, offset]], float)
    vertices = np.einsum("fij,pj->fpi", rotations, corners).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(rotations))[:, None, None]
    texcoords = np.tile([[0.0, 1], [1, 1], [1, 0], [0, 0]], (len(rotations), 1))
    return ObjectMesh(vertices, faces.reshape(-1, 3), np.repeat(rotations[:, :, 2], 4, 0), texcoords)
