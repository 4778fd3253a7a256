"""What is mended of a scan, and how: patches, turned faces, holes, dust; truth is the mesh before it was spoilt."""

import numpy as np
import pytest

from align.scan.mended_scan import load_scan
from scene.mesh import Mesh


def load(tmp_path, vertices, faces, unit="mm", **more):
    """Write an OBJ, whose text keeps every digit, and load it."""
    path = tmp_path / "scan.obj"
    lines = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in vertices]
    path.write_text("\n".join(lines + ["f {} {} {}".format(*(f + 1)) for f in np.asarray(faces)]))
    return load_scan(path, unit, **more)


def same_places(mesh, truth):
    """Which faces of `truth` each face of `mesh` is, by its middle; and whether it looks the same way."""
    from scipy.spatial import KDTree

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
        vertices = np.stack([(out + 0.01) * np.cos(angle), (out + 0.01) * np.sin(angle), up], -1).reshape(-1, 3)
        a = (9 * np.arange(4)[:, None] + np.arange(8)).ravel()
        leaves.append((vertices, np.concatenate([np.stack([a, a + 9, a + 10], -1), np.stack([a, a + 10, a + 1], -1)])))
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
    import trimesh

    sphere = trimesh.creation.icosphere(4)
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
