"""The photographs as judge: a glossy dome whose best method is known, lights of another, what cannot be told."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, dome, even_cap, gloss, lights_along, matte
from scene.camera import Camera
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.solve import solve
from solve.trust import LIMIT, trust

SIZE, COUNT = 40, 14
CAMERA = Camera.orthographic(SIZE, SIZE)


@pytest.fixture(scope="module")
def glossy():
    """Frames, lights, mask and true normals (H, W, 3) of a dome with gloss, shadowed at its foot."""
    normals, mask = dome(SIZE, radius=0.5, rim=0.45)
    lights = lights_along(even_cap(COUNT, 45.0))
    images = matte(lights, normals, normals, 0.5) + 0.3 * gloss(normals, lights.directions, 40)[..., None]
    images += np.random.default_rng(3).normal(0, 0.002, (COUNT, SIZE, SIZE, 1))
    return as_floats(lights, images), lights, mask, normals


@pytest.fixture(scope="module")
def answers(glossy):
    """Each method's normals, and those of another program, which are flat."""
    frames, lights, mask, _ = glossy
    found = {name: solve(name, frames, lights, CAMERA, mask).normals for name in ("ls", "iterative", "hsh")}
    return {**found, "Flat": np.where(mask[..., None], [0.0, 0.0, 1.0], np.nan)}


def test_the_method_that_errs_least_is_recommended_and_the_others_follow(glossy, answers):
    frames, lights, mask, normals = glossy
    true = {name: np.nanmean(angular_error_deg(found, normals)[mask]) for name, found in answers.items()}
    judged = trust(frames, lights, CAMERA, mask, answers)
    assert list(judged.methods) == sorted(true, key=lambda name: true[name])
    assert judged.recommended == "iterative"
    assert judged.methods["iterative"].apart_deg < 1e-3
    assert judged.methods["Flat"].unexplained is None
    assert judged.relative_rmse < LIMIT
    assert not judged.doubts
    error = angular_error_deg(answers["iterative"], normals)[mask]
    assert np.mean(error < 2 * judged.sigma_deg[mask]) > 0.9
    farther = angular_error_deg(answers["hsh"], answers["iterative"])[mask]
    assert np.median(judged.sigma_deg[mask]) < 1.5 * np.median(farther), "not by being large"
    assert np.isnan(judged.sigma_deg[~mask]).all()
    assert np.isfinite(judged.sigma_deg[mask]).all(), "as the nearest judged pixel has it"


@pytest.mark.full
def test_lights_that_are_anothers_are_doubted(glossy, answers):
    frames, lights, mask, _ = glossy
    rolled = Lights(lights.names, np.roll(lights.directions, 3, axis=0), lights.intensities)
    judged = trust(frames, rolled, CAMERA, mask, {"iterative": answers["iterative"]})
    assert judged.relative_rmse > LIMIT
    assert "not to be believed" in judged.doubts[0]


def test_without_lights_methods_of_ours_or_frames_nothing_is_judged(glossy, answers):
    frames, lights, mask, _ = glossy
    with pytest.raises(SceneError, match=r"calibrated lights; found none"):
        trust(frames, Lights.unknown(lights.names), CAMERA, mask, answers)
    with pytest.raises(SceneError, match="found none"):
        trust(frames, lights, CAMERA, mask, {"Flat": answers["Flat"]})
    with pytest.raises(SceneError, match="found 5 frames"):
        trust(frames.only(slice(5)), lights.only(slice(5)), CAMERA, mask, answers)
