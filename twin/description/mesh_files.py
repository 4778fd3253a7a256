"""Meshes with texture coordinates and colours: read from any mesh file, written as PLY.

Files count texture coordinates from the bottom (v up); `ObjectMesh` from the top.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.meshes import ply
from formats.meshes.scan_files import read_with_attributes
from scene.errors import AlignError, RenderError
from scene.reading import reading
from twin.description.object_mesh import ObjectMesh, smooth

LARGEST = 1e9
"""Of a position, in the file's unit: squares of it keep their precision."""

Array = NDArray[np.float64]


def read_mesh(path: Path) -> ObjectMesh:
    """Read a mesh as it stands in its file: nothing is mended.

    Parameters
    ----------
    path : Path
        .ply, .obj, .stl, .off, .glb. Colours of the vertices: whole numbers are sRGB, r, g, b in floating point linear.
        Normals: those of a .ply that has them, else smooth ones.

    Raises
    ------
    RenderError
        It cannot be read, has no faces, or positions that are no numbers.
    """
    if not path.is_file():
        raise RenderError(f"{path}: not found.")
    with reading(path, "no mesh can be read", RenderError, do="Export it again, as .ply or .obj."):
        try:
            found = read_with_attributes(path)
        except AlignError as error:
            raise RenderError(str(error)) from error
        if not len(found.faces):
            raise RenderError(f"{path}: holds no faces; expected a mesh. A point cloud must be made a mesh first.")
        vertices, faces = found.vertices, found.faces
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(f"faces name vertices {faces.min()} to {faces.max()} of {vertices.shape}")
        if not (np.abs(vertices) < LARGEST).all():
            raise RenderError(f"{path}: some positions are no numbers, or beyond {LARGEST:.0e}. Export the mesh again.")
        texcoords = None if found.texcoords is None else found.texcoords * [1, -1] + [0, 1]
        coded = found.colours is not None and not found.linear
        colours = linear_from_srgb(found.colours / 255) if coded else found.colours  # type: ignore[operator]
        if found.normals is None:
            return smooth(vertices, faces, texcoords, colours)
        return ObjectMesh(vertices, faces, found.normals, texcoords, colours)


def linear_from_srgb(values: Any) -> NDArray:
    """Undo the sRGB curve, 0 to 1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def write_ply(path: Path, mesh: ObjectMesh) -> None:
    """Write a mesh as PLY, in the precision that it has: positions, normals, s and t, linear r, g, b."""
    upward = None if mesh.texcoords is None else mesh.texcoords * [1, -1] + [0, 1]
    columns = {"x y z": mesh.vertices, "nx ny nz": mesh.normals, "s t": upward, "r g b": mesh.colours}
    ply.write_ply(path, {names: values for names, values in columns.items() if values is not None}, mesh.faces)
