"""`rgbn compare REAL TWIN` on folders whose truth is known: what is carried, what is told."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from compare.report.counterpart_page import badge_of
from compare.statistics.sigma_propagation import moved_lights, shifted
from experiments.compare_folders import NUMBERS, PAGE, compare_folders, open_folder, shifts_of
from fixtures.lit_surfaces import lights_along, spiral
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_json, write_npy, write_text
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from scene.store import Store
from solve.solve import solve

SIDE = 48
CAMERA = Camera(SIDE, SIDE, 400.0, 400.0, (SIDE - 1) / 2, (SIDE - 1) / 2)
V, U = np.mgrid[:SIDE, :SIDE]
X, Y = (U - CAMERA.cx) / 21, -(V - CAMERA.cy) / 21
MASK = X**2 + Y**2 < 0.9
TRUTH = np.where(MASK[..., None], np.stack([X, Y, np.sqrt(np.maximum(1 - X**2 - Y**2, 0))], -1), np.nan).astype("f4")


def lights(count=10, **more):
    directions = spiral(np.cos(np.radians(20 + 35 * np.arange(count) / count)))
    return lights_along(directions, digits=2, reference_point_mm=np.array([0, 0, -800.0]), **more)


def photographed(true, truth=TRUTH, noise=0.0, seed=0):
    """A matte object under its lights."""
    shade = np.maximum(np.einsum("hwc,fc->fhw", np.nan_to_num(truth), true.directions), 0)
    grain = noise * np.random.default_rng(seed).standard_normal((len(true), SIDE, SIDE, 3))
    return Frames.from_linear(true.names, 0.7 * shade[..., None] * np.ones(3) + grain)


def folder_of(path, told, true, *, methods=("ls", "iterative"), rendered=False, truth=TRUTH, noise=0.0, seed=0):
    """A processed folder: a matte ball, or another object, under the true lights, solved with those that were told."""
    store, frames = Store(path), photographed(true, truth, noise, seed)
    store.save_frames(frames)
    store.save_camera(CAMERA)
    store.save_lights(told)
    store.save_mask(MASK)
    if rendered:
        write_npy(store.path("truth.npy"), truth)
        write_text(store.path("session.toml"), "# Rendered by rgbn.\n")
    else:
        store.save_truth(truth, np.where(MASK, 0.1, np.nan))
    for method in methods:
        store.save_estimate(solve(method, frames, told, CAMERA, MASK))
    return path


def off(exact, rng, sigma_deg):
    aside = np.radians(sigma_deg) * rng.standard_normal(exact.directions.shape)
    aside -= np.sum(aside * exact.directions, 1, keepdims=True) * exact.directions
    known = np.full(len(exact), sigma_deg)
    return replace(exact, directions=unit(exact.directions + aside), direction_sigma_deg=known)


def test_the_lights_sigma_becomes_the_spread_that_wrong_lights_make(tmp_path):
    """What is carried, from exact lights that say they are not, against sixty sessions whose lights really are off."""
    exact, frames, stated = lights(), photographed(lights()), []
    honest = replace(exact, direction_sigma_deg=np.full(len(exact), 3.0))
    folder = open_folder(folder_of(tmp_path / "out", honest, exact, methods=("ls",)))
    for seed in range(4):
        shifts, carried = shifts_of(folder, ("ls",), seed=10000 + seed)
        assert carried["direction_sigma_deg"] == pytest.approx(3.0)
        stated += shifts["ls"][:, 1].tolist()
    found = []
    for seed in range(60):
        told = off(exact, np.random.default_rng(10000 + seed), 3.0)
        found.append(np.nanmedian(angular_error_deg(solve("ls", frames, told, CAMERA, MASK).normals, TRUTH)))
    assert np.mean(stated) == pytest.approx(np.mean(found), rel=0.15)
    assert np.std(stated) == pytest.approx(np.std(found), rel=0.25)


def test_near_lights_are_turned_and_scaled_by_their_sigmas_and_keep_their_distance():
    exact = lights()
    off_deg, relative = np.linspace(0.5, 3.0, len(exact)), np.linspace(0.2, 0.01, len(exact))
    distance = np.linspace(500.0, 1500.0, len(exact))[:, None]
    near = replace(
        exact,
        positions_mm=exact.reference_point_mm + distance * exact.directions,
        direction_sigma_deg=off_deg,
        intensity_sigma=relative,
    )
    rng = np.random.default_rng(10000)
    moved = [moved_lights(near, rng) for _ in range(600)]
    aside = np.array([angular_error_deg(one.directions, near.directions) for one in moved])
    # Two tangent components of one sigma each.
    assert np.sqrt((aside**2).mean(0)) == pytest.approx(np.sqrt(2) * off_deg, rel=0.1)
    ratio = np.array([one.intensities / near.intensities for one in moved])
    assert ratio.std(0) == pytest.approx(np.repeat(relative[:, None], 3, 1), rel=0.1)
    for one in moved[:5]:
        assert one.positions_mm is not None
        assert one.positions_mm - one.reference_point_mm == pytest.approx(distance * one.directions)


def test_the_poses_millimetres_shift_the_truth_by_as_many_pixels(tmp_path):
    """Normals that turn by the same angle from column to column: a shift is an error, known from its pixels."""
    turn = np.radians(1.0) * (U - CAMERA.cx)
    ramp = np.where(MASK[..., None], np.stack([np.sin(turn), 0 * turn, np.cos(turn)], -1), np.nan).astype("f4")
    path = folder_of(tmp_path / "out", lights(), lights(), methods=("ls",), truth=ramp)
    sigma_mm = 6.0
    write_json(path / "pose.json", {"camera_from_scan": np.eye(4), "sigma_deg": 0.0, "sigma_mm": sigma_mm})
    medians = np.concatenate([shifts_of(open_folder(path), ("ls",), seed=seed)[0]["ls"][:, 1] for seed in range(8)])
    # An rms length in three axes; 400 px of focal length at 800 mm.
    along_one = sigma_mm / np.sqrt(3) * 400 / 800
    assert np.sqrt((medians**2).mean()) == pytest.approx(along_one, rel=0.15)
    # Pixel u shows what stood at u less the shift.
    moved = shifted(ramp, 2.5, 0.0)
    inside = np.roll(MASK, 2, 1) & np.roll(MASK, 3, 1)
    here = np.degrees(np.arctan2(moved[..., 0], moved[..., 2]))[inside]
    assert here == pytest.approx((U - CAMERA.cx - 2.5)[inside], abs=0.01)
    tall = shifted(np.swapaxes(ramp, 0, 1), 0.0, -2.5)
    assert np.swapaxes(tall, 0, 1)[20, 20, 0] == pytest.approx(np.sin(np.radians(20 - CAMERA.cx + 2.5)), abs=1e-4)


def test_what_another_program_solved_is_not_carried_and_is_named(tmp_path):
    told = off(lights(), np.random.default_rng(0), 3.0)
    path = folder_of(tmp_path / "out", told, lights(), methods=("ls",))
    shutil.copy(path / "normals" / "ls.npy", path / "normals" / "Learned.npy")
    folder = open_folder(path)
    shifts, carried = shifts_of(folder, folder.methods)
    assert set(folder.methods) == {"ls", "Learned"}
    assert (set(shifts), carried["not_carried"]) == ({"ls"}, ["Learned"])


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
    wrong = off(exact, np.random.default_rng(1), 4.0)
    real = folder_of(tmp_path / "real", wrong, exact, noise=0.01, seed=1)
    twin = folder_of(tmp_path / "twin", exact, exact, noise=0.01, seed=2, rendered=True)
    found = compare_folders(real, twin, tmp_path / "out")
    kept = Store(tmp_path / "out").read_json(NUMBERS)
    for name in ("ls", "iterative"):
        error = angular_error_deg(Store(real).load_normals(name), TRUTH)
        assert kept["methods"][name]["real"]["median_deg"] == pytest.approx(np.nanmedian(error), rel=1e-5)
    page = (tmp_path / "out" / PAGE).read_text()
    assert page.count("data:image/png") == 4
    assert "://" not in page.replace("http://www.w3.org/2000/svg", "")
    row = kept["methods"]["ls"]["difference"]["median_deg"]
    assert f'data-value="{row["deg"]!r}"' in page
    # Lights off by four degrees that say so: the sigma holds the difference. That say they are exact: it does not.
    assert found["reasons"]["level"] == "not shown"
    sure = replace(wrong, direction_sigma_deg=np.full(len(wrong), 0.01))
    Store(real).save_lights(sure)
    again = compare_folders(real, twin, tmp_path / "again")
    assert (again["reasons"]["level"], again["verdict"]) == ("differ", "differ")
    assert badge_of("differ") in (tmp_path / "again" / PAGE).read_text().split("Do they fail alike?")[1][:200]


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
