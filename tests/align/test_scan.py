"""Scans as scanners write them: formats, units, and what is mended or refused."""

import struct

import numpy as np
import pytest

from align.scan.mended_scan import load_scan
from scene.errors import AlignError

# A tetrahedron, faces counter-clockwise from outside.
VERTICES = np.array([[0, 0, 0], [30, 0, 0], [0, 20, 0], [0, 0, 10]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def volume(mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("tk,tk->", a, np.cross(b, c)) / 6)


def ascii_ply(path, vertices, rows):
    lines = ["ply", "format ascii 1.0", "comment scanner", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(rows)}", "property list int int vertex_indices", "end_header"]
    lines += [" ".join(f"{x:.9g}" for x in vertex) for vertex in vertices]
    lines += [" ".join(map(str, [len(row), *row])) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def binary_ply(path, vertices, rows):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(rows)}\nproperty list int int vertex_indices\nend_header\n"
    body = b"".join(struct.pack("<3f", *vertex) for vertex in vertices)
    body += b"".join(struct.pack(f"<i{len(row)}i", len(row), *row) for row in rows)
    path.write_bytes(head.encode() + body)
    return path


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "glb", "ply"])
def test_every_format_gives_the_same_solid(tmp_path, suffix):
    import trimesh

    path = tmp_path / f"scan.{suffix}"
    trimesh.Trimesh(VERTICES, FACES, process=False).export(path)
    mesh = load_scan(path, "mm")
    assert len(mesh.vertices) == 4
    assert volume(mesh) == pytest.approx(1000.0)
    assert sorted(map(tuple, mesh.vertices.round(6).tolist())) == sorted(map(tuple, VERTICES.tolist()))


@pytest.mark.parametrize(("unit", "factor"), [("m", 1000.0), ("cm", 10.0), ("mm", 1.0), ("inch", 25.4)])
def test_units(tmp_path, unit, factor):
    mesh = load_scan(ascii_ply(tmp_path / "a.ply", VERTICES, FACES), unit)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([30 * factor, 20 * factor, 10 * factor])


def test_mending_is_done_and_said(tmp_path, bumpy):
    """Soup of loose, doubled, flat and turned faces comes back as the closed solid that it was."""
    generator = np.random.default_rng(0)
    soup = bumpy.vertices[bumpy.faces].reshape(-1, 3)
    faces = np.arange(len(soup)).reshape(-1, 3)
    turned = generator.random(len(faces)) < 0.4
    faces[turned] = faces[turned][:, ::-1]
    dust = np.array([[200, 0, 0], [200.5, 0, 0], [200, 0.5, 0]])
    vertices = np.concatenate([soup, dust, [[7, 8, 9]]])
    rows = [*faces.tolist(), [0, 0, 1], faces[0].tolist(), [len(soup), len(soup) + 1, len(soup) + 2]]
    mesh = load_scan(binary_ply(tmp_path / "soup.ply", vertices, rows), "mm")
    assert len(mesh.vertices) == len(bumpy.vertices)
    assert len(mesh.faces) == len(bumpy.faces)
    assert volume(mesh) == pytest.approx(volume(bumpy), rel=1e-5)
    # The strongest: each face runs as it should, not only their sum.
    outward = np.einsum("tk,tk->t", mesh.face_normals, mesh.vertices[mesh.faces].mean(1))
    assert (outward > 0).mean() > 0.99
    said = " ".join(mesh.repairs)
    for word in ("merged", "without area", "double", "loose", "agree", "no face uses"):
        assert word in said, word


def test_an_inside_out_scan_is_turned(tmp_path):
    mesh = load_scan(ascii_ply(tmp_path / "a.ply", VERTICES, FACES[:, ::-1]), "mm")
    assert volume(mesh) == pytest.approx(1000.0)
    assert any("outward" in repair for repair in mesh.repairs)


def test_an_open_scan_keeps_its_outside(tmp_path, bumpy):
    front = bumpy.faces[bumpy.face_normals[:, 2] > 0.1]
    for faces in (front, front[:, ::-1]):
        mesh = load_scan(binary_ply(tmp_path / "a.ply", bumpy.vertices, faces), "mm")
        weight = mesh.face_normals[:, 2]
        assert (weight > 0).mean() > 0.99


def test_a_few_crowded_edges_are_named_many_are_refused(tmp_path, bumpy):
    a, b = bumpy.faces[0][:2]
    fin = np.array([*bumpy.vertices, 1.3 * bumpy.vertices[a]])
    mesh = load_scan(binary_ply(tmp_path / "a.ply", fin, [*bumpy.faces, [a, b, len(bumpy.vertices)]]), "mm")
    assert any("three or more faces" in repair for repair in mesh.repairs)
    # Four leaves on one spine, many times.
    spine = np.array([[0, 0, 0], [0, 0, 10.0]])
    leaves = np.array([[np.cos(t), np.sin(t), 5.0] for t in np.arange(4) * np.pi / 2]) * 20
    path = binary_ply(tmp_path / "b.ply", np.concatenate([spine, leaves]), [[0, 1, 2 + i] for i in range(4)])
    with pytest.raises(AlignError, match="three or more faces"):
        load_scan(path, "mm")


def test_a_vertex_without_a_position_harms_only_where_a_face_names_it(tmp_path):
    mesh = load_scan(ascii_ply(tmp_path / "a.ply", [*VERTICES, [np.nan, 0, 0]], FACES), "mm")
    assert volume(mesh) == pytest.approx(1000.0)
    assert mesh.repairs == ("dropped 1 vertices that no face uses",)


def test_refusals_say_why(tmp_path):
    nan = VERTICES.copy()
    nan[2, 1] = np.nan
    whole = binary_ply(tmp_path / "whole.ply", VERTICES, FACES).read_bytes()
    (tmp_path / "cut.ply").write_bytes(whole[:-9])
    (tmp_path / "text.ply").write_text("hello")
    for name in ("scan.xyz", "scan.fbx"):
        (tmp_path / name).write_text("0 0 0")
    (tmp_path / "bad.glb").write_bytes(b"glTFnothing")
    cases = {
        "point cloud": ascii_ply(tmp_path / "points.ply", VERTICES, []),
        "is empty": ascii_ply(tmp_path / "empty.ply", [], []),
        "no finite position": ascii_ply(tmp_path / "nan.ply", nan, FACES),
        "name vertices": ascii_ply(tmp_path / "range.ply", VERTICES, FACES + 2),
        "face: values are missing": tmp_path / "cut.ply",
        "no PLY": tmp_path / "text.ply",
        "points without faces": tmp_path / "scan.xyz",
        "cannot read a mesh with the ending '.fbx'": tmp_path / "scan.fbx",
        "cannot be read as a mesh": tmp_path / "bad.glb",
        "no such file": tmp_path / "absent.ply",
        "faces with an area": ascii_ply(tmp_path / "flat.ply", VERTICES * [1, 0, 0], FACES),
    }
    for words, path in cases.items():
        with pytest.raises(AlignError, match=words) as caught:
            load_scan(path, "mm")
        assert str(path) in str(caught.value)
    with pytest.raises(AlignError, match="scan_unit"):
        load_scan(tmp_path / "whole.ply", "furlong")
