"""Materials fitted to samples made here, by the formula and the renderer; what the twin has of them, and predicts."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import ball_seen, lights_along, spiral
from fixtures.mesh_shapes import ball as mesh_of_ball
from fixtures.mesh_shapes import over_grid
from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import Frames
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.spheres import WHITE_BALL_ALBEDO
from tests.twin.twin_scenes import NEEDS_LLVM, placed
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.object_mesh import built_in
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.render import render_scene
from twin.engines.variant import import_mitsuba
from twin.material.fit_material import fit_material
from twin.material.material_samples import samples_of_scan
from twin.material.measured_albedo import textured_surface
from twin.material.reflection_models import coat, matte, reflected
from twin.material.scan_material import scan_material
from twin.relighting import FEWEST, MASKS, relighting, score
from twin.scan_scene import scan_scene
from twin.visibility import Sight

SIDE, RADIUS = 64, 27.0
WHITE = np.array([0.5, 0.6, 0.4])


def dome(count, white=WHITE):
    return lights_along(
        spiral(1 - 0.45 * (np.arange(count) + 0.5) / count), white_value=None if white is None else 0.8 * white
    )


def ball():
    """Return an orthographic camera, the mask and the normals (H, W, 3) of a ball."""
    camera = Camera.orthographic(SIDE, SIDE)
    _, normals, inside = ball_seen(camera, (0, 0, -SIDE), RADIUS, rim=0)
    return camera, inside, np.where(inside[..., None], normals, np.nan).astype(np.float32)


def sight_of_ball(lights):
    camera, mask, normals = ball()
    sphere = built_in("sphere")
    frames = Frames.from_linear(lights.names, np.zeros((len(lights), SIDE, SIDE, 3), np.float32))
    return Sight(Mesh(RADIUS * sphere.vertices, sphere.faces), camera, lights, normals), frames, mask


def made(roughness, specularity, lights, *, noise=1e-3, **shape):
    """Return a ball's samples by the formula, of an albedo that changes from pixel to pixel; `shape`: of the coat."""
    samples = samples_of_scan(*sight_of_ball(lights))
    samples = samples._replace(spread=0 * samples.spread)
    surface = matte() if roughness is None else coat(roughness, **shape)
    body, gloss = reflected(surface, samples.normals, samples.views, samples.toward)
    generator = np.random.default_rng(10_030)
    albedo = WHITE * generator.uniform(0.1, 0.8, (len(samples.rows), 1, 1))
    values = samples.irradiance * (albedo * body[..., None] + specularity * WHITE * gloss[..., None])
    return samples._replace(values=(values + noise * generator.standard_normal(values.shape)).astype(np.float32))


@pytest.mark.full
@pytest.mark.parametrize(
    ("count", "roughness", "specularity", "shape", "told"),
    [
        (24, 0.1, 1.0, {}, "BIC falls"),
        (24, 0.6, 0.8, {}, "BIC falls"),
        # It was taken for a coat of roughness 1 and many times the strength that a coat can have.
        (16, None, 0.0, {"body": 0.9}, "more with a rough body"),
        (16, None, 0.3, {"body": 0.5}, "more with a rough body"),
    ],
)
def test_a_material_comes_back(count, roughness, specularity, shape, told):
    lights = dome(count)
    fit = fit_material(made(roughness or 0.3, specularity, lights, **shape), lights)
    assert fit.model == "rough plastic"
    assert told in str(fit)
    assert "nan" not in str(replace(fit, roughness_sigma=np.nan, specularity_sigma=np.nan))
    if roughness is None:
        assert abs(fit.surface.body - shape["body"]) < 0.03
        assert abs(fit.specularity - specularity) < 0.03
        return
    assert abs(fit.surface.roughness / roughness - 1) < 0.01
    assert abs(fit.specularity / specularity - 1) < 0.015
    assert not fit.warnings


@pytest.mark.full
@pytest.mark.parametrize("roughness", [0.1, 0.3])
def test_a_metal_comes_back(roughness):
    """It was taken for a coat on a rough body that left half of the photographs."""
    lights = dome(14)
    samples = made(roughness, 0.0, lights, is_metal=True)
    fit = fit_material(samples, lights)
    assert fit.model == "metal"
    assert abs(fit.surface.roughness / roughness - 1) < 0.01
    assert "more with a metal" in str(fit)
    assert "nan" not in str(fit)


@pytest.mark.full
def test_what_no_coat_does_is_said_and_a_matte_ball_gets_none():
    lights = dome(12)
    brighter = fit_material(made(0.25, 1.4, lights), lights)
    assert abs(brighter.specularity / 1.4 - 1) < 0.01
    assert any("1.40 times those of a full coat" in text for text in brighter.warnings)
    smooth = fit_material(made(0.01, 0.5, lights), lights)
    assert any(text.startswith("The roughness ran to 0.02") for text in smooth.warnings)
    plain = fit_material(made(None, 0.0, lights), lights)
    assert (plain.model, plain.specularity, "BIC" in str(plain)) == ("matte", 0, True)


@pytest.mark.full
def test_errors_are_what_sigma_says_and_outliers_do_not_count():
    lights = dome(24)
    fit = fit_material(made(0.3, 0.4, lights, noise=0.02), lights)
    assert fit.roughness_sigma > 1e-4
    assert abs(np.log(fit.surface.roughness / 0.3)) < 4 * fit.roughness_sigma
    assert abs(np.log(fit.specularity / 0.4)) < 4 * fit.specularity_sigma
    samples = made(0.2, 0.5, lights)
    values = samples.values.copy()
    values[::15] *= 0.3
    fit = fit_material(samples._replace(values=values), lights)
    assert abs(fit.surface.roughness / 0.2 - 1) < 0.02
    assert abs(fit.specularity / 0.5 - 1) < 0.02


@pytest.mark.full
def test_a_white_value_that_is_unknown_leaves_the_channels_free():
    lights = dome(16, white=None)
    fit = fit_material(made(0.2, 0.5, lights), lights)
    np.testing.assert_allclose(fit.strength, 0.5 * WHITE, rtol=0.01)
    assert any("white" in text for text in fit.warnings)


def test_too_few_pixels_are_named():
    sight, frames, mask = sight_of_ball(dome(8))
    with pytest.raises(RenderError, match="expected 100 or more"):
        samples_of_scan(sight, frames, mask & (np.arange(SIDE) < 12))


@pytest.mark.full
@pytest.mark.render
@NEEDS_LLVM
def test_a_rendered_ball_tells_its_material_and_its_shadow_does_not_count():
    """And its facets go along into the twin, whose material is that of the object."""
    import_mitsuba()
    lights, camera = dome(12), Camera(120, 100, 260.0, 260.0, 59.3, 50.8)
    objects = (placed("large", "sphere", "plastic", 25.0, (0, 0, 100)),
               placed("small", "sphere", "plastic", 8.0, (20, 8, 122)))  # fmt: skip
    scene = TwinScene(camera, objects, {"plastic": RoughPlastic((0.5, 0.3, 0.2), 0.25, 0.6)}, lights)
    film = scene.film()
    many = Many(mitsuba_scene(scene), film, lights, max_depth=2)
    images = film.whole(many.band(slice(0, film.size[0]), 64)[0])
    frames, mask = Frames.from_linear(lights.names, images), images.max((0, -1)) > 0
    (first, second), count = (one.placed for one in objects), len(objects[0].mesh.vertices)
    mesh = Mesh(np.concatenate([first.vertices, second.vertices]), np.concatenate([first.faces, second.faces + count]))
    sight = Sight(mesh, camera, lights)
    fit = fit_material(samples_of_scan(sight, frames, mask), lights)
    assert abs(fit.surface.roughness / 0.25 - 1) < 0.02
    assert abs(fit.specularity / 0.6 - 1) < 0.02
    whole = scan_material(sight, frames, mask)
    albedo = whole.albedo[np.isfinite(whole.albedo).all(-1)]
    assert len(albedo) > 0.5 * mask.sum()
    np.testing.assert_allclose(np.median(albedo, 0), WHITE * [0.5, 0.3, 0.2], rtol=0.02)
    assert 0 < whole.onward_share < 0.1
    (made_of,) = scan_scene(sight, whole.albedo, Sampling(), fit=fit)[0].materials.values()
    assert isinstance(made_of, RoughPlastic)
    assert made_of.roughness == fit.surface.roughness


CAMERA = Camera(80, 80, 240.0, 240.0, 39.5, 39.5)


def bowl(half: float = 30.0, pieces: int = 48) -> Mesh:
    """Return a hollow that opens toward the camera, its rim 24 mm nearer than its middle at the sides."""
    line = np.linspace(-half, half, pieces + 1)
    across, up = np.meshgrid(line, line, indexing="ij")
    return over_grid(np.stack([across, up, 0.8 * (across**2 + up**2) / half - 280], -1))


@pytest.mark.render
@pytest.mark.full
@NEEDS_LLVM
@pytest.mark.parametrize("share", [0.0, 0.15, 0.5])
def test_light_that_a_hollow_throws_on_itself_and_the_rooms_are_in_the_twin_and_not_in_the_albedo(share: float) -> None:
    """The hollow's was in both, and the room's in the albedo alone, which was 10 degrees worse than the twin."""
    mesh, room = bowl(), share * np.array([1.0, 0.8, 1.2]) * WHITE
    colour = (0.3, 0.5, 0.6) if share else (0.6, 0.6, 0.6)
    lights = replace(dome(12), ambient=room * WHITE_BALL_ALBEDO, white_value=WHITE_BALL_ALBEDO * WHITE)
    one = TwinObject("bowl", Mesh(mesh.vertices, mesh.faces), "matte")
    environment, sampling = Environment(ambient=tuple(room)), Sampling("many", max_depth=4, error=0.004)
    scene = TwinScene(CAMERA, (one,), {"matte": Diffuse(colour)}, lights, environment=environment, sampling=sampling)
    frames, sight = render_scene(scene).frames, Sight(mesh, CAMERA, lights)
    mask = frames.read().max((0, -1)) > 0
    found = scan_material(sight, frames, mask)
    # All of the mask has an albedo of its own, the outline too.
    assert np.isfinite(found.albedo[mask]).mean() > 0.95
    off = found.albedo / (colour * WHITE) - 1
    assert np.nanmedian(np.abs(off)) < 0.06
    middle = mask & (np.hypot(*(CAMERA.grid() - 39.5).transpose(2, 0, 1)) < 10)
    assert abs(np.nanmedian(off[middle])) < 0.08
    assert share or found.onward_share > 0.15
    twin = scan_scene(sight, found.albedo, scene.sampling, fit=found.fit)[0]
    again, inner = render_scene(twin).frames.read()[:, mask], frames.read()[:, mask]
    assert np.linalg.norm(again - inner) < 0.05 * np.linalg.norm(inner)


def test_a_room_darker_than_the_renderings_error_is_left_out() -> None:
    camera, mask, normals = ball()
    mesh = mesh_of_ball(RADIUS, 3)
    albedo = np.where(mask[..., None], np.float32(0.4), np.float32(np.nan)) * np.ones(3, np.float32)
    for ambient, is_dark in ((None, True), (np.full(3, 0.004), True), (np.full(3, 0.1), False)):
        lights = replace(dome(12), ambient=ambient, white_value=np.full(3, WHITE_BALL_ALBEDO))
        sight = Sight(mesh, camera, lights, normals)
        assert scan_scene(sight, albedo, Sampling(error=0.01))[0].environment.is_dark is is_dark


def test_the_twin_has_the_pictures_normals_where_it_is_seen_and_its_own_elsewhere() -> None:
    camera, mask, normals = ball()
    mesh = mesh_of_ball(RADIUS, 3)
    # The picture's lean by 5 degrees to the right of what the mesh has; on its left half they are unknown.
    turn = np.radians(5)
    leaning = normals @ np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    leaning[:, : SIDE // 2] = np.nan
    albedo = np.where(mask[..., None], np.full(3, 0.3, np.float32), np.float32(np.nan))
    box = slice(0, SIDE), slice(0, SIDE)
    made, _, _, _ = textured_surface(Sight(mesh, camera, dome(8), leaning.astype(np.float32)), albedo, *box)
    off = angular_error_deg(made.normals, made.vertices / np.linalg.norm(made.vertices, axis=1, keepdims=True))
    x, _, z = made.vertices.T / RADIUS
    right = (x > 0.1) & (z > 0.3)
    assert right.sum() > 50
    assert abs(off[right] - 5 * np.sqrt(1 - made.vertices[right, 1] ** 2 / RADIUS**2)).max() < 0.7
    assert off[(x < -0.1) | (z < -0.2)].max() < 0.7
    lean = np.degrees(np.arctan2(made.normals[:, 0], made.normals[:, 2]) - np.arctan2(x, z))
    assert (lean[right] > 3).all()


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
