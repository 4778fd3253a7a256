"""`rgbn compare` on folders whose truth is known: a verdict on a twin, what changed between sessions, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from align.truth import ground_truth
from compare.compare import compare
from experiments.before_after import tell_change
from experiments.compare_folders import NUMBERS, compare_folders, told
from fixtures.lit_surfaces import dome, lights_along, matte, spiral
from fixtures.mesh_shapes import ball
from formats.meshes.ply import write_ply
from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.files import write_json, write_png, write_text
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.pose import Pose, rotation_from_vector
from scene.store import Store
from solve.solve import solve

SIDE = 48
CAMERA = Camera(SIDE, SIDE, 400.0, 400.0, (SIDE - 1) / 2, (SIDE - 1) / 2)
NORMALS, MASK = dome(SIDE, rim=0.32)
TRUTH = np.where(MASK[..., None], NORMALS, np.nan).astype("f4")


def lights(count=10, **more):
    directions = spiral(np.cos(np.radians(20 + 35 * np.arange(count) / count)))
    return lights_along(directions, digits=2, reference_point_mm=np.array([0, 0, -800.0]), **more)


def photographed(true, noise=0.0, seed=0):
    """A matte object under its lights."""
    grain = noise * np.random.default_rng(seed).standard_normal((len(true), SIDE, SIDE, 3))
    return Frames.from_linear(true.names, matte(true, np.nan_to_num(TRUTH), TRUTH, 0.7) + grain)


def folder_of(path, told, true, *, methods=("ls", "iterative"), noise=0.0, seed=0):
    """A processed folder: a matte ball under the true lights, solved with those that were told."""
    store, frames = Store(path), photographed(true, noise, seed)
    store.save_frames(frames)
    store.save_camera(CAMERA)
    store.save_lights(told)
    store.save_mask(MASK)
    store.save_truth(TRUTH, np.where(MASK, 0.1, np.nan))
    for method in methods:
        store.save_estimate(solve(method, frames, told, CAMERA, MASK))
    compare(store)
    return path


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Photographs solved with lights that are four degrees off, and their twin."""
    parent, exact = tmp_path_factory.mktemp("pair"), lights()
    aside = np.radians(4.0) * np.random.default_rng(1).standard_normal(exact.directions.shape)
    wrong = replace(exact, directions=unit(exact.directions + aside))
    twin = folder_of(parent / "real" / "twin", exact, exact, noise=0.01, seed=2)
    return folder_of(parent / "real", wrong, exact, noise=0.01, seed=1), twin


def test_two_folders_give_a_verdict_and_its_numbers(pair, tmp_path):
    real, twin = pair
    found = compare_folders(real, twin, tmp_path / "out")
    kept = Store(tmp_path / "out").read_json(NUMBERS)
    assert [one["kind"] for one in kept["captures"].values()] == ["photographs", "rendering"]
    for name in ("ls", "iterative"):
        error, row = angular_error_deg(Store(real).load_normals(name), TRUTH), kept["methods"][name]
        assert row["real"]["median_deg"] == pytest.approx(np.nanmedian(error), rel=1e-5)
        # Lights off by four degrees make an error of their own, and a greater one.
        assert row["median_difference_low_deg"] > 0
        assert f"{row['likeness']}: r = {row['pearson']:.2f}, medians" in told(found)
    assert told(found).splitlines()[0].endswith(found["verdict"])
    itself = compare_folders(real, real, tmp_path / "again")["methods"]["ls"]
    assert (itself["likeness"], itself["median_difference_low_deg"]) == ("alike", 0)


def test_what_cannot_be_compared_is_told_and_nothing_is_written(pair, tmp_path):
    """Not even a folder; a method asked for that is not in both is named."""
    real, twin, out = pair[0], tmp_path / "twin", tmp_path / "out"

    def told(words, **how):
        with pytest.raises(SceneError, match=words):
            compare_folders(real, twin, out, **how)
        assert not out.exists()

    told("is no folder")
    twin.mkdir()
    told("found no methods' errors")
    folder_of(twin, lights(), lights(), methods=("ls",))
    for asked, missing in (("ls,iterativ", "iterativ"), ("ls, iterative", "iterative"), (" ,", "nothing")):
        told(f"--method {asked}: {missing} is unknown; .* ls. These both folders", methods=asked)
    assert list(compare_folders(real, twin, tmp_path / "found", methods=" ls ")["methods"]) == ["ls"]
    for kind in ("normals/{}.npy", "albedo/{}.npy", "compare/error_real_{}.npy"):
        if (twin / kind.format("ls")).exists():
            (twin / kind.format("ls")).rename(twin / kind.format("position"))
    told("no method's errors")


SIGMA_DEG = 0.3


@pytest.fixture(scope="module")
def scan():
    """A ball pushed in and out, in axes of its own."""
    sphere = ball(1.0, 4)
    d = sphere.vertices
    reach = 1 + 0.1 * np.sin(3 * d[:, 0] + 1) * np.cos(4 * d[:, 1]) + 0.1 * d[:, 2] ** 3
    return Mesh(40 * d * reach[:, None] + [5, -80, 30], sphere.faces)


def session_of(parent, name, scan, pose, camera, seed, *, changed=None, told_pose=None, other_scan=None, lit=1):
    """A session's folder, and what was processed from it: true normals with noise, and a dent of 8 pixels."""
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
        right, up = (columns - u) / 4, (v - rows) / 4
        far = np.maximum(np.hypot(right, up), 1e-9)
        slope = 0.12 * np.sin(np.pi * far) * (far < 1)
        normals[..., :2] -= slope[..., None] * np.stack([right, up], -1) / far[..., None]
    store.save_camera(camera)
    store.save_lights(Lights(("a",), np.array([[0, 0, 1.0]]), np.ones((1, 3)), None, np.array([0, 0, -500.0])))
    store.save_mask(mask)
    store.save_truth(truth.normals, truth.sigma_deg)
    store.save_pose(told_pose or pose, residual_px=0.2, sigma_mm=0.3, sigma_deg=0.1)
    sigma = np.where(mask, SIGMA_DEG, np.nan).astype(np.float32)
    # A pixel of three samples has a normal, and nothing to tell its error by: once all places lost theirs to it.
    sigma[60::31, 50::29] = np.nan
    given = unit(normals).astype(np.float32)
    albedo, samples = np.ones_like(given), lit * mask.astype(np.uint16)
    store.save_estimate(Estimate("ls", given, albedo, samples, 1.0, 1.0, {}, (), sigma))
    compare(store)
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
    before = session_of(tmp_path, "before", scan, first, camera, 1)
    # A pose that is half a millimetre off, as its sigma allows for.
    moved = replace(second, matrix=second.matrix + np.eye(4, 4, 3) * np.array([0.3, -0.3, 0, 0])[:, None])
    changed = point if is_hit else None
    after = session_of(tmp_path, "after", scan, second, other, 2, changed=changed, told_pose=moved)
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
    dim = session_of(tmp_path, "dim", scan, second, other, 2, changed=changed, told_pose=moved, lit=0)
    doubtful = tell_change(Store(before), Store(dim), ("ls",), Store(tmp_path / "doubtful"))
    assert "nothing changed" in doubtful["verdict"]
    assert "1 more where a flash is shadowed" in doubtful["verdict"]


def test_without_one_scan_for_both_it_is_said_and_the_rest_is_done(scan, views, tmp_path, capsys):
    (first, camera), (second, other) = views
    before = session_of(tmp_path, "before", scan, first, camera, 1)
    again = Mesh(scan.vertices + 1, scan.faces)
    after = session_of(tmp_path, "after", scan, second, other, 2, other_scan=again)
    found = compare_folders(before, after, tmp_path / "out")
    assert found["change"] is None
    assert "have no scan in common" in capsys.readouterr().err
    assert found["methods"]
