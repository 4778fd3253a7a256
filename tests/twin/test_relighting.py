"""How well a twin predicts frames that it was not fitted to: the score's laws, and a scene whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from scene.errors import RenderError
from scene.frames import Frames
from tests.twin.test_fit_material import SIDE, WHITE, ball, dome, sight_of_ball
from twin.description.description import Sampling
from twin.engines.render import render_scene
from twin.engines.variant import import_mitsuba
from twin.material.reflection_models import coat, reflected
from twin.relighting import FEWEST, MASKS, relighting, score

LIGHTS = dome(16)


def photographs(lights=LIGHTS):
    """Return images (F, H, W, 3) of a glossy ball by the formula, its albedo rising to the right; black beyond."""
    _, mask, normals = ball()
    rows, columns = np.nonzero(mask)
    toward = np.broadcast_to(lights.directions, (len(rows), len(lights), 3)).astype(np.float32)
    views = np.broadcast_to(np.array([0, 0, 1], np.float32), (len(rows), 3))
    body, gloss = reflected(coat(0.3), normals[mask], views, toward)
    albedo = WHITE * (0.2 + 0.4 * columns / SIDE)[:, None, None]
    values = 0.5 * (albedo * body[..., None] + 0.4 * WHITE * gloss[..., None])
    lit = np.einsum("pi,fi->pf", normals[mask], lights.directions) > 0
    images = np.zeros((len(lights), SIDE, SIDE, 3), np.float32)
    images[:, rows, columns] = np.where(lit[..., None], values, 0).transpose(1, 0, 2)
    return images


def scored(guess, images):
    sight, _, mask = sight_of_ball(LIGHTS)
    return score(sight, Frames.from_linear(LIGHTS.names, images), Frames.from_linear(LIGHTS.names, guess), mask)


def test_photographs_that_are_predicted_exactly_score_so_and_the_exposure_does_not_count():
    images = photographs()
    rmse = scored(images, images)
    assert set(rmse) == set(MASKS)
    assert max(rmse.values()) == 0
    noise = 0.005 * np.random.default_rng(3).standard_normal(images.shape).astype(np.float32)
    bright, dark = (scored(s * (images + noise), s * images)["whole"] for s in (1.2, 0.4))
    assert bright == pytest.approx(dark, rel=0.01)


def test_each_score_judges_its_own_pixels():
    (sight, _, mask), images = sight_of_ball(LIGHTS), photographs()
    # In the attached shadow, farther from its border than the mesh's faces lean: neither lit nor fitted to.
    dark = mask & (np.einsum("hwi,fi->fhw", np.nan_to_num(sight.normals), LIGHTS.directions) < -0.05)
    assert dark.any()
    rmse = scored(images + 0.1 * dark[..., None].astype(np.float32), images)
    assert rmse["fitted"] == 0
    assert rmse["lit"] < 0.01 < 0.02 < rmse["whole"]
    # Near the outline: lit, and no sample of the fit.
    rim = mask & (np.linalg.norm(sight.camera.grid() - (SIDE - 1) / 2, axis=-1) > 25)
    rmse = scored(images * (1 + 0.5 * rim[..., None].astype(np.float32)), images)
    assert rmse["fitted"] == 0
    assert rmse["lit"] > 0.01


def test_too_few_frames_predict_nothing():
    few = LIGHTS.only(slice(0, FEWEST - 1))
    with pytest.raises(RenderError, match="7 frames; 8 or more"):
        relighting(*sight_of_ball(few), Sampling(), lambda scene: pytest.fail("rendered"))


@pytest.mark.full
@pytest.mark.render
def test_what_is_made_of_the_fitted_kind_is_predicted_and_a_light_that_lies_is_not():
    import_mitsuba()
    (sight, _, mask), images, asked = sight_of_ball(LIGHTS), photographs(), []

    def render(scene):
        asked.append(scene.lights.names)
        return render_scene(scene).frames

    def predicted():
        frames = Frames.from_linear(LIGHTS.names, images)
        return relighting(sight, frames, mask, Sampling("many", error=0.005), render)

    found = predicted()
    assert asked == [found.predicted] == [LIGHTS.names[1::2]]
    assert found.fitted == LIGHTS.names[::2]
    assert found.relative_rmse["fitted"] < 0.02
    assert found.relative_rmse["lit"] < 0.05
    # The frames that are predicted, and they alone, were taken by another light than is said.
    turned = LIGHTS.directions @ np.array([[0.985, 0, 0.174], [0, 1, 0], [-0.174, 0, 0.985]])
    images[1::2] = photographs(replace(LIGHTS, directions=turned))[1::2]
    wrong = predicted()
    assert wrong.relative_rmse["fitted"] > 3 * found.relative_rmse["fitted"]
    assert wrong.facts()["relative_rmse_lit"] == wrong.relative_rmse["lit"]
    assert {"relative_rmse_whole", "predicted"} <= wrong.facts().keys()
    assert "predicts the other 8" in str(wrong)
