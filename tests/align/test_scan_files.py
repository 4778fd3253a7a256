"""One surface, written in every way that scanners know, is read back as the same surface."""

import json
import struct

import numpy as np
import pytest
from scipy.spatial import KDTree

from align.scan.mended_scan import load_scan
from formats.meshes.scan_files import read_scan
from scene.errors import AlignError
from scene.mesh import Mesh

QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TETRAHEDRON = [[0, 2, 1], [0, 1, 4], [0, 4, 2], [1, 2, 4]]
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


def solids(*names, vertices=CUBE, rows=TETRAHEDRON):
    facets = "".join(
        "facet normal 0 0 1\n outer loop\n"
        + "".join("  vertex {:.9e} {:.9e} {:.9e}\n".format(*vertices[i]) for i in row)
        + " endloop\nendfacet\n"
        for row in rows
    )
    return "".join(f"solid {name}\n{facets}endsolid {name}\n" for name in names).encode()


def stl(path, vertices, rows, *, text=False, name=b"solid"):
    path = path.with_suffix(".stl")
    if text:
        path.write_bytes(solids("scan", vertices=vertices, rows=rows))
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


BENT = np.array([[30, 0], [30, 10], [10, 10], [10, 40], [0, 40], [0, 0]], float)
PRISM = np.concatenate([np.c_[BENT, np.zeros(6)], np.c_[BENT, np.full(6, 20.0)]])
SIDES = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11], *([i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(5))]
SIDES += [[5, 0, 6], [5, 6, 11]]
"""Of a prism over an L, which a fan about its first corner, or its last but one, does not fill."""


@pytest.mark.parametrize("name", [name for name in FORMATS if name[:3] not in ("stl", "glb")])
def test_polygons_of_any_length_with_a_bay_or_none_are_filled_and_no_more(tmp_path, name):
    vertices, faces = read_scan(FORMATS[name](tmp_path / "scan", PRISM, SIDES))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    around = np.linalg.norm(BENT - np.roll(BENT, 1, 0), axis=1).sum()
    x, y = BENT.T
    within = abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2
    assert len(faces) == sum(len(side) - 2 for side in SIDES)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(2 * within + 20 * around)
    assert abs(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6) == pytest.approx(20 * within)


def test_a_polygon_that_no_fan_fills_is_refused(tmp_path):
    comb = np.array([[0, 0], [50, 0], [50, 30], [40, 30], [40, 5], [30, 5], [30, 30], [20, 30], [20, 5], [0, 5]], float)
    with pytest.raises(AlignError, match="no fan fills a polygon of 10 corners: export the mesh as triangles"):
        read_scan(obj(tmp_path / "comb", np.c_[comb, np.zeros(10)], [list(range(10))]))


def edited(*changes):
    """What is done to a file's bytes: each (old, new) everywhere; a text alone goes before them."""

    def edit(data):
        for change in changes:
            data = change + data if isinstance(change, bytes) else data.replace(*change)
        return data

    return edit


TEXTS = ("ply text", "ply dressed text", "obj", "obj split", "stl text", "off", "coff")
BOM = b"\xef\xbb\xbf"
ENDS = {
    "a mark": edited(BOM),
    "lone returns": edited((b"\r\n", b"\n"), (b"\n", b"\r")),
    "returns and feeds": edited((b"\r\n", b"\n"), (b"\n", b"\r\n")),
    "blanks at the ends": lambda data: (
        data.replace(b"\\\n", b"\\ \n").replace(b"\n", b" \n").replace(b"ply \n", b"ply\n")
    ),
    "no last line end": lambda data: data.rstrip(),
}


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("name", TEXTS)
def test_texts_of_other_programs(tmp_path, coarse, name, end):
    path = FORMATS[name](tmp_path / "scan", coarse.vertices, coarse.faces)
    whole = read_scan(path)
    path.write_bytes(ENDS[end](path.read_bytes()))
    assert all(map(np.array_equal, read_scan(path), whole))


def behind(text, first, count, more):
    """Append words to `count` lines of a text, from the line `first` on."""
    lines = text.split("\n")
    lines[first : first + count] = [line + more for line in lines[first : first + count]]
    return "\n".join(lines)


@pytest.mark.parametrize("rows", [QUADS, [row[:3] for row in QUADS], [[0, 1, 3], [0, 3, 2], *QUADS[1:]]])
@pytest.mark.parametrize("more", [" 0", " 0 0 0", " 255 0 0 255"])
def test_lines_of_a_ply_that_hold_more_than_the_header_says(tmp_path, rows, more):
    """Once the next row began with what was left of the last: with one number more, every second face was lost."""
    path = ply(tmp_path / "a", CUBE, rows, ascii_text=True)
    whole, text = read_scan(path), path.read_text()
    top = text[: text.index("end_header")].count("\n") + 1
    for first, count in ((top, 8), (top + 8, len(rows)), (top, 8 + len(rows)), (top + 8 + 1, 2)):
        path.write_text(behind(text, first, count, more))
        assert all(map(np.array_equal, read_scan(path), whole))


def numbered(rows, first=1, form="{}"):
    return "".join("f " + " ".join(form.format(i + first) for i in row) + "\n" for row in rows).encode()


POINTS = "".join("v {} {} {}\n".format(*vertex) for vertex in CUBE).encode()
BINARY_STL = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(CUBE[row]), 0x1234) for row in TETRAHEDRON)
STRANGE = {
    "comment with a folder.obj": b"# C:\\scans\\\n" + POINTS + numbered(TETRAHEDRON),
    "name of a folder.obj": b"o C:\\scans\\\n" + POINTS + numbered(TETRAHEDRON),
    "mark and a stray vertex.obj": BOM + POINTS + b"v 0 0 0\n" + numbered(TETRAHEDRON),
    "lines that go on.obj": POINTS.replace(b" 10 ", b" 10 \\\n") + numbered(TETRAHEDRON).replace(b" ", b"\\\n "),
    "upper case.obj": (POINTS + numbered(TETRAHEDRON)).upper(),
    "tabs and indents.obj": (POINTS + numbered(TETRAHEDRON)).replace(b" ", b"\t").replace(b"\n", b"\n \t"),
    "UTF-16.obj": (POINTS + numbered(TETRAHEDRON)).decode().encode("utf-16"),
    "Latin-1.obj": "# Käse\n".encode("latin-1") + POINTS + numbered(TETRAHEDRON),
    "all kinds of corners.obj": POINTS
    + b"vt 0 0\nvn 0 0 1\n"
    + b"".join(
        numbered([row], form=form) for row, form in zip(TETRAHEDRON, ("{}", "{}/1", "{}//1", "{}/1/1"), strict=True)
    ),
    "lines and points.obj": POINTS + b"l 1 2 3\np 4\n" + numbered(TETRAHEDRON),
    "blank first.stl": b"\r\n  " + solids("a"),
    "mark first.stl": BOM + solids("a"),
    "upper case.stl": solids("a").upper(),
    "no name.stl": solids(""),
    "no indents.stl": solids("a").replace(b"\n  ", b"\n").replace(b"\n ", b"\n"),
    "words of the format as its name.stl": solids("vertex 1 facet normal of a solid loop"),
    "no normals.stl": solids("a").replace(b"normal 0 0 1", b"normal nan -1.#IND nan"),
    "an empty one first.stl": b"solid e\nendsolid e\n\n" + solids("a"),
    "solid.stl": b"solid part".ljust(80) + struct.pack("<I", 4) + BINARY_STL,
    "solid, padded.stl": b"solid part".ljust(80) + struct.pack("<I", 4) + BINARY_STL + b"\0\0",
    "a colour table.stl": b"part".ljust(80) + struct.pack("<I", 4) + BINARY_STL + bytes(range(48)),
    "text as its name.stl": b"solid a\nfacet normal 0 0 1".ljust(80) + struct.pack("<I", 4) + BINARY_STL + b"\n",
    "no count of edges.off": b"OFF\n8 4\n" + POINTS.replace(b"v ", b"") + numbered(TETRAHEDRON, 0).replace(b"f", b"3"),
    "small letters.off": b"off\n8 4 0\n" + POINTS.replace(b"v ", b"") + numbered(TETRAHEDRON, 0).replace(b"f", b"3"),
    "no keyword.off": b"8 4 0\n" + POINTS.replace(b"v ", b"") + numbered(TETRAHEDRON, 0).replace(b"f", b"3"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_strange_files_hold_the_same_surface(tmp_path, name):
    (tmp_path / name).write_bytes(STRANGE[name])
    vertices, faces = read_scan(tmp_path / name)
    assert surface(Mesh(vertices, faces), CUBE) == rotated(TETRAHEDRON)
    assert len(faces) == 4
    assert name[-4:] == ".stl" or len(vertices) == 8 + ("stray" in name)


def test_solids_of_one_name_are_all_read(tmp_path):
    (tmp_path / "a.stl").write_bytes(solids("a", rows=TETRAHEDRON[:2]) + solids("a", "b", rows=TETRAHEDRON[2:]))
    vertices, faces = read_scan(tmp_path / "a.stl")
    assert surface(Mesh(vertices, faces), CUBE) == rotated(TETRAHEDRON)
    assert len(faces) == 6


@pytest.mark.parametrize("order", "<>")
def test_lists_and_places_of_all_types(tmp_path, order):
    """Lengths and corners in all integers, faces before vertices, a list beside positions, bytes to fill up."""
    kind, small = f"binary_{'little' if order == '<' else 'big'}_endian", {"b": "char", "B": "uchar", "h": "short"}
    small |= {"H": "ushort", "i": "int", "I": "uint", "q": "int64", "Q": "uint64"}
    for length in small:
        for index in small:
            head = f"ply\nformat {kind} 1.0\ncomment before end_header\nelement face 7\nproperty list {small[length]} "
            head += f"{small[index]} vertex_indices\nelement vertex 8\nproperty short x\nproperty list uchar int near\n"
            head += "property double z\nproperty float y\nend_header\n"
            rows = [QUADS[0], [4, 6, 7], [4, 7, 5], *QUADS[2:]]
            data = b"".join(struct.pack(f"{order}{length}{len(row)}{index}", len(row), *row) for row in rows)
            for number, (x, y, z) in enumerate(CUBE):
                data += struct.pack(f"{order}hB{number % 3}idf", int(x), number % 3, *range(number % 3), z, y)
            (tmp_path / "a.ply").write_bytes(head.encode() + data + b"\n\0")
            vertices, faces = read_scan(tmp_path / "a.ply")
            assert np.array_equal(vertices, CUBE)
            fans = [[row[0], *row[k : k + 2]] for row in rows for k in range(1, len(row) - 1)]
            assert rotated(faces) == rotated(fans)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_strips_with_and_without_breaks(tmp_path, kind):
    """Every second triangle of a strip is turned over; -1 begins a new one."""
    strip = [0, 1, 2, 3, 6, 7, 4, 5, 0, 1]
    truth = [strip[k : k + 3] if k % 2 == 0 else [strip[k + 1], strip[k], strip[k + 2]] for k in range(8)]
    truth += [[0, 2, 4], [4, 2, 6], [1, 5, 3], [3, 5, 7]]
    for lists in ([strip, [0, 2, 4, 6], [1, 5, 3, 7]], [[*strip, -1, 0, 2, 4, 6, -1, 1, 5, 3, 7, -1]]):
        head = f"ply\nformat {kind} 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
        head += f"element face 0\nproperty list uchar int vertex_indices\nelement tristrips {len(lists)}\n"
        head += "property list int int vertex_indices\nend_header\n"
        if kind == "ascii":
            body = "\n".join(" ".join(map(str, row)) for row in [*CUBE, *([len(row), *row] for row in lists)]).encode()
        else:
            body = CUBE.tobytes() + b"".join(struct.pack(f"<{len(row) + 1}i", len(row), *row) for row in lists)
        (tmp_path / "a.ply").write_bytes(head.encode() + body)
        vertices, faces = read_scan(tmp_path / "a.ply")
        assert np.array_equal(vertices, CUBE)
        assert len(faces) == 12
        assert rotated(faces) == rotated(truth)


@pytest.mark.parametrize("feature", ["sparse accessors", "triangle fans", "KHR_draco_mesh_compression"])
def test_a_glb_that_trimesh_would_misread_is_refused(tmp_path, feature):
    path = glb(tmp_path / "scan", CUBE, TETRAHEDRON)
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + size])
    if feature == "sparse accessors":
        tree["accessors"][0]["sparse"] = {"count": 1}
    elif feature == "triangle fans":
        tree["meshes"][0]["primitives"][0]["mode"] = 6
    else:
        tree["extensionsUsed"] = [feature]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = struct.pack("<I4s", len(text), b"JSON") + text + data[20 + size :]
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(rest)) + rest)
    with pytest.raises(AlignError, match=f"it has {feature}, which are not read"):
        read_scan(path)


def test_damaged_files_are_refused_with_what_was_found(tmp_path):
    def write(name, text):
        (tmp_path / name).write_bytes(text.encode())
        return tmp_path / name

    whole = stl(tmp_path / "whole", CUBE, [row[:3] for row in QUADS], name=b"scan").read_bytes()
    (tmp_path / "cut.stl").write_bytes(whole[:-20])
    (tmp_path / "count.stl").write_bytes(whole[:80] + struct.pack("<I", 5) + whole[84:])
    mixed = ply(tmp_path / "mixed", CUBE, [[0, 1, 3], *QUADS]).read_bytes()
    (tmp_path / "cut.ply").write_bytes(mixed[:-3])
    text = ply(tmp_path / "text", CUBE, QUADS, ascii_text=True).read_bytes()
    (tmp_path / "more.ply").write_bytes(text.replace(b"element face 6", b"element face 5"))
    (tmp_path / "less.ply").write_bytes(text.replace(b"\n4 1 5 7 3", b" 4 1 5 7 3"))
    (tmp_path / "half.ply").write_bytes(text.replace(b"\n4 1 5 7 3", b"\n4 1 0.5 7 3"))
    (tmp_path / "names.ply").write_bytes(text.replace(b"vertex_index", b"corners"))
    triangles = ply(tmp_path / "triangles", CUBE, TETRAHEDRON).read_bytes()
    (tmp_path / "rest.ply").write_bytes(triangles.replace(b"face 4", b"face 3"))
    grid = "ply\nformat ascii 1.0\nobj_info num_cols 2\nelement vertex 1\nproperty float x\nproperty float y\n"
    grid += (
        "property float z\nelement range_grid 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0\n0\n"
    )
    cases = {
        "float: b?'zero'": write("word.obj", "v 0 0 zero\nf 1 1 1\n"),
        "OBJ counts from 1": write("nought.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
        "faces name vertices 0 to 3, and there are 3": write("high.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
        "faces name vertices -1": write("low.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n"),
        "a line v has fewer than 3 numbers": write("flat.obj", "v 0 0\nv 1 0\nf 1 2 1\n"),
        "float: b?'0,5'": write("comma.obj", "v 0,5 0 0\n"),
        "OFF BINARY.*expected OFF as text": write("binary.off", "OFF BINARY\n\0\0"),
        "BREP.*the numbers of vertices and faces": write("word.off", "BREP\n"),
        "short.*face: values are missing, or": write("short.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        "corner.*face: values are missing": write("corner.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n"),
        "faces name vertices -1 to 2": write("below.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n"),
        "6 facets need 384 bytes, and there are 364": tmp_path / "cut.stl",
        "5 facets need 334 bytes, and there are 384": tmp_path / "count.stl",
        "1 corners of 3 numbers in 1 facets": write("loop.stl", "solid a\nfacet\nvertex 0 0 0\nendfacet\nendsolid\n"),
        "12 corners of 35 numbers": write(
            "number.stl", solids("a").decode().replace("vertex 0.000000000e+00 ", "vertex ", 1)
        ),
        "2 solids of which 1 end": write("half.stl", (solids("a") + solids("b")[:-12]).decode()),
        "face: values are missing": tmp_path / "cut.ply",
        "1 lines are left behind the last face": tmp_path / "more.ply",
        "14 bytes are left behind the last face": tmp_path / "rest.ply",
        "face: values are missing, or several rows": tmp_path / "less.ply",
        "0.5 where a whole number belongs": tmp_path / "half.ply",
        "face has no vertex_indices or vertex_index, only corners": tmp_path / "names.ply",
        "1 points, but no faces: a point cloud or range grid": write("range.ply", grid),
        "is empty": ply(tmp_path / "empty", [], [], ascii_text=True),
        "no finite position": ply(tmp_path / "nan", [[np.nan, 0, 0], *CUBE[1:]], QUADS),
        "no PLY": write("text.ply", "hello"),
        "points without faces": write("scan.xyz", "0 0 0"),
        "cannot read a mesh with the ending '.fbx'": write("scan.fbx", "0 0 0"),
        "cannot be read as a mesh": write("bad.glb", "glTFnothing"),
        "no such file": tmp_path / "absent.ply",
        "faces with an area": ply(tmp_path / "line", CUBE * [1, 0, 0], QUADS),
        r"[47] of 8 vertices have no finite position, or one beyond 1e\+09": ply(tmp_path / "far", CUBE * 1e300, QUADS),
    }
    for words, path in cases.items():
        with pytest.raises(AlignError, match=words) as caught:
            load_scan(path, "mm")
        assert str(path) in str(caught.value)
    with pytest.raises(AlignError, match="scan_unit"):
        load_scan(tmp_path / "whole.stl", "furlong")


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
    with pytest.raises(AlignError, match=r"face: |whole number"):
        load_scan(tmp_path / "a.ply", "mm")
