"""Meshes with texture coordinates and colours: read from any file that trimesh reads, written as PLY.

Files count texture coordinates from the bottom (v up); `ObjectMesh` from the top.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.files import write_whole
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
        return _read(path)


def _read(path: Path) -> ObjectMesh:
    import trimesh

    # A .ply with coordinates at the vertices keeps its vertices' order; one with coordinates at the faces' corners
    # must be taken apart.
    with path.open("rb") as file:
        apart = path.suffix.lower() != ".ply" or b"texcoord" in file.read(4096)
    loaded: Any = trimesh.load(path, process=False, force="mesh", fix_texture=apart)
    faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))), np.int64)
    if not len(faces):
        raise RenderError(
            f"{path}: holds no faces; expected a mesh. A point cloud must be made a mesh, and a .ply with triangle "
            "strips saved as triangles, first."
        )
    vertices = np.array(loaded.vertices, np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"faces name vertices {faces.min()} to {faces.max()} of {vertices.shape}")
    if not (np.abs(vertices) < LARGEST).all():
        raise RenderError(f"{path}: some positions are no numbers, or beyond {LARGEST:.0e}. Export the mesh again.")
    raw = loaded.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    uv = getattr(loaded.visual, "uv", None)
    texcoords = None if uv is None or len(uv) != len(vertices) else np.asarray(uv, np.float64) * [1, -1] + [0, 1]
    colours = _colours(loaded, raw)
    normals = _columns(raw, ("nx", "ny", "nz"), len(vertices))
    if normals is None:
        return smooth(vertices, faces, texcoords, colours)
    return ObjectMesh(vertices, faces, normals, texcoords, colours)


def _colours(loaded: Any, raw: Any) -> Array | None:
    linear = _columns(raw, ("r", "g", "b"), len(loaded.vertices))
    if linear is not None:
        return linear
    coded = _columns(raw, ("red", "green", "blue"), len(loaded.vertices))
    if coded is None and loaded.visual.kind == "vertex":
        coded = np.asarray(loaded.visual.vertex_colors, np.float64)[:, :3]
    return None if coded is None else linear_from_srgb(coded / 255)


def _columns(raw: Any, names: tuple[str, ...], count: int) -> Array | None:
    """Return (V, 3) properties of a .ply's vertices, if it has them all."""
    try:
        found = np.stack([np.asarray(raw[name], np.float64).reshape(-1) for name in names], 1)
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    return found if len(found) == count else None


def linear_from_srgb(values: Any) -> NDArray:
    """Undo the sRGB curve, 0 to 1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def write_ply(path: Path, mesh: ObjectMesh) -> None:
    """Write a mesh as binary PLY, in the precision that it has: positions, normals, s and t, linear r, g, b."""
    upward = None if mesh.texcoords is None else mesh.texcoords * [1, -1] + [0, 1]
    columns = {"x y z": mesh.vertices, "nx ny nz": mesh.normals, "s t": upward, "r g b": mesh.colours}
    known = {group: values for group, values in columns.items() if values is not None}
    names = " ".join(known).split()
    rows = np.concatenate([np.asarray(values, "<f8") for values in known.values()], 1)
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(rows)}",
        *(f"property double {name}" for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with write_whole(path) as file:
        file.write("\n".join(header).encode())
        file.write(rows.tobytes())
        file.write(faces.tobytes())
