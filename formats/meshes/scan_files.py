"""Mesh files to vertices and triangles, in the file's own unit; with normals, texture and colours where asked for.

Files count texture coordinates from the bottom (v up); `Mesh` from the top.
"""

import codecs
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.meshes.ply import Columns, Element, read_ply, read_rows, write_ply
from formats.meshes.polygons import check_corners, lines_of, places, read_text, strips, table, triangles, whole
from formats.picture_files import linear_from_srgb
from scene.errors import AlignError
from scene.files import write_whole
from scene.mesh import Mesh, first_of_same
from scene.reading import reading

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb")
LARGEST = 1e9
"""Units of the file: no scan reaches further from its origin, and squares of it keep their precision."""
POINTS = (".xyz", ".pts", ".asc", ".pcd", ".las", ".laz", ".e57")
GLTF_UNREAD = (
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"
)  # fmt: skip
"""Extensions that change where the vertices are; trimesh passes over them."""


def read_scan(path: Path) -> tuple[Array, Integers]:
    """Return vertices (V, 3) and triangles (T, 3) as the file has them; see `read_mesh_file` for the errors."""
    found = read_mesh_file(path, attributes=False)
    return found.vertices, found.faces


def read_mesh_file(path: Path, *, attributes: bool = True) -> Mesh:
    """Return a mesh as its file has it: nothing is merged or mended. Whole numbers for colours are sRGB.

    Raises
    ------
    AlignError
        There is no such file, its kind is unknown, it cannot be read, is empty, is a point cloud, or its faces have
        corners that are no positions.
    """
    suffix = path.suffix.lower()
    if suffix in POINTS:
        raise AlignError(f"{path}: {suffix} holds points without faces. Mesh them in the scanner's program first.")
    if suffix not in SUFFIXES:
        raise AlignError(f"{path}: cannot read a mesh with the ending {suffix!r}; expected {', '.join(SUFFIXES)}.")
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check its name in session.toml or the scene's description.")
    with reading(path, "cannot be read as a mesh", AlignError, do="Export it again."):
        if suffix in (".stl", ".glb"):
            found = _read_stl(path) if suffix == ".stl" else _read_glb(path)
        else:
            columns = {".ply": read_ply, ".obj": partial(_read_obj, attributes=attributes), ".off": _read_off}[suffix]
            found = _mesh_of(columns(path), attributes)
        check_corners(found.faces, len(found.vertices))
    vertices, faces = found.vertices, found.faces
    if not len(faces):
        what = f"{len(vertices)} points, but no faces: a point cloud or range grid" if len(vertices) else "it is empty"
        raise AlignError(f"{path}: {what}. Merge and mesh its views in the scanner's program, and export triangles.")
    # Grids of ranges leave vertices without a position behind; only those that a face names are wrong.
    bad = np.zeros(len(vertices), bool)
    bad[faces] = True
    bad &= ~(np.abs(vertices) <= LARGEST).all(1)
    if bad.any():
        raise AlignError(
            f"{path}: {bad.sum()} of {len(vertices)} vertices have no finite position, or one beyond {LARGEST:.0e} "
            f"units of the file (the first is number {bad.argmax()}: {vertices[bad.argmax()]}). Export it again."
        )
    return found if found.texcoords is None else replace(found, texcoords=_turned_over(found.texcoords))


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh as binary PLY, in the precision that it has: positions, normals, s and t, linear r, g, b."""
    texcoords = None if mesh.texcoords is None else _turned_over(mesh.texcoords)
    columns = {"x y z": mesh.vertices, "nx ny nz": mesh.normals, "s t": texcoords, "r g b": mesh.colours}
    known = {names: np.asarray(values, float) for names, values in columns.items() if values is not None}
    write_ply(path, known, mesh.faces)


def write_glb(path: Path, mesh: Mesh, picture: NDArray[np.uint8]) -> None:
    """Write a mesh, mm, with an sRGB picture (h, w, 3) on it as binary glTF [Khronos2021]: no metal, of roughness 1.

    The camera's frame is glTF's own: x right, y up, z toward the viewer.
    """
    import trimesh
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, baseColorTexture=Image.fromarray(picture))
    visual = None if mesh.texcoords is None else TextureVisuals(_turned_over(mesh.texcoords), material=material)
    # glTF counts in metres.
    options = {"vertex_normals": mesh.normals, "visual": visual, "process": False}
    with write_whole(path) as file:
        trimesh.Trimesh(1e-3 * mesh.vertices, mesh.faces, **options).export(file, file_type="glb")


def _turned_over(texcoords: Array) -> Array:
    return texcoords * [1, -1] + [0, 1]


def _mesh_of(columns: Columns, attributes: bool) -> Mesh:
    vertex, face = columns.get("vertex", {}), columns.get("face", {})

    def of_vertices(*names: str) -> Array | None:
        known = all(name in vertex for name in names)
        return np.stack([np.asarray(vertex[name], np.float64) for name in names], -1) if known else None

    def lists(element: str, *names: str) -> tuple[Integers, Integers]:
        of = columns.get(element, {})
        known = [of[name] for name in names if name in of]
        if of and not known:
            raise ValueError(f"{element} has no {' or '.join(names)}, only {', '.join(of)}")
        counts, flat = known[0] if known else (np.zeros(0, np.int64), np.zeros(0))
        return counts, whole(flat)

    vertices = of_vertices("x", "y", "z")
    if vertices is None:
        raise ValueError("the PLY has no vertices with x, y, z")
    counts, flat = lists("face", "vertex_indices", "vertex_index")
    corners = triangles(counts, flat, vertices)
    faces = np.concatenate([flat[corners], strips(*lists("tristrips", "vertex_indices", "vertex_index"))])
    if not attributes:
        return Mesh(vertices, faces)
    normals, colours, codes = (of_vertices(*names) for names in (("nx", "ny", "nz"), "rgb", ("red", "green", "blue")))
    if colours is None and codes is not None:
        colours = linear_from_srgb(codes / 255)
    pairs = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))
    texcoords = next((found for pair in pairs if (found := of_vertices(*pair)) is not None), None)
    if texcoords is None and "texcoord" in face and np.array_equal(face["texcoord"][0], 2 * counts):
        # A vertex of each pair of a vertex and the coordinates that a corner gives it.
        at_corner = np.asarray(face["texcoord"][1], np.float64).reshape(-1, 2)[corners.ravel()]
        at_vertex = flat[corners.ravel()]
        first, which = np.unique(first_of_same(np.column_stack([at_vertex, at_corner])), return_inverse=True)
        place, faces, texcoords = at_vertex[first], which.reshape(-1, 3), at_corner[first]
        vertices, normals, colours = (None if a is None else a[place] for a in (vertices, normals, colours))
    return Mesh(vertices, faces, normals, texcoords, colours)  # type: ignore[arg-type]


def _read_obj(path: Path, attributes: bool) -> Columns:
    """All objects and groups together; normals are left behind."""
    text = read_text(path).lower()
    if b"\\" in text:
        # Other lines may end in a backslash that is a folder's.
        going_on = rb"\n[ \t]*[vf](?:[^\\\n]*\\[ \t]*\n)+"
        text = re.sub(going_on, lambda lines: re.sub(rb"\\[ \t]*\n", b" ", lines[0]), text)
    text = lines_of(text, b"v|vt|f").replace(b"vt", b"t")
    letters = np.frombuffer(text, np.uint8)
    kind = letters[(letters == ord("v")) | (letters == ord("t")) | (letters == ord("f"))]
    is_face = kind == ord("f")
    flat, words = table(re.sub(rb"/\S*", b"", text).translate(None, b"vtf"))
    starts = np.cumsum(words) - words

    def first(letter: str, count: int) -> Array:
        """Return the first numbers of each such line (N, count)."""
        chosen = kind == ord(letter)
        if (words[chosen] < count).any():
            raise ValueError(f"a line {'vt' if letter == 't' else letter} has fewer than {count} numbers")
        return flat[starts[chosen][:, None] + np.arange(count)]

    def index(numbers: Integers, letter: str) -> Integers:
        # A negative index counts back from the last one above the face.
        above = np.repeat(np.cumsum(kind == ord(letter))[is_face], counts)
        return np.where(numbers > 0, numbers - 1, above + numbers)

    counts = words[is_face]
    numbers = whole(flat[places(starts[is_face], counts)])
    if (numbers == 0).any():
        raise ValueError("a face names vertex 0; OBJ counts from 1")
    vertex: dict[str, Any] = dict(zip("xyz", first("v", 3).T, strict=True))
    face: dict[str, Any] = {"vertex_indices": (counts, index(numbers, "v"))}
    if not attributes:
        return {"vertex": vertex, "face": face}
    if (words[kind == ord("v")] == 6).all():
        vertex |= zip("rgb", linear_from_srgb(first("v", 6)[:, 3:]).T, strict=True)
    parts, each_line = table(lines_of(text, b"f").replace(b"/", b" ").translate(None, b"f"))
    # Texture coordinates count where each corner is v/vt, or each v/vt/vn.
    each = next((k for k in (2, 3) if np.array_equal(each_line, k * counts) and np.array_equal(parts[::k], numbers)), 0)
    if each and b"//" not in text and (kind == ord("t")).any():
        coordinates, texture = first("t", 2), index(whole(parts[1::each]), "t")
        check_corners(texture, len(coordinates), "vt")
        face["texcoord"] = (2 * counts, coordinates[texture].ravel())
    return {"vertex": vertex, "face": face}


def _read_stl(path: Path) -> Mesh:
    data = path.read_bytes()
    # Binary files may begin with "solid" too, but hold zero bytes soon.
    if data[:134].count(b"\0") and data[:2] not in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        count = int.from_bytes(data[80:84], "little")
        left = len(data) - 84 - 50 * count
        if left < 0 or (left and left % 50 == 0 and data[-left:].strip(b"\0")):
            raise ValueError(f"{count} facets need {84 + 50 * count} bytes, and there are {len(data)}")
        facet = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, facet, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
    else:
        text = read_text(path).lower()
        flat, words = table(lines_of(text, b"vertex").replace(b"vertex", b""))
        facets = text.count(b"endfacet")
        begun, ended = (len(re.findall(rb"\n[ \t]*%s\b" % word, text)) for word in (b"solid", b"endsolid"))
        if len(words) != 3 * facets or (words != 3).any() or begun != ended:
            raise ValueError(
                f"{len(words)} corners of {len(flat)} numbers in {facets} facets, {begun} solids of which {ended} end; "
                "expected three corners a facet, three numbers a corner, and an end to each solid"
            )
        corners = flat.reshape(-1, 3)
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3))


def _read_off(path: Path) -> Columns:
    """OFF with anything behind a vertex's position (COFF: colours, NOFF: normals) and behind a face's corners.

    Below its head it is what an ASCII PLY is.
    """
    text = read_text(path)
    head = re.match(rb"(?i)\s*(?:(?:ST)?C?N?OFF\b(\s+BINARY)?)?\s*(\d+)[ \t]+(\d+)[^\n]*", text)
    if head is None or head[1]:
        raise ValueError(f"it starts with {text[1:13]!r}; expected OFF as text, and the numbers of vertices and faces")
    elements = [
        Element("vertex", int(head[2]), [(axis, "d", None) for axis in "xyz"]),
        Element("face", int(head[3]), [("vertex_indices", "d", "d")]),
    ]
    return read_rows(text[head.end() :], elements)


def _read_glb(path: Path) -> Mesh:
    import trimesh

    data = path.read_bytes()
    if data[:4] != b"glTF":
        raise ValueError(f"it starts with {data[:12]!r}, not with glTF")
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    used = [name for name in GLTF_UNREAD if name in tree.get("extensionsUsed", [])]
    used += ["sparse accessors"] if any("sparse" in one for one in tree.get("accessors", [])) else []
    fan = any(part.get("mode") == 6 for mesh in tree.get("meshes", []) for part in mesh["primitives"])
    used += ["triangle fans"] if fan else []
    if used:
        raise ValueError(f"it has {', '.join(used)}, which are not read: export without them")
    # One mesh of all parts, each at its place in the file's scene.
    mesh: Any = trimesh.load_scene(path, process=False).to_geometry()
    faces = np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), np.int64).reshape(-1, 3)
    if not len(faces):
        return Mesh(np.zeros((0, 3)), faces)
    vertices, uv = np.asarray(mesh.vertices, np.float64), getattr(mesh.visual, "uv", None)
    texcoords = None if uv is None or len(uv) != len(vertices) else np.asarray(uv, np.float64)
    is_coloured = mesh.visual.kind == "vertex"
    colours = linear_from_srgb(np.asarray(mesh.visual.vertex_colors)[:, :3] / 255) if is_coloured else None
    return Mesh(vertices, faces, None, texcoords, colours)
