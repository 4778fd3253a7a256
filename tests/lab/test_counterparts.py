"""`rgbn compare REAL TWIN` on folders whose truth is known, and the virtual lab's geometry."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from lab.compare_folders import NUMBERS, PAGE, compare_folders
from lab.counterpart_sides import open_folder, shifts_of
from lab.counterparts import pairs
from lab.counterparts.captures import object_maps
from lab.counterparts.experiments import EXPERIMENTS, Experiment, Setup
from lab.counterparts.scenes import CENTRE_MM, lab_scene, object_scene
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_json, write_npy, write_text
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere
from scene.store import Store
from solve.solve import solve

SIDE = 48
CAMERA = Camera(SIDE, SIDE, 400.0, 400.0, (SIDE - 1) / 2, (SIDE - 1) / 2)
V, U = np.mgrid[:SIDE, :SIDE]
X, Y = (U - CAMERA.cx) / 21, -(V - CAMERA.cy) / 21
MASK = X**2 + Y**2 < 0.9
TRUTH = np.where(MASK[..., None], np.stack([X, Y, np.sqrt(np.maximum(1 - X**2 - Y**2, 0))], -1), np.nan).astype("f4")


def lights(count=10, **more):
    turn = np.arange(count)
    polar = np.radians(20 + 35 * turn / count)
    x, y = np.sin(polar) * np.cos(2.4 * turn), np.sin(polar) * np.sin(2.4 * turn)
    directions = np.stack([x, y, np.cos(polar)], 1)
    names = tuple(f"flash_{i:02d}" for i in turn)
    return Lights(names, directions, np.ones((count, 3)), reference_point_mm=np.array([0, 0, -800.0]), **more)


def folder_of(path, told, true, *, noise=0.0, seed=0, methods=("ls", "iterative"), rendered=False):
    """A processed folder: a matte ball under the true lights, solved with those that were told."""
    store, rng = Store(path), np.random.default_rng(seed)
    shade = np.maximum(np.einsum("hwc,fc->fhw", np.nan_to_num(TRUTH), true.directions), 0)
    images = 0.7 * shade[..., None] * np.ones(3) + noise * rng.standard_normal((len(true), SIDE, SIDE, 3))
    frames = Frames.from_linear(told.names, images)
    store.save_frames(frames)
    store.save_camera(CAMERA)
    store.save_lights(told)
    store.save_mask(MASK)
    if rendered:
        write_npy(store.path("truth.npy"), TRUTH)
        write_text(store.path("session.toml"), "# Rendered by rgbn.\n")
    else:
        store.save_truth(TRUTH, np.where(MASK, 0.1, np.nan))
    for method in methods:
        store.save_estimate(solve(method, frames, told, CAMERA, MASK))
    return path


def off(exact, rng, sigma_deg):
    aside = np.radians(sigma_deg) * rng.standard_normal(exact.directions.shape)
    aside -= np.sum(aside * exact.directions, 1, keepdims=True) * exact.directions
    known = np.full(len(exact), sigma_deg)
    return replace(exact, directions=unit(exact.directions + aside), direction_sigma_deg=known)


def test_the_lights_sigma_becomes_the_spread_that_wrong_lights_make(tmp_path):
    """What is carried, from one session alone, against what a dozen sessions with lights really off by it scatter."""
    exact, stated, found = lights(), [], []
    for seed in range(12):
        told = off(exact, np.random.default_rng(10000 + seed), 3.0)
        path = folder_of(tmp_path / f"{seed}", told, exact, methods=("ls",))
        error = angular_error_deg(Store(path).load_normals("ls"), TRUTH)
        found.append(np.nanmedian(error))
        if seed < 4:
            shifts, carried = shifts_of(open_folder(path), ("ls",), seed=seed)
            assert carried["direction_sigma_deg"] == pytest.approx(3.0)
            stated.append(shifts["ls"][:, 1].std())
    assert np.median(stated) == pytest.approx(np.std(found), rel=0.6)
    assert np.std(found) > 0.1


def test_the_pose_turns_all_true_normals_together(tmp_path):
    """Exact lights, a pose off by one degree along each axis: the errors are the turn, and all methods see the same."""
    path = folder_of(tmp_path / "out", lights(), lights())
    write_json(path / "pose.json", {"camera_from_scan": np.eye(4), "sigma_deg": np.sqrt(3.0), "sigma_mm": 0.0})
    shifts, _ = shifts_of(open_folder(path), ("ls", "iterative"))
    # The median error of a turn about a random axis is about sigma times the length of two normal components.
    assert 0.7 < shifts["ls"][:, 1].mean() < 1.9
    assert np.abs(shifts["ls"] - shifts["iterative"]).max() < 0.05


def test_a_rendering_has_nothing_to_carry(tmp_path):
    told = off(lights(), np.random.default_rng(0), 3.0)
    folder = open_folder(folder_of(tmp_path / "twin", told, told, rendered=True))
    assert folder.kind == "rendering"
    assert shifts_of(folder, ("ls",))[0] == {}


@pytest.mark.parametrize("missing", ["camera.json", "frames"])
def test_sigmas_that_cannot_be_carried_are_kept_and_the_page_says_why(tmp_path, missing):
    told = off(lights(), np.random.default_rng(0), 3.0)
    real, twin = folder_of(tmp_path / "real", told, lights()), folder_of(tmp_path / "twin", told, told, rendered=True)
    gone = real / missing
    gone.unlink() if gone.is_file() else shutil.rmtree(gone)
    carried = compare_folders(real, twin, tmp_path / "out", methods="ls")["captures"]["real"]["carried"]
    assert carried["direction_sigma_deg"] == pytest.approx(3.0)
    assert carried["moves"] == 0
    page = (tmp_path / "out" / PAGE).read_text()
    assert f"{missing}{'/' if missing == 'frames' else ''} missing, so it could not be solved again" in page
    assert "nothing says how uncertain" not in page
    assert "lights and truth are exact" in page


def test_two_folders_give_a_page_and_its_numbers(tmp_path):
    exact = lights()
    real = folder_of(tmp_path / "real", off(exact, np.random.default_rng(1), 4.0), exact, noise=0.01, seed=1)
    twin = folder_of(tmp_path / "twin", exact, exact, noise=0.01, seed=2, rendered=True)
    found = compare_folders(real, twin, tmp_path / "out")
    kept = Store(tmp_path / "out").read_json(NUMBERS)
    for name in ("ls", "iterative"):
        error = angular_error_deg(Store(real).load_normals(name), TRUTH)
        assert kept["methods"][name]["real"]["median_deg"] == pytest.approx(np.nanmedian(error), rel=1e-5)
    # Lights off by four degrees that say so: the sigma holds the difference.
    row = kept["methods"]["ls"]["difference"]["median_deg"]
    assert row["deg"] < 4 * row["sigma_deg"]
    page = (tmp_path / "out" / PAGE).read_text()
    assert found["verdict"] in {"alike", "not shown", "differ"}
    assert page.count("data:image/png") == 4
    assert "://" not in page.replace("http://www.w3.org/2000/svg", "")
    assert f'data-value="{row["deg"]!r}"' in page


@pytest.mark.parametrize("fault", ["no folder", "not processed", "no truth", "nothing in common"])
def test_what_cannot_be_compared_is_told_and_nothing_is_written(tmp_path, fault):
    real = folder_of(tmp_path / "real", lights(), lights(), methods=("ls",))
    twin, words = tmp_path / "twin", {"no folder": "is no folder", "not processed": "process the session first"}
    if fault == "not processed":
        twin.mkdir()
    elif fault == "no truth":
        folder_of(twin, lights(), lights(), methods=("ls",))
        (twin / "normals" / "truth.npy").unlink()
        words[fault] = "found no ground truth"
    elif fault == "nothing in common":
        folder_of(twin, lights(), lights(), methods=("iterative",))
        words[fault] = "no method's normals"
    with pytest.raises(SceneError, match=words[fault]):
        compare_folders(real, twin, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_method_asked_for_that_is_not_in_both_is_named(tmp_path):
    real = folder_of(tmp_path / "real", lights(), lights())
    twin = folder_of(tmp_path / "twin", lights(), lights(), methods=("ls",))
    for asked, missing in (("ls,iterativ", "iterativ"), ("ls, iterative", "iterative"), (" ,", "nothing")):
        with pytest.raises(SceneError, match=rf"--method {asked}: {missing} is not among .*Ask for ls, or process"):
            compare_folders(real, twin, tmp_path / "out", methods=asked)
    assert not (tmp_path / "out").exists()
    assert list(compare_folders(real, twin, tmp_path / "out", methods=" ls ")["methods"]) == ["ls"]


def test_the_hand_misses_the_recipe_by_what_a_hand_misses():
    setup = Setup(ring_deg=55.0, frames=400, seed=10001)
    exact, held = object_scene(setup).lights, lab_scene(setup).lights
    polar = np.degrees(np.arccos(exact.directions[:, 2]))
    assert polar == pytest.approx(np.full(400, 55.0))
    off_deg = angular_error_deg(exact.directions, held.directions)
    # Two tangent components of three degrees.
    assert np.sqrt(np.mean(off_deg**2)) == pytest.approx(3 * np.sqrt(2), rel=0.1)
    assert held.positions_mm is not None
    distance = np.linalg.norm(held.positions_mm - CENTRE_MM, axis=1)
    # One energy a flash: what is nearer shines brighter.
    power = held.intensities[:, 0] * distance**2
    assert np.std(power / power.mean()) == pytest.approx(0.03, rel=0.15)
    assert np.corrcoef(held.intensities[:, 0], distance**-2)[0, 1] > 0.9


@pytest.mark.parametrize("fold_deg", [60.0, 120.0])
def test_the_cardboard_opens_toward_the_viewer_by_its_angle(fold_deg):
    mask, truth = object_maps(Setup("cardboard", fold_deg))
    columns = np.flatnonzero(mask.any(0))
    row = np.flatnonzero(mask.any(1)).mean().astype(int)
    left, right = truth[row, columns[3]], truth[row, columns[-4]]
    assert left[0] > 0 > right[0]
    assert angular_error_deg(left, right) == pytest.approx(180 - fold_deg, abs=0.1)
    assert min(left[2], right[2]) > 0


def test_a_pair_is_made_again_when_its_setup_or_the_code_has_changed(tmp_path, monkeypatch):
    made, stopped = [], []

    def compare(real, twin, out, *, methods):
        if stopped:
            raise KeyboardInterrupt
        made.append(out.name)
        write_json(out / NUMBERS, {"made": len(made)})

    monkeypatch.setattr(pairs, "reference_balls", lambda out: [])
    monkeypatch.setattr(pairs, "process_capture", lambda folder, setup, balls: folder)
    monkeypatch.setattr(pairs, "write_rendering", lambda store, setup, name: None)
    monkeypatch.setattr(pairs, "compare_folders", compare)

    def run(**fixed):
        made.clear()
        one = Experiment("iso", "", "iso", (100.0, 400.0), "", fixed)
        ((_, found),) = pairs.run_experiments(tmp_path, (one,), tell=lambda text: None)
        assert [pair.level for pair in found] == [100.0, 400.0]
        return list(made)

    both = ["iso-100", "iso-400"]
    assert run() == both
    assert run() == []
    assert run(seed=10001) == both
    with monkeypatch.context() as patch:
        patch.setattr(pairs, "METHODS", ("ls",))
        assert run(seed=10001) == both
    with monkeypatch.context() as patch:
        patch.setattr(pairs, "code_checksum", lambda patterns: "other code")
        stopped.append(True)
        with pytest.raises(KeyboardInterrupt):
            run(seed=10001)
        stopped.clear()
        assert run(seed=10001) == both
        assert run(seed=10001) == []


def test_balls_are_told_apart_by_kind_and_side(tmp_path):
    def ball(kind, u):
        return Sphere(kind, np.array([u, 100.0]), 25.0)

    left, right, white = ball("chrome", 5.0), ball("chrome", 90.0), ball("white", 300.0)
    ordered = pairs.in_order([white, right, left], tmp_path)
    assert [(one.kind, one.center_px[0]) for one in ordered] == [("chrome", 5.0), ("chrome", 90.0), ("white", 300.0)]
    for wrong in ([left, right], [left, right, left], [left, white, white]):
        with pytest.raises(SceneError, match=r"found \d (chrome|white) balls, expected \d; no other session"):
            pairs.in_order(wrong, tmp_path)


def test_every_experiment_goes_from_easy_to_hard_in_four_steps_or_more():
    assert [one.name for one in EXPERIMENTS] == ["ambient", "cardboard", "iso", "ring"]
    for one in EXPERIMENTS:
        setups = [setup for _, setup in one.setups()]
        assert 4 <= len(set(setups)) <= 6
