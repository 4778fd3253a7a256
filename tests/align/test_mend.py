"""What is mended of a scan, and how; its unit, and a ball in it. Truth is the mesh before it was spoilt."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from align.scan.mended_scan import load_scan
from fixtures.mesh_shapes import ball, over_grid, volume
from scene.errors import AlignError
from scene.mesh import Mesh

# A tetrahedron, faces counter-clockwise from outside.
VERTICES = np.array([[0, 0, 0], [30, 0, 0], [0, 20, 0], [0, 0, 10]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def load(tmp_path, vertices, faces, unit="mm", **more):
    """Write an OBJ, whose text keeps every digit, and load it."""
    path = tmp_path / "scan.obj"
    lines = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in vertices]
    path.write_text("\n".join(lines + ["f {} {} {}".format(*(f + 1)) for f in np.asarray(faces)]))
    return load_scan(path, unit, **more)


@pytest.mark.parametrize(
    ("unit", "factor"), [("m", 1000.0), ("cm", 10.0), ("mm", 1.0), ("inch", 25.4), ("unknown", 1.0)]
)
def test_units(tmp_path, unit, factor):
    mesh = load(tmp_path, VERTICES, FACES, unit)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([30 * factor, 20 * factor, 10 * factor])
    assert any(repair.startswith("scan_unit is unknown") for repair in mesh.repairs) == (unit == "unknown")


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
    mesh = load(tmp_path, vertices, rows)
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
    mesh = load(tmp_path, VERTICES, FACES[:, ::-1])
    assert volume(mesh) == pytest.approx(1000.0)
    assert any("outward" in repair for repair in mesh.repairs)


def test_an_open_scan_keeps_its_outside(tmp_path, bumpy):
    front = bumpy.faces[bumpy.face_normals[:, 2] > 0.1]
    for faces in (front, front[:, ::-1]):
        assert (load(tmp_path, bumpy.vertices, faces).face_normals[:, 2] > 0).mean() > 0.99


def test_a_few_crowded_edges_are_named_many_are_refused(tmp_path, bumpy):
    a, b = bumpy.faces[0][:2]
    fin = np.array([*bumpy.vertices, 1.3 * bumpy.vertices[a]])
    mesh = load(tmp_path, fin, [*bumpy.faces, [a, b, len(bumpy.vertices)]])
    assert any("three or more faces" in repair for repair in mesh.repairs)
    # Four leaves on one spine, many times.
    spine = np.array([[0, 0, 0], [0, 0, 10.0]])
    leaves = np.array([[np.cos(t), np.sin(t), 5.0] for t in np.arange(4) * np.pi / 2]) * 20
    with pytest.raises(AlignError, match="three or more faces"):
        load(tmp_path, np.concatenate([spine, leaves]), [[0, 1, 2 + i] for i in range(4)])


def test_a_vertex_without_a_position_harms_only_where_a_face_names_it(tmp_path):
    mesh = load(tmp_path, [*VERTICES, [np.nan, 0, 0]], FACES)
    assert volume(mesh) == pytest.approx(1000.0)
    assert mesh.repairs == ("dropped 1 vertices that no face uses",)


def same_places(mesh, truth):
    """Which faces of `truth` each face of `mesh` is, by its middle; and whether it looks the same way."""
    away, face = KDTree(truth.vertices[truth.faces].mean(1)).query(mesh.vertices[mesh.faces].mean(1))
    return away, np.einsum("tk,tk->t", mesh.face_normals, truth.face_normals[face]) > 0


def patches_of(mesh, count, seed):
    """Cut a mesh into patches, around `count` random points; each with vertices of its own."""
    middle = mesh.vertices[mesh.faces].mean(1)
    seeds = middle[np.random.default_rng(seed).choice(len(middle), count, replace=False)]
    owner = np.linalg.norm(middle[:, None] - seeds, axis=2).argmin(1)
    for number in range(count):
        used, faces = np.unique(mesh.faces[owner == number], return_inverse=True)
        yield mesh.vertices[used], faces.reshape(-1, 3)


def joined(patches):
    offset = np.cumsum([0, *(len(vertices) for vertices, _ in patches)])
    return (
        np.concatenate([vertices for vertices, _ in patches]),
        np.concatenate([faces + start for (_, faces), start in zip(patches, offset, strict=False)]),
    )


def test_borders_that_all_but_meet_are_sewn(tmp_path, coarse):
    """Patches scanned apart: a border's corners differ by a hundredth of an edge; sewn, the surface is closed again."""
    generator = np.random.default_rng(1)
    edge = np.linalg.norm(coarse.vertices[coarse.faces[:, 0]] - coarse.vertices[coarse.faces[:, 1]], axis=1).min()
    patches = [(v + 0.01 * edge * generator.uniform(-1, 1, v.shape), f) for v, f in patches_of(coarse, 5, 1)]
    mesh = load(tmp_path, *joined(patches))
    assert len(mesh.vertices) == len(coarse.vertices)
    assert len(mesh.faces) == len(coarse.faces)
    assert same_places(mesh, coarse)[1].all()
    said = " ".join(mesh.repairs)
    assert "all but met" in said
    assert "open borders" not in said


def test_borders_that_lie_apart_stay_apart(tmp_path, coarse):
    patches = [(v * 0.95 + 0.05 * v.mean(0), f) for v, f in patches_of(coarse, 5, 1)]
    mesh = load(tmp_path, *joined(patches))
    assert "kept 5 separate pieces" in mesh.repairs
    assert sum(len(v) for v, _ in patches) == len(mesh.vertices)


def test_three_borders_in_one_place_are_not_sewn(tmp_path):
    """Leaves of a book: sewn together, they were no surface any more."""
    leaves = []
    for number in range(3):
        out, up = np.meshgrid(np.arange(5.0), np.arange(9.0), indexing="ij")
        angle = 2 * number + 0.001
        leaf = over_grid(np.stack([(out + 0.01) * np.cos(angle), (out + 0.01) * np.sin(angle), up], -1))
        leaves.append((leaf.vertices, leaf.faces))
    mesh = load(tmp_path, *joined(leaves))
    assert "kept 3 separate pieces" in mesh.repairs
    assert not any("three or more faces" in repair for repair in mesh.repairs)
    assert any("all but met" in repair for repair in load(tmp_path, *joined(leaves[:2])).repairs)


@pytest.mark.parametrize("seed", range(4))
def test_patches_are_turned_one_by_one(tmp_path, coarse, seed):
    """Loose patches of one object, some of them inside out: each comes back as it was."""
    generator = np.random.default_rng(seed)
    patches = [
        (v * 0.97 + 0.03 * v.mean(0), f[:, ::-1] if generator.random() < 0.4 else f)
        for v, f in patches_of(coarse, 8, seed)
    ]
    mesh = load(tmp_path, *joined(patches))
    assert same_places(mesh, coarse)[1].all()


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_faces_turned_at_random_come_back(tmp_path, coarse, rotations, share):
    """The law: spoiling changes nothing, in any position; and nothing but the turned faces is reported."""
    generator = np.random.default_rng(3)
    turned = generator.random(len(coarse.faces)) < share
    faces = np.where(turned[:, None], coarse.faces[:, ::-1], coarse.faces)
    for rotation in rotations:
        truth = Mesh(coarse.vertices @ rotation.T + [500, -900, 100], coarse.faces)
        mesh = load(tmp_path, truth.vertices, faces)
        away, same = same_places(mesh, truth)
        assert same.all()
        assert away.max() < 1e-9
        assert all("turned" in repair for repair in mesh.repairs)


def ring(generator, *, twisted):
    """A band around the z axis, two faces a step; twisted, it has one side only."""
    around = np.linspace(0, 2 * np.pi, 61)[:-1]
    lean = around / 2 if twisted else np.full(60, np.pi / 2)
    out = np.stack([np.cos(around), np.sin(around), 0 * around], -1)
    arm = np.sin(lean)[:, None] * [0, 0, 1] + np.cos(lean)[:, None] * out
    vertices = np.concatenate([30 * out + 8 * arm, 30 * out - 8 * arm])
    one, two = np.arange(60), np.roll(np.arange(60), -1)
    other = two + 60
    if twisted:
        two, other = np.where(one == 59, 60, two), np.where(one == 59, 0, other)
    faces = np.concatenate([np.stack([one, one + 60, two], -1), np.stack([two, one + 60, other], -1)])
    turned = generator.random(120) < 0.3
    return vertices, np.where(turned[:, None], faces[:, ::-1], faces)


def test_a_one_sided_band_is_named(tmp_path):
    generator = np.random.default_rng(0)
    plain = load(tmp_path, *ring(generator, twisted=False))
    assert not any("one-sided" in repair for repair in plain.repairs)
    band = load(tmp_path, *ring(generator, twisted=True))
    (told,) = [repair for repair in band.repairs if "one-sided" in repair]
    assert told == f"{len(band.faces)} faces are of a one-sided surface: normals there may be reversed"


def bowl():
    """The inside of a bowl and its outside: patches that do not touch, wound as a scanner winds them."""
    sphere = ball(1.0, 4)
    half = sphere.faces[(sphere.vertices[sphere.faces][:, :, 2] < 0.1).all(1)]
    inner = (38.0 * sphere.vertices, half[:, ::-1])
    return joined([inner, (40.0 * sphere.vertices, half)])


def test_the_hollow_of_a_bowl_looks_inward(tmp_path):
    """A patch may rightly see less of the sky than its back: the rest of the file, which is right, vouches for it."""
    mesh = load(tmp_path, *bowl())
    middle = mesh.vertices[mesh.faces].mean(1)
    toward = np.einsum("tk,tk->t", mesh.face_normals, middle) > 0
    assert (toward == (np.linalg.norm(middle, axis=1) > 39)).all()


def test_holes_are_left_open_and_measured(tmp_path, bumpy):
    """Two holes of known size; turned faces change neither their number nor their length."""
    away = [np.linalg.norm(bumpy.vertices - bumpy.vertices[i], axis=1) for i in (0, 5)]
    cut = (away[0] < 9)[bumpy.faces].any(1) | (away[1] < 4)[bumpy.faces].any(1)
    generator = np.random.default_rng(0)
    said = []
    for share in (0, 0.3):
        turned = generator.random((~cut).sum()) < share
        faces = np.where(turned[:, None], bumpy.faces[~cut][:, ::-1], bumpy.faces[~cut])
        mesh = load(tmp_path, bumpy.vertices, faces)
        assert len(mesh.faces) == (~cut).sum()
        said.append(next(repair for repair in mesh.repairs if "open borders" in repair))
    assert said[0] == said[1]
    assert said[0].startswith("2 open borders")
    across = float(said[0].split(" mm across")[0].split()[-1])
    # The diagonal of the box around a circle of 18 mm is at most 18 sqrt 2; the hole's edge lies up to a face outside.
    assert 18 <= across <= 1.2 * 18 * 2**0.5


def test_both_sides_of_every_face_become_one(tmp_path, coarse):
    """Some programs write each face twice, once from behind."""
    mesh = load(tmp_path, coarse.vertices, np.concatenate([coarse.faces, coarse.faces[:, ::-1]]))
    assert len(mesh.faces) == len(coarse.faces)
    assert same_places(mesh, coarse)[1].all()
    assert any("double faces" in repair for repair in mesh.repairs)


def with_balls(mesh, *diameters, cut=-2.0):
    """The mesh and balls beside it, each without what lies below `cut` radii."""
    sphere = ball(1.0, 3)
    kept = sphere.faces[(sphere.vertices[sphere.faces][:, :, 2] > cut).all(1)]
    vertices, faces = [mesh.vertices], [mesh.faces]
    for number, diameter in enumerate(diameters):
        faces.append(kept + sum(map(len, vertices)))
        vertices.append(diameter / 2 * sphere.vertices + [150 + 100 * number, 0, 0])
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.mark.parametrize(
    ("unit", "factor", "meant"), [("m", 1.0, '"mm"'), ("mm", 0.001, '"m"'), ("cm", 5.0, '"mm"'), ("mm", 1.0, None)]
)
def test_a_speck_and_a_house_are_doubted(tmp_path, coarse, unit, factor, meant):
    """Not refused: the registration sees the photographs, and knows better."""
    mesh = load(tmp_path, factor * coarse.vertices, coarse.faces, unit)
    doubts = [repair for repair in mesh.repairs if "right?" in repair]
    assert len(doubts) == (meant is not None)
    assert all(meant in doubt for doubt in doubts)


@pytest.mark.parametrize("cut", [-2.0, -0.6])
def test_a_ball_gives_the_scale_and_goes(tmp_path, coarse, cut):
    """Whole, or without the part that no scanner sees: a ball of 38 mm in a scan of unknown unit."""
    vertices, faces = with_balls(coarse, 38.0, cut=cut)
    mesh = load(tmp_path, vertices / 17, faces, "unknown", ball_diameter_mm=38.0)
    assert len(mesh.faces) == len(coarse.faces)
    assert mesh.radius_mm == pytest.approx(coarse.radius_mm, rel=1e-4)
    assert any("one unit of the file is 17 mm" in repair for repair in mesh.repairs)


def test_a_ball_under_a_known_unit_is_measured_only(tmp_path, coarse):
    mesh = load(tmp_path, *with_balls(coarse, 37.0), "mm", ball_diameter_mm=38.0)
    assert mesh.radius_mm == pytest.approx(coarse.radius_mm, rel=1e-6)
    assert any("measures 37 mm, 38 mm were said" in repair for repair in mesh.repairs)
    # Without a word of a ball it is part of the object.
    assert len(load(tmp_path, *with_balls(coarse, 37.0), "mm").faces) > len(mesh.faces)


@pytest.mark.parametrize(("balls", "found"), [((), "none"), ((38.0, 30.0), "38, 30")])
def test_no_ball_or_two_are_refused(tmp_path, coarse, balls, found):
    with pytest.raises(AlignError, match=f"scan_ball_diameter_mm expects one ball.*{found}"):
        load(tmp_path, *with_balls(coarse, *balls), "unknown", ball_diameter_mm=38.0)
