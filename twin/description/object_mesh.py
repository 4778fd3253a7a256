"""Meshes with what a material needs of them, normals, texture coordinates, colours: from files, and built-in shapes."""

from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.meshes.scan_files import read_mesh_file
from scene.current import look_of
from scene.errors import AlignError, RenderError
from scene.mesh import Mesh, first_of_same

Array = NDArray[np.float64]
MESHES_KEPT = 8
"""In memory, of files that were read: the same file is not read again, and is the same mesh."""


def smooth(mesh: Mesh) -> Mesh:
    """Return the mesh with the means of its faces' normals, by area; vertices at one place share theirs."""
    # Adding zero makes -0 and 0 the same bits.
    first = first_of_same(mesh.vertices + 0.0)
    return replace(mesh, normals=Mesh(mesh.vertices, first[mesh.faces]).vertex_normals[first])


@lru_cache(MESHES_KEPT)
def facets(mesh: Mesh) -> Mesh:
    """Return the mesh with every face flat; the same one each time."""
    return replace(mesh, normals=None)


def read_mesh(path: Path) -> Mesh:
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
    return _read_mesh(path, look_of(path))


@lru_cache(MESHES_KEPT)
def _read_mesh(path: Path, _state: object) -> Mesh:
    try:
        found = read_mesh_file(path)
    except AlignError as error:
        raise RenderError(str(error)) from error
    return found if found.normals is not None else smooth(found)


SHAPES = ("sphere", "square", "disc", "cube", "cylinder", "cone")


@cache
def built_in(name: str) -> Mesh:
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
    return Mesh(points[used], faces.reshape(-1, 3), normals[used], texcoords[used])


def _facets(rotations: Array, offset: float) -> Mesh:
    """Return squares that face the z axes of rotations (F, 3, 3), so far from the origin."""
    corners = np.array([[-1, -1, offset], [1, -1, offset], [1, 1, offset], [-1, 1, offset]], float)
    vertices = np.einsum("fij,pj->fpi", rotations, corners).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(rotations))[:, None, None]
    texcoords = np.tile([[0.0, 1], [1, 1], [1, 0], [0, 0]], (len(rotations), 1))
    return Mesh(vertices, faces.reshape(-1, 3), np.repeat(rotations[:, :, 2], 4, 0), texcoords)
