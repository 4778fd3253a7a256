"""`rgbn compare REAL TWIN` on folders whose truth is known: what is told, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.compare_folders import NUMBERS, compare_folders, told
from fixtures.lit_surfaces import dome, lights_along, matte, spiral
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_npy, write_text
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from scene.store import Store
from solve.solve import solve

SIDE = 48
CAMERA = Camera(SIDE, SIDE, 400.0, 400.0, (SIDE - 1) / 2, (SIDE - 1) / 2)
NORMALS, MASK = dome(SIDE, rim=0.32)
TRUTH = np.where(MASK[..., None], NORMALS, np.nan).astype("f4")


def lights(count=10, **more):
    directions = spiral(np.cos(np.radians(20 + 35 * np.arange(count) / count)))
    return lights_along(directions, digits=2, reference_point_mm=np.array([0, 0, -800.0]), **more)


def photographed(true, truth=TRUTH, noise=0.0, seed=0):
    """A matte object under its lights."""
    grain = noise * np.random.default_rng(seed).standard_normal((len(true), SIDE, SIDE, 3))
    return Frames.from_linear(true.names, matte(true, np.nan_to_num(truth), truth, 0.7) + grain)


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
    return replace(exact, directions=unit(exact.directions + aside))


def test_two_folders_give_a_verdict_and_its_numbers(tmp_path):
    exact = lights()
    wrong = off(exact, np.random.default_rng(1), 4.0)
    real = folder_of(tmp_path / "real", wrong, exact, noise=0.01, seed=1)
    twin = folder_of(tmp_path / "twin", exact, exact, noise=0.01, seed=2, rendered=True)
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
        with pytest.raises(SceneError, match=f"--method {asked}: {missing} is unknown; .* ls. These both folders"):
            compare_folders(real, twin, tmp_path / "out", methods=asked)
    assert not (tmp_path / "out").exists()
    assert list(compare_folders(real, twin, tmp_path / "out", methods=" ls ")["methods"]) == ["ls"]
