"""Mesh files to vertices and triangles, in the file's own unit; with normals, texture and colours where asked for."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.meshes.numbers_in_text import Lines, parse, words_a_line
from formats.meshes.ply import read_ply
from formats.meshes.polygons import fans, ragged
from scene.errors import AlignError
from scene.reading import reading

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb")
POINTS = (".xyz", ".pts", ".asc", ".pcd", ".las", ".laz", ".e57")


def read_scan(path: Path) -> Surface:
    """Return vertices (V, 3) and triangles (T, 3) as the file has them: nothing is merged or mended.

    Raises
    ------
    AlignError
        There is no such file, its kind is unknown, or it cannot be read.
    """
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check scan under [object] in session.toml.")
    suffix = _known_suffix(path)
    if suffix == ".ply":
        return read_ply(path)[:2]
    reader = {".obj": _read_obj, ".stl": _read_stl, ".off": _read_off, ".glb": _read_glb}[suffix]
    with reading(path, "cannot be read as a mesh", AlignError, do="Export the scan again."):
        return reader(path)


@dataclass(frozen=True, eq=False)
class MeshWithAttributes:
    """A mesh file with what else it says of its vertices.

    Parameters
    ----------
    vertices, normals, texcoords, colours : (V, 3), (V, 3), (V, 2), (V, 3) float64
        Texture coordinates as in files: v counts from the bottom. A vertex that has several is there several times.
    faces : (T, 3) int64
    linear : bool
        Colours are linear, 0 to 1 (r, g, b of a .ply); else sRGB, 0 to 255.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    texcoords: NDArray[np.float64] | None = None
    colours: NDArray[np.float64] | None = None
    linear: bool = False


def read_with_attributes(path: Path) -> MeshWithAttributes:
    """Return a mesh as its file has it, with its vertices' attributes; see `read_scan` for the errors."""
    if _known_suffix(path) == ".ply":
        return _ply_with_attributes(path)
    import trimesh

    with reading(path, "cannot be read as a mesh", AlignError, do="Export it again, as .ply or .obj."):
        # An .obj with texture coordinates at the faces' corners must be taken apart.
        loaded: Any = trimesh.load(path, process=False, force="mesh", fix_texture=True)
        faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))), np.int64)
        if not len(faces):
            return MeshWithAttributes(np.zeros((0, 3)), faces)
        vertices, uv = np.array(loaded.vertices, np.float64), getattr(loaded.visual, "uv", None)
        texcoords = None if uv is None or len(uv) != len(vertices) else np.asarray(uv, np.float64)
        is_coloured = loaded.visual.kind == "vertex"
        colours = np.asarray(loaded.visual.vertex_colors, np.float64)[:, :3] if is_coloured else None
        return MeshWithAttributes(vertices, faces, None, texcoords, colours)


def _ply_with_attributes(path: Path) -> MeshWithAttributes:
    vertices, faces, columns = read_ply(path)
    with reading(path, "the PLY is damaged", AlignError, do="Export it again."):
        vertex, face = columns["vertex"], columns.get("face", {})

        def of_vertices(*names: str) -> NDArray[np.float64] | None:
            known = all(name in vertex for name in names)
            return np.stack([np.asarray(vertex[name], np.float64) for name in names], -1) if known else None

        normals, linear = of_vertices("nx", "ny", "nz"), of_vertices("r", "g", "b")
        colours = of_vertices("red", "green", "blue") if linear is None else linear
        pairs = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))
        texcoords = next((found for pair in pairs if (found := of_vertices(*pair)) is not None), None)
        lists = [face[name] for name in ("vertex_indices", "vertex_index", "texcoord") if name in face]
        if texcoords is None and len(lists) == 2 and "texcoord" in face and (lists[1][0] == 2 * lists[0][0]).all():
            # Coordinates at the faces' corners: a vertex for each pair of a place and its coordinates.
            corner = fans(lists[0][0], np.arange(len(lists[0][1])))
            at_corner = np.asarray(lists[1][1], np.float64).reshape(-1, 2)[corner].reshape(-1, 2)
            both = np.concatenate([lists[0][1][corner].reshape(-1, 1), at_corner], 1)
            found, which = np.unique(both, axis=0, return_inverse=True)
            faces, place, texcoords = which.reshape(-1, 3), found[:, 0].astype(np.int64), found[:, 1:]
            vertices, normals, colours = (None if a is None else a[place] for a in (vertices, normals, colours))
    return MeshWithAttributes(vertices, faces, normals, texcoords, colours, linear is not None)  # type: ignore[arg-type]


def _known_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in POINTS:
        raise AlignError(f"{path}: {suffix} holds points without faces. Mesh them in the scanner's program first.")
    if suffix not in SUFFIXES:
        raise AlignError(f"{path}: cannot read a scan with the ending {suffix!r}; expected {', '.join(SUFFIXES)}.")
    return suffix


def _read_obj(path: Path) -> Surface:
    """All objects and groups together; colours behind a vertex, texture and normals are left behind."""
    lines = Lines(path.read_bytes())
    is_vertex, is_face = lines.starting_with(b"v"), lines.starting_with(b"f")
    text = lines.select(is_vertex).replace(b"v", b" ")
    vertices = _first_three(parse(text), words_a_line(text))
    text = lines.select(is_face).replace(b"f", b" ")
    if b"/" in text:
        text = re.sub(rb"/\S*", b"", text)
    flat, counts = parse(text, np.int64), words_a_line(text)
    if (flat == 0).any():
        raise ValueError("a face names vertex 0; OBJ counts from 1")
    # A negative index counts back from the last vertex above the face.
    above = np.repeat(np.cumsum(is_vertex)[is_face], counts)
    return vertices, fans(counts, np.where(flat > 0, flat - 1, above + flat))


def _read_stl(path: Path) -> Surface:
    data = path.read_bytes()
    count = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else 0
    # Binary files may begin with "solid" too: only their length tells.
    if data[:5].lower() == b"solid" and len(data) != 84 + 50 * count:
        lines = Lines(data.lower(), comment=b"#")
        text = lines.select(lines.starting_with(b"vertex")).replace(b"vertex", b" ")
        corners = parse(text).reshape(-1, 3)
        if len(corners) % 3 or len(corners) // 3 != lines.starting_with(b"endfacet").sum():
            raise ValueError(f"{len(corners)} corners, not three a facet")
    else:
        if len(data) < 84 or len(data) < 84 + 50 * count:
            raise ValueError(f"{count} facets need {84 + 50 * count} bytes, and there are {len(data)}")
        facet = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, facet, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _read_off(path: Path) -> Surface:
    """OFF with anything behind a vertex's position (COFF: colours, NOFF: normals) and behind a face's corners."""
    text = Lines(path.read_bytes()).text
    head = re.match(rb"\s*(ST)?C?N?OFF\b(?!\s+BINARY)", text)
    if not head:
        raise ValueError(f"it starts with {text[:12]!r}, not with OFF, COFF, NOFF or STOFF")
    text = re.sub(rb"\n\s*\n", b"\n", text[head.end() :].lstrip())
    flat, counts = parse(text), words_a_line(text)
    vertex_count, face_count = flat[:2].astype(int)
    counts = counts[counts > 0][1 : 1 + vertex_count + face_count]
    starts = np.cumsum(counts) - counts + 3
    if len(counts) < vertex_count + face_count:
        raise ValueError(f"{vertex_count} vertices and {face_count} faces were promised, {len(counts)} lines came")
    vertices = _first_three(flat[3:], counts[:vertex_count])
    starts = starts[vertex_count:]
    corners = flat[starts].astype(np.int64)
    if (corners >= counts[vertex_count:]).any():
        raise ValueError("a face has fewer corners than it says")
    return vertices, fans(corners, ragged(flat, starts + 1, corners))


def _read_glb(path: Path) -> Surface:
    import trimesh

    # One mesh of all parts, each at its place in the file's scene.
    mesh = trimesh.load_scene(path, process=False).to_geometry()
    vertices = np.asarray(getattr(mesh, "vertices", np.zeros((0, 3))), np.float64)
    return vertices, np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), np.int64).reshape(-1, 3)


def _first_three(flat: NDArray, counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the first three numbers of each line (N, 3) from all lines' numbers in a row."""
    if (counts < 3).any():
        raise ValueError("a vertex has fewer than three coordinates")
    starts = np.cumsum(counts) - counts
    return flat[starts[:, None] + np.arange(3)]
