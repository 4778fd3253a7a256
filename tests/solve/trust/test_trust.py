"""Errors predicted from photographs: a bowl that lights itself, whose photographs are known exactly."""

import numpy as np
import pytest

from fixtures.lit_surfaces import even_cap, lights_along
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.problem import Problem
from solve.solve import solve
from solve.trust.answer_world import Material, world_of
from solve.trust.held_out import unexplained
from solve.trust.joined_estimate import estimate_of
from solve.trust.trust import trust

SIZE, RIM, WHITE, REFLECTANCE = 48, 0.75, 0.7, 0.6
CAMERA = Camera(SIZE, SIZE, SIZE / 2, SIZE / 2, SIZE / 2 - 0.5, SIZE / 2 - 0.5, projection="orthographic")


@pytest.fixture(scope="module")
def bowl():
    """Frames, lights, mask and true normals (H, W, 3) of a matte bowl, light from wall to wall included.

    In a sphere any two places see each other alike: a bowl that is the share s of it has the radiosity
    rho (E + s B), B = mean E rho / (1 - rho s) being its mean.
    """
    base, _ = CAMERA.rays(CAMERA.grid())
    across = base[..., :2]
    mask = np.sum(across**2, -1) < RIM**2
    height = np.sqrt(np.maximum(1 - np.sum(across**2, -1), 0))
    normals = np.concatenate([-across, height[..., None]], -1)
    directions = even_cap(16, 35.0)
    direct = normals[mask] @ directions.T
    assert direct.min() > 0.01
    share = (1 - np.sqrt(1 - RIM**2)) / 2
    mean = np.average(direct, axis=0, weights=1 / normals[mask][:, 2])
    shown = WHITE * REFLECTANCE * (direct + share * REFLECTANCE * mean / (1 - REFLECTANCE * share))
    images = np.zeros((len(directions), SIZE, SIZE, 3))
    images[:, mask] = shown.T[..., None]
    lights = lights_along(directions, white_value=np.full(3, 0.8 * WHITE))
    truth = np.where(mask[..., None], normals, np.nan)
    return Frames.from_linear(lights.names, images), lights, mask, truth


def problem_of(frames: Frames, lights: Lights, mask) -> Problem:
    return Problem(frames, lights, CAMERA, mask, slice(0, SIZE))


def test_the_true_normals_predict_the_photographs(bowl):
    frames, lights, mask, truth = bowl
    world = world_of(truth, Material.of(problem_of(frames, lights, mask)))
    assert world.unexplained < 0.02
    # A ninth of the light has come by way of the walls.
    share = np.sum(world.albedo[:, None] * world.thrown) / np.sum(world.predicted)
    assert share == pytest.approx(0.12, abs=0.03)
    dark = Material.of(problem_of(frames, lights, mask))
    without = world_of(truth, Material(dark.problem, dark.depth_mm, dark.shared, 1e6))
    assert without.unexplained > 2 * world.unexplained


@pytest.mark.full
def test_errors_of_all_methods_are_foretold_and_taken_off(bowl):
    frames, lights, mask, truth = bowl
    names = ("ls", "iterative", "l1", "position", "tv")
    answers = {name: solve(name, frames, lights, CAMERA, mask).normals for name in names}
    true = {name: float(np.nanmean(angular_error_deg(normals, truth))) for name, normals in answers.items()}
    # All methods take the bowl for a shallower one, and agree with each other.
    assert min(true.values()) > 2.4
    assert np.nanmean(angular_error_deg(answers["ls"], answers["iterative"])) < 0.5
    judged = trust(frames, lights, CAMERA, mask, answers)
    for name in names:
        assert judged.methods[name].mean_deg == pytest.approx(true[name], rel=0.35)
        error, predicted = angular_error_deg(answers[name], truth), judged.predicted_deg(answers[name])
        known = np.isfinite(error) & np.isfinite(predicted)
        assert np.mean(error[known] <= 2 * predicted[known]) > 0.9
    assert true[judged.recommended] < 1.05 * min(true.values())
    assert (judged.methods["tv"].explains or 0) > 3
    assert np.nanmean(angular_error_deg(judged.best, truth)) < 0.5 * min(true.values())
    assert set(np.unique(judged.won[~mask])) == {255}
    found = estimate_of(judged, frames, lights, CAMERA, mask)
    assert found.method == "best"
    np.testing.assert_allclose(found.normals[mask], judged.best[mask], atol=1e-5)


def test_normals_that_foretell_other_frames_explain_more(bowl):
    frames, lights, mask, truth = bowl
    problem = problem_of(frames, lights, mask)
    flat = np.where(mask[..., None], [0.0, 0.0, 1.0], np.nan)
    given = {"true": truth, "flat": flat, "none": np.full_like(flat, np.nan)}
    gaps = unexplained(problem, Material.of(problem), list(given), lambda name, _: given[name])
    assert gaps["true"] < 0.05 < gaps["flat"] < gaps["none"]


def test_without_lights_errors_are_not_predicted(bowl):
    frames, lights, mask, truth = bowl
    with pytest.raises(SceneError, match=r"trust: .* lights; found none"):
        trust(frames, Lights.unknown(lights.names), CAMERA, mask, {"iterative": truth})
    with pytest.raises(SceneError, match=r"only tv\. Add iterative"):
        trust(frames, lights, CAMERA, mask, {"tv": truth})
