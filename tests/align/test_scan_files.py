"""One surface, written in every way that scanners know, is read back as the same surface."""

import struct

import numpy as np
import pytest
from scipy.spatial import KDTree

from align.scan.mended_scan import load_scan
from scene.errors import AlignError

QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CUBE = np.array([[x, y, z] for x in (0, 10) for y in (0, 10) for z in (0, 10)], float)


def surface(mesh, vertices):
    """The triangles as a set, each by the numbers of `vertices` in its own sense of rotation, least first."""
    away, number = KDTree(vertices).query(mesh.vertices)
    assert away.max() < 1e-4
    return rotated(number[mesh.faces])


def rotated(faces):
    faces = np.asarray(faces)
    start = faces.argmin(1)[:, None]
    return set(map(tuple, np.take_along_axis(faces, (start + np.arange(3)) % 3, 1).tolist()))


def ply(path, vertices, rows, *, order="<", ascii_text=False, dressed=False):
    """`dressed`: normals and colours at the vertices, flags and texture coordinates at the faces, comments."""
    kind = "ascii" if ascii_text else f"binary_{'little' if order == '<' else 'big'}_endian"
    head = [
        "ply",
        f"format {kind} 1.0",
        "comment made by a scanner",
        "obj_info 3 views",
        f"element vertex {len(vertices)}",
    ]
    head += [f"property double {axis}" for axis in "xyz"]
    head += ["property float nx", "property uchar red"] if dressed else []
    head += [f"element face {len(rows)}"]
    head += ["property uchar flags", "property list uchar float texcoord"] if dressed else []
    head += ["property list ushort uint vertex_index"]
    head += ["element camera 1", "property int view"] if dressed else []
    body = [(order + "3d", vertex) for vertex in vertices]
    if dressed:
        body = [(order + "3dfB", (*vertex, 0.5, 200)) for vertex in vertices]
    for row in rows:
        extra = ("BB" + "f" * 2 * len(row), (1, 2 * len(row), *np.arange(2 * len(row)) / 8)) if dressed else ("", ())
        body.append((f"{order}{extra[0]}H{len(row)}I", (*extra[1], len(row), *row)))
    body += [(order + "i", (7,))] if dressed else []
    text = ("\n".join([*head, "end_header"]) + "\n").encode()
    if ascii_text:
        data = "\n".join(" ".join(f"{x:.17g}" for x in values) for _, values in body).encode()
    else:
        data = b"".join(struct.pack(form, *values) for form, values in body)
    path.with_suffix(".ply").write_bytes(text + data)
    return path.with_suffix(".ply")


def obj(path, vertices, rows, *, split=False):
    """`split`: a vertex for each corner, texture and normals, objects, negative indices, comments, broken lines."""
    lines = ["# scanner", "mtllib absent.mtl"]
    if not split:
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
        lines += ["f " + " ".join(str(i + 1) for i in row) for row in rows]
    for number, row in enumerate(rows if split else []):
        lines += [f"o part_{number}", "usemtl skin", "s off"]
        lines += ["v {:.9g} {:.9g} {:.9g} 0.5 0.5 0.5".format(*vertices[i]) for i in row]
        lines += [f"vt 0.5 0.{number}", "vn 0 0 1"]
        count = len(row)
        if number % 2:
            lines += ["  f " + " ".join(f"{k - count}/-1/-1" for k in range(count)) + "  # back"]
        else:
            first = sum(len(r) for r in rows[:number]) + 1
            lines += [f"f {first}//{number + 1} \\", " ".join(f"{first + k}/1/1" for k in range(1, count))]
    path.with_suffix(".obj").write_text("\n".join(lines))
    return path.with_suffix(".obj")


def stl(path, vertices, rows, *, text=False, name=b"solid"):
    path = path.with_suffix(".stl")
    if text:
        facets = "".join(
            "facet normal 0 0 1\n outer loop\n"
            + "".join("  vertex {:.9e} {:.9e} {:.9e}\n".format(*vertices[i]) for i in row)
            + " endloop\nendfacet\n"
            for row in rows
        )
        path.write_text(f"solid scan\n{facets}endsolid scan\n")
    else:
        # Some programs write "solid" into binary files, too.
        body = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(vertices[list(row)]), 0) for row in rows)
        path.write_bytes(name.ljust(80) + struct.pack("<I", len(rows)) + body)
    return path


def off(path, vertices, rows, *, colour=False):
    lines = ["COFF" if colour else f"OFF {len(vertices)} {len(rows)} 0", "# scanner", ""]
    lines += [f"{len(vertices)} {len(rows)} 0"] if colour else []
    lines += ["{:.9g} {:.9g} {:.9g}".format(*v) + (" 255 0 0 255" if colour else "") for v in vertices]
    lines += [
        f"{len(row)} " + " ".join(map(str, row)) + (" 0.1 0.2 0.3" if i % 2 else "") for i, row in enumerate(rows)
    ]
    path.with_suffix(".off").write_text("\r\n".join(lines))
    return path.with_suffix(".off")


def glb(path, vertices, rows):
    """Two parts, each moved to its place by the scene."""
    import trimesh

    turn = trimesh.transformations.rotation_matrix(1.0, [1, 2, 3], [4, 5, 6])
    scene = trimesh.Scene()
    for part, place in ((rows[: len(rows) // 2], turn), (rows[len(rows) // 2 :], np.eye(4))):
        local = (vertices - place[:3, 3]) @ place[:3, :3]
        scene.add_geometry(trimesh.Trimesh(local, part, process=False), transform=place)
    scene.export(path.with_suffix(".glb"))
    return path.with_suffix(".glb")


FORMATS = {
    "ply little": ply,
    "ply big": lambda *mesh: ply(*mesh, order=">"),
    "ply text": lambda *mesh: ply(*mesh, ascii_text=True),
    "ply dressed little": lambda *mesh: ply(*mesh, dressed=True),
    "ply dressed big": lambda *mesh: ply(*mesh, dressed=True, order=">"),
    "ply dressed text": lambda *mesh: ply(*mesh, dressed=True, ascii_text=True),
    "obj": obj,
    "obj split": lambda *mesh: obj(*mesh, split=True),
    "stl binary": stl,
    "stl text": lambda *mesh: stl(*mesh, text=True),
    "off": off,
    "coff": lambda *mesh: off(*mesh, colour=True),
    "glb": glb,
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_back_the_same_surface(tmp_path, coarse, name):
    vertices = coarse.vertices.astype(np.float32).astype(float)
    mesh = load_scan(FORMATS[name](tmp_path / "scan", vertices, coarse.faces), "mm")
    assert surface(mesh, vertices) == rotated(coarse.faces)
    assert len(mesh.vertices) == len(vertices)
    # The writer of GLB gives each part all vertices.
    assert all(repair.startswith("merged") or "no face uses" in repair for repair in mesh.repairs)


@pytest.mark.parametrize("name", [name for name in FORMATS if name[:3] not in ("stl", "glb")])
@pytest.mark.parametrize("mixed", [False, True])
def test_polygons_of_any_length_become_triangles(tmp_path, name, mixed):
    rows = [[0, 1, 3], [0, 3, 2], *QUADS[1:]] if mixed else QUADS
    triangles = [triangle for row in rows for triangle in ([row[0], *row[i : i + 2]] for i in range(1, len(row) - 1))]
    mesh = load_scan(FORMATS[name](tmp_path / "scan", CUBE, rows), "mm")
    assert surface(mesh, CUBE) == rotated(triangles)


def test_damaged_files_are_refused_with_what_was_found(tmp_path):
    def write(name, text):
        (tmp_path / name).write_bytes(text.encode())
        return tmp_path / name

    whole = stl(tmp_path / "whole", CUBE, [row[:3] for row in QUADS], name=b"scan").read_bytes()
    (tmp_path / "cut.stl").write_bytes(whole[:-20])
    mixed = ply(tmp_path / "mixed", CUBE, [[0, 1, 3], *QUADS]).read_bytes()
    (tmp_path / "cut.ply").write_bytes(mixed[:-3])
    grid = "ply\nformat ascii 1.0\nobj_info num_cols 2\nelement vertex 1\nproperty float x\nproperty float y\n"
    grid += (
        "property float z\nelement range_grid 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0\n0\n"
    )
    cases = {
        "'zero' is not a number": write("word.obj", "v 0 0 zero\nf 1 1 1\n"),
        "OBJ counts from 1": write("nought.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
        "fewer than three coordinates": write("flat.obj", "v 0 0\nv 1 0\nf 1 2 1\n"),
        "not with OFF": write("word.off", "BREP\n"),
        "were promised": write("short.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        "fewer corners": write("corner.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n"),
        "facets need": tmp_path / "cut.stl",
        "not three a facet": write("loop.stl", "solid a\nfacet\nvertex 0 0 0\nendfacet\nendsolid\n"),
        "face: values are missing": tmp_path / "cut.ply",
        "a range grid, one view": write("range.ply", grid),
    }
    for words, path in cases.items():
        with pytest.raises(AlignError, match=words) as caught:
            load_scan(path, "mm")
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("count", [10**18, 2**63, 10**30, -1])
def test_a_ply_that_promises_more_than_it_can_hold(tmp_path, kind, count):
    """Refused by its header: no memory is asked for."""
    head = "ply\nformat {}  1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    body = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" if kind == "ascii" else bytes(36 + 13)
    (tmp_path / "a.ply").write_bytes(head.format(kind, count).encode() + body)
    with pytest.raises(AlignError, match="face do not fit into"):
        load_scan(tmp_path / "a.ply", "mm")


@pytest.mark.parametrize("length", ["1e300", "nan", "-1e300", "1e18", "9223372036854775807"])
def test_a_list_of_impossible_length_in_a_text(tmp_path, length):
    """The walk over lists knows no bounds: a length that overflowed led it out of the file."""
    faces = f"3 0 1 2\n4 0 1 2 3\n{length} 0 1 2\n3 1 2 3\n"
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    (tmp_path / "a.ply").write_text(head + faces)
    with pytest.raises(AlignError, match="damaged"):
        load_scan(tmp_path / "a.ply", "mm")


def test_positions_without_end(tmp_path):
    path = ply(tmp_path / "a", CUBE * 1e300, QUADS)
    with pytest.raises(AlignError, match=r"positions reach 1e\+301"):
        load_scan(path, "mm")
