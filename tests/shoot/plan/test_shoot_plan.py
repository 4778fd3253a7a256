"""A plan: its slopes by differences, its sigma by Monte Carlo, where balls stand, its page."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calibrate.lights.predicted_lights import predict_lights
from fixtures.mesh_shapes import over_grid
from scene.errors import SceneError
from scene.normals import angular_error_deg, unit
from shoot.plan.plan_options import PlanOptions
from shoot.plan.run_plan import MOST_ROWS, answer_of, plan_facts, plan_page
from shoot.plan.set_up import (
    GOOD_PX,
    before_camera,
    corner_balls,
    lens_camera,
    lights_at,
    pixels_of,
    places_in_reach,
)
from shoot.plan.shoot_plan import plan_shoot, predict
from shoot.plan.under_way import UnderWay

CAMERA = lens_camera(50.0, 36.0, (1500, 1000))
REACH = PlanOptions(flash_mm=800.0)


def planned(so_far, count):
    return plan_shoot(so_far, replace(REACH, flashes=count))


def relief():
    """A plate of 120 mm with waves of a slope of up to 35 degrees."""
    side, turns = 81, 6 * np.pi
    y, x = np.mgrid[0.5 : -0.5 : side * 1j, -0.5 : 0.5 : side * 1j]
    z = np.tan(np.radians(35)) / turns * np.sin(turns * x) * np.sin(turns * y)
    return over_grid(120 * np.stack([x, y, z], -1))


@pytest.fixture(scope="module")
def pixels():
    return pixels_of(CAMERA, before_camera(relief(), CAMERA), 120)


@pytest.fixture(scope="module")
def spheres(pixels):
    return corner_balls(pixels, 40.0)


def test_sigma_is_that_of_least_squares_under_noise_and_misplaced_lights(pixels, spheres):
    """Lights drawn from their joint covariance, samples from their noise, solved by plain least squares."""
    middle, rng = pixels.middle_mm, np.random.default_rng(0)
    positions = places_in_reach(REACH, middle, 120.0)[::5]
    known = predict_lights(CAMERA, spheres, positions, middle)
    shown = pixels.under(lights_at(positions, middle))
    predicted = predict(pixels.b, shown, known.direction_sigma_deg, known.intensity_sigma)
    assert predicted.sigma_deg.max() < 90
    flat = known.position_covariance_mm2.reshape(3 * len(positions), -1)
    errors = []
    for draw in rng.multivariate_normal(np.zeros(len(flat)), flat, 60).reshape(60, -1, 3):
        given = lights_at(positions + draw, middle).toward(pixels.points)
        samples = np.einsum("fpi,pi->fp", shown.vectors, pixels.b) + shown.noise * rng.standard_normal(shown.seen.shape)
        # Taken at a wrong place and strength, the light explains what the true one has done.
        samples = samples / (1 + known.intensity_sigma * rng.standard_normal((len(positions), 1)))
        matrix = np.einsum("fp,fpi,fpj->pij", shown.seen, given, given)
        right = np.einsum("fp,fpi,fp->pi", shown.seen, given, samples)
        found = np.linalg.solve(matrix, right[..., None])[..., 0]
        errors.append(np.radians(angular_error_deg(unit(found), pixels.normals)) ** 2)
    found = np.degrees(np.sqrt(np.mean(errors) / 2))
    assert found == pytest.approx(np.sqrt(np.mean(predicted.sigma_deg**2)), rel=0.1)


def test_a_plan_beats_the_even_dome(pixels, spheres):
    begun, middle = UnderWay(pixels, spheres), pixels.middle_mm
    lights, predicted = planned(begun, 8)
    places = places_in_reach(REACH, middle, 120.0, 8)
    known = predict_lights(CAMERA, spheres, places, middle)
    even = predict(pixels.b, pixels.under(lights_at(places, middle)), known.direction_sigma_deg, known.intensity_sigma)
    assert predicted[-1].sigma_deg.mean() < even.sigma_deg.mean()
    assert len(lights) == 8


def test_flashes_so_far_count_and_the_next_one_comes_from_elsewhere(pixels, spheres):
    middle = pixels.middle_mm
    places = places_in_reach(REACH, middle, 120.0)
    right = places[places[:, 0] > 150][:8]
    lights = lights_at(right, middle)
    sigma, unknown = np.linspace(0.5, 0.9, 8), np.full(8, np.nan)
    distant = replace(lights, positions_mm=None)
    for given, told in (
        (lights, None),
        (replace(distant, direction_sigma_deg=sigma), "by the lights' directions 0.7°"),
        (replace(distant, direction_sigma_deg=unknown), "is not known, and the error counts nothing of it"),
    ):
        so_far = UnderWay(pixels, spheres, given, pixels.under(given))
        flashes, predicted = planned(so_far, 9)
        assert flashes.positions_mm[8, 0] < 0
        if given is lights:
            assert flashes.positions_mm[:8] == pytest.approx(right)
        else:
            # No ball tells the places of distant lights: the next one is as well known as those before.
            assert told in answer_of(plan_facts(so_far, flashes, predicted))
            assert (predicted[-1].by_lights_deg > 0) == (given.direction_sigma_deg is sigma)


def test_a_session_that_has_all_its_flashes_is_told_what_one_more_brings(pixels, spheres):
    """Balls whose size nobody stated are in no drawing."""
    middle = pixels.middle_mm
    given = lights_at(places_in_reach(REACH, middle, 120.0)[::6], middle)
    for some in (spheres, [replace(sphere, diameter_mm=None) for sphere in spheres]):
        so_far = UnderWay(pixels, some, given, pixels.under(given))
        flashes, predicted = planned(so_far, 4)
        assert len(flashes) == len(given) + 1
        facts = plan_facts(so_far, flashes, predicted) | {"name": "a"}
        assert "Next: " in answer_of(facts)
        assert len(facts["balls"]) == (len(spheres) if some is spheres else 0)
        assert ("none is of known diameter" in plan_page(facts)) == (not facts["balls"])


def test_balls_stand_whole_in_the_picture_beside_the_object_and_apart(pixels, spheres):
    outline = CAMERA.project(pixels.mesh.vertices)
    for number, sphere in enumerate(spheres):
        places = sphere.outline(CAMERA)
        assert (places > 0).all()
        assert (places < [CAMERA.width - 1, CAMERA.height - 1]).all()
        assert np.linalg.norm(outline - sphere.center_px, axis=1).min() > sphere.radius_px
        for other in spheres[:number]:
            assert np.hypot(*(sphere.center_px - other.center_px)) > sphere.radius_px + other.radius_px
        assert sphere.center_mm(CAMERA)[2] == pytest.approx(pixels.table_mm + 20.0)
    with pytest.raises(SceneError, match="no room in the picture"):
        corner_balls(pixels, 300.0)
    assert corner_balls(pixels, None)[0].radius_px >= GOOD_PX


@pytest.mark.full
def test_the_page_says_what_the_plan_says_on_one_sheet(pixels, spheres, chromium):
    begun = UnderWay(pixels, spheres)
    facts = plan_facts(begun, *planned(begun, 6)) | {"name": "<cup & saucer>"}
    page = plan_page(facts)
    assert "&lt;cup &amp; saucer&gt;" in page
    assert "<script" not in page
    assert f"{facts['error_median_deg']:.2g}°" in page
    assert "shadows left out" in page
    assert "<th></th>" not in page, "a column without any value is left out"
    facts["flashes"] = [{**facts["flashes"][-1], "number": n} for n in range(1, MOST_ROWS + 20)]
    browser = chromium.new_page()
    browser.set_content(plan_page(facts))
    printed = browser.pdf(format="A4", prefer_css_page_size=True)
    browser.close()
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
