"""Two sessions of one scanned object: laid over each other through the scan, what changed is told, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from align.truth import ground_truth
from experiments.before_after import tell_change
from experiments.compare_folders import compare_folders, told
from formats.meshes.ply import write_ply
from scene.camera import Camera
from scene.estimate import Estimate
from scene.files import write_json, write_png, write_text
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose, rotation_from_vector
from scene.store import Store

SIGMA_DEG = 0.3


@pytest.fixture(scope="module")
def scan():
    """A ball pushed in and out, in axes of its own."""
    import trimesh

    ball = trimesh.creation.icosphere(4)
    d = np.array(ball.vertices)
    reach = 1 + 0.1 * np.sin(3 * d[:, 0] + 1) * np.cos(4 * d[:, 1]) + 0.1 * d[:, 2] ** 3
    return Mesh(40 * d * reach[:, None] + [5, -80, 30], np.array(ball.faces))


def session(parent, name, scan, pose, camera, seed, *, changed=None, told_pose=None, other_scan=None, lit=1):
    """A session's folder, and what was processed from it: true normals with noise, turned in one place."""
    folder, store = parent / f"session {name}", Store(parent / name)
    write_png(folder / "flash.png", np.zeros((4, 4, 3), np.uint8))
    shown = scan if other_scan is None else other_scan
    write_ply(folder / "scan.ply", {"x y z": shown.vertices.astype(np.float32)}, shown.faces)
    manifest = 'name = "{}"\n[frames]\nflash = "flash.png"\nlinear = true\n[object]\nscan = "scan.ply"\n'
    write_text(folder / "session.toml", manifest.format(name))
    write_json(store.path("session.json"), {"session": str(folder), "relative": f"../session {name}"})
    truth = ground_truth(scan, pose, camera)
    mask = np.isfinite(truth.normals).all(-1)
    normals = truth.normals + np.radians(SIGMA_DEG) * np.random.default_rng(seed).standard_normal(truth.normals.shape)
    if changed is not None:
        rows, columns = np.indices(mask.shape)
        u, v = camera.project(pose.apply(changed)[None])[0]
        normals[..., 0] += np.where(np.hypot(columns - u, rows - v) < 4, 0.12, 0)
    store.save_camera(camera)
    store.save_lights(Lights(("a",), np.array([[0, 0, 1.0]]), np.ones((1, 3)), None, np.array([0, 0, -500.0])))
    store.save_mask(mask)
    store.save_truth(truth.normals, truth.sigma_deg)
    store.save_pose(told_pose or pose, residual_px=0.2, sigma_mm=0.3, sigma_deg=0.1)
    sigma = np.where(mask, SIGMA_DEG, np.nan).astype(np.float32)
    given = unit(normals).astype(np.float32)
    albedo, samples = np.ones_like(given), lit * mask.astype(np.uint16)
    store.save_estimate(Estimate("ls", given, albedo, samples, 1.0, 1.0, {}, (), sigma))
    return store.folder


@pytest.fixture(scope="module")
def views(scan):
    """Poses and cameras of two sessions: the object turned by 20 degrees, a longer lens."""
    first = Pose.from_rotation_translation(rotation_from_vector([0.4, 0.2, -0.3]), np.zeros(3))
    first = Pose.from_rotation_translation(first.rotation, [0, 0, -500] - first.rotate(scan.center_mm))
    second = Pose.from_rotation_translation(rotation_from_vector([0.1, 0.3, 0.2]) @ first.rotation, np.zeros(3))
    second = Pose.from_rotation_translation(second.rotation, [6, -4, -480] - second.rotate(scan.center_mm))
    return (first, Camera(200, 180, 900.0, 900.0, 99.0, 91.0)), (second, Camera(240, 200, 1000.0, 1000.0, 118.0, 98.0))


def middle_of(scan, pose):
    """The point of the scan that is nearest to the camera's axis, in front."""
    seen = pose.apply(scan.vertices)
    front = seen[:, 2] > np.quantile(seen[:, 2], 0.7)
    return scan.vertices[np.argmin(np.where(front, np.hypot(*seen[:, :2].T), np.inf))]


@pytest.mark.parametrize("is_hit", [False, True])
def test_a_change_is_told_where_it_is_and_an_unchanged_object_is_not_accused(scan, views, tmp_path, is_hit):
    (first, camera), (second, other) = views
    point = middle_of(scan, first)
    before = session(tmp_path, "before", scan, first, camera, 1)
    # A pose that is half a millimetre off, as its sigma allows for.
    moved = replace(second, matrix=second.matrix + np.eye(4, 4, 3) * np.array([0.3, -0.3, 0, 0])[:, None])
    changed = point if is_hit else None
    after = session(tmp_path, "after", scan, second, other, 2, changed=changed, told_pose=moved)
    found = compare_folders(before, after, tmp_path / "out")
    change = found["change"]
    assert change["method"] == "ls"
    assert 0.005 < change["flagged_share"] < 0.03
    assert change["over_stated"] == pytest.approx(1, abs=0.1)
    assert 0.2 < change["moved_px"] < 3
    assert change["verdict"] in told(found)
    maps = [np.load(tmp_path / "out" / f"{one}.npy") for one in ("change", "change_z")]
    assert [one.shape for one in maps] == [(180, 200)] * 2
    assert (tmp_path / "out" / "change.png").exists()
    assert (tmp_path / "out" / "change.tif").exists()
    if not is_hit:
        assert change["places"] == []
        assert "nothing changed" in change["verdict"]
        return
    (place,) = change["places"]
    u, v = camera.project(first.apply(point)[None])[0]
    assert (place["u"], place["v"]) == pytest.approx((u, v), abs=1.5)
    assert place["change_deg"] == pytest.approx(np.degrees(0.12), rel=0.3)
    assert "changed at 1 place," in change["verdict"]
    # A flash less in one of the sessions: a shadow's error may look like this.
    dim = session(tmp_path, "dim", scan, second, other, 2, changed=changed, told_pose=moved, lit=0)
    doubtful = tell_change(Store(before), Store(dim), ("ls",), Store(tmp_path / "doubtful"))
    assert "nothing changed" in doubtful["verdict"]
    assert "1 more where a flash is shadowed" in doubtful["verdict"]


def test_without_one_scan_for_both_it_is_said_and_the_rest_is_done(scan, views, tmp_path, capsys):
    (first, camera), (second, other) = views
    before = session(tmp_path, "before", scan, first, camera, 1)
    again = Mesh(scan.vertices + 1, scan.faces)
    after = session(tmp_path, "after", scan, second, other, 2, other_scan=again)
    found = compare_folders(before, after, tmp_path / "out")
    assert found["change"] is None
    assert "have no scan in common" in capsys.readouterr().err
    assert found["methods"]
