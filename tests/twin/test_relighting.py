"""How well a twin foretells frames that it was not fitted to: the score's laws, and a scene whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from scene.errors import RenderError
from scene.frames import Frames
from scene.mesh import Mesh
from tests.twin.test_fit_material import RADIUS, SIDE, WHITE, ball, dome
from twin.description.description import Sampling
from twin.engines.variant import import_mitsuba
from twin.material.reflection_models import coat, reflected
from twin.relighting import FEWEST, MASKS, relighting, score
from twin.visibility import Sight

LIGHTS = dome(16)


def photographs(lights=LIGHTS, roughness=0.3, specularity=0.4) -> np.ndarray:
    """Return images (F, H, W, 3) of a glossy ball by the formula, its albedo rising to the right; black beyond."""
    _, mask, normals = ball()
    rows, columns = np.nonzero(mask)
    toward = np.broadcast_to(lights.directions, (len(rows), len(lights), 3)).astype(np.float32)
    views = np.broadcast_to(np.array([0, 0, 1], np.float32), (len(rows), 3))
    body, gloss = reflected(coat(roughness), normals[mask], views, toward)
    albedo = WHITE * (0.2 + 0.4 * columns / SIDE)[:, None, None]
    values = albedo * body[..., None] + specularity * WHITE * gloss[..., None]
    lit = np.einsum("pi,fi->pf", normals[mask], lights.directions) > 0
    images = np.zeros((len(lights), SIDE, SIDE, 3), np.float32)
    images[:, rows, columns] = np.where(lit[..., None], values, 0).transpose(1, 0, 2)
    return images


@pytest.fixture(scope="module")
def seen():
    import trimesh

    camera, mask, normals = ball()
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    return Sight(Mesh(np.array(sphere.vertices), np.array(sphere.faces)), camera, LIGHTS, normals), mask


def scored(seen, guess, images=None):
    sight, mask = seen
    images = 0.5 * photographs() if images is None else images
    return score(sight, Frames.from_linear(LIGHTS.names, images), Frames.from_linear(LIGHTS.names, guess), mask)


def test_photographs_that_are_foretold_exactly_score_so(seen):
    rmse, decibels = scored(seen, 0.5 * photographs())
    assert set(rmse) == set(MASKS)
    assert max(rmse.values()) == 0
    assert min(decibels.values()) == pytest.approx(120)


def test_decibels_do_not_depend_on_the_exposure_of_photographs_and_guess(seen):
    noise = 0.01 * np.random.default_rng(3).standard_normal((len(LIGHTS), SIDE, SIDE, 3)).astype(np.float32)
    bright, dark = (scored(seen, s * (photographs() + noise), s * photographs())[1] for s in (0.6, 0.2))
    assert bright == pytest.approx(dark, abs=0.1)


def test_each_score_judges_its_own_pixels(seen):
    sight, mask = seen
    images = 0.5 * photographs()
    # In the attached shadow, farther from its border than the mesh's faces lean: neither lit nor fitted to.
    dark = mask & (np.einsum("hwi,fi->fhw", np.nan_to_num(sight.normals), LIGHTS.directions) < -0.05)
    assert dark.any()
    rmse = scored(seen, images + 0.1 * dark[..., None].astype(np.float32))[0]
    assert rmse["fitted"] == 0
    assert rmse["lit"] < 0.01 < 0.02 < rmse["whole"]
    # Near the outline: lit, and no sample of the fit.
    camera, inside, _ = ball()
    offset = camera.grid() - (SIDE - 1) / 2
    rim = inside & (np.hypot(*np.moveaxis(offset, -1, 0)) > 25)
    rmse = scored(seen, images * (1 + 0.5 * rim[..., None].astype(np.float32)))[0]
    assert rmse["fitted"] == 0
    assert rmse["lit"] > 0.01


def test_some_lights_are_as_they_were():
    some = LIGHTS.only(slice(1, None, 2))
    assert some.names == LIGHTS.names[1::2]
    np.testing.assert_array_equal(some.directions, LIGHTS.directions[1::2])
    np.testing.assert_array_equal(some.intensities, LIGHTS.intensities[1::2])
    assert some.flags == LIGHTS.flags[1::2]
    np.testing.assert_array_equal(some.white_value, LIGHTS.white_value)


def test_too_few_frames_foretell_nothing(seen):
    sight, mask = seen
    few = slice(0, FEWEST - 1)
    frames = Frames.from_linear(LIGHTS.names, photographs()).only(few)
    sight = replace(sight, lights=sight.lights.only(few))
    with pytest.raises(RenderError, match="7 frames; 8 or more"):
        relighting(sight, frames, mask, Sampling(), lambda scene: pytest.fail("rendered"))


@pytest.mark.full
@pytest.mark.render
def test_what_is_made_of_the_fitted_kind_is_foretold_and_a_light_that_lies_is_not(seen):
    from twin.engines.render import render_scene

    import_mitsuba()
    sight, mask = seen
    asked = []

    def render(scene):
        asked.append(scene.lights.names)
        return render_scene(scene).frames

    sampling = Sampling("many", error=0.005)
    images = 0.5 * photographs()
    found = relighting(sight, Frames.from_linear(LIGHTS.names, images), mask, sampling, render)
    assert asked == [found.predicted] == [LIGHTS.names[1::2]]
    assert found.fitted == LIGHTS.names[::2]
    assert found.relative_rmse["fitted"] < 0.02
    assert found.relative_rmse["lit"] < 0.05
    assert found.psnr_db["linear"] > 35
    # The frames that are foretold, and they alone, were taken by another light than is said.
    turned = LIGHTS.directions @ np.array([[0.985, 0, 0.174], [0, 1, 0], [-0.174, 0, 0.985]])
    images[1::2] = 0.5 * photographs(replace(LIGHTS, directions=turned))[1::2]
    wrong = relighting(sight, Frames.from_linear(LIGHTS.names, images), mask, sampling, render)
    assert wrong.relative_rmse["fitted"] > 3 * found.relative_rmse["fitted"]
    facts = wrong.facts()
    assert facts["relative_rmse_lit"] == wrong.relative_rmse["lit"]
    assert {"psnr_linear_db", "psnr_hdr_db", "relative_rmse_whole", "predicted"} <= facts.keys()
    assert "foretells the other 8" in str(wrong)
