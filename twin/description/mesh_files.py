"""Meshes with texture coordinates and colours: read from any mesh file, written as PLY.

Files count texture coordinates from the bottom (v up); `ObjectMesh` from the top.
"""

from pathlib import Path

import numpy as np

from formats.meshes.ply_write import write_ply
from formats.meshes.scan_files import read_mesh_file
from formats.pictures import linear_from_srgb
from scene.errors import AlignError, RenderError
from twin.description.object_mesh import ObjectMesh, smooth


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
        It cannot be read, has no faces, or corners that are no positions.
    """
    try:
        found = read_mesh_file(path)
    except AlignError as error:
        raise RenderError(str(error)) from error
    texcoords = None if found.texcoords is None else found.texcoords * [1, -1] + [0, 1]
    coded = found.colours is not None and not found.linear
    colours = linear_from_srgb(found.colours / 255) if coded else found.colours  # type: ignore[operator]
    if found.normals is None:
        return smooth(found.vertices, found.faces, texcoords, colours)
    return ObjectMesh(found.vertices, found.faces, found.normals, texcoords, colours)


def write_mesh(path: Path, mesh: ObjectMesh) -> None:
    """Write a mesh as binary PLY, in the precision that it has: positions, normals, s and t, linear r, g, b."""
    upward = None if mesh.texcoords is None else mesh.texcoords * [1, -1] + [0, 1]
    columns = {"x y z": mesh.vertices, "nx ny nz": mesh.normals, "s t": upward, "r g b": mesh.colours}
    known = {names: np.asarray(values, float) for names, values in columns.items() if values is not None}
    write_ply(path, known, mesh.faces)
