"""A plan: its slopes by differences, its sigma by Monte Carlo, when it stops, where balls stand."""

import re
from dataclasses import replace

import numpy as np
import pytest

from scene.errors import SceneError
from scene.normals import angular_error_deg, unit
from shoot.plan.ball_places import GOOD_PX, best_balls, light_sigmas, stand_balls
from shoot.plan.flash_places import places_in_reach
from shoot.plan.flash_samples import lights_at, pixels_of
from shoot.plan.plan_facts import brief, clock, plan_facts
from shoot.plan.plan_options import PlanOptions
from shoot.plan.plan_page import MOST_ROWS, plan_page
from shoot.plan.set_up import SetUp, before_camera, lens_camera, simple_shape
from shoot.plan.shoot_plan import (
    enough,
    joint_covariance,
    light_slopes,
    plan_shoot,
    predict,
)
from shoot.plan.under_way import UnderWay

CAMERA = lens_camera(50.0, 36.0, (1500, 1000))
REACH = PlanOptions(flash_mm=800.0)


def planned(pixels, spheres, count, *, so_far=None, accuracy_deg=None):
    options = replace(REACH, flashes=count, accuracy_deg=accuracy_deg)
    return plan_shoot(pixels, spheres, options, so_far=so_far)


@pytest.fixture(scope="module")
def pixels():
    return pixels_of(SetUp(CAMERA, before_camera(simple_shape("relief", 120.0), CAMERA, None)[0]), 120)


@pytest.fixture(scope="module")
def spheres(pixels):
    places = places_in_reach(REACH, pixels.set_up.middle_mm, 120.0)
    return stand_balls(pixels.set_up, places, [("chrome", 40.0)] * 3 + [("white", 40.0)])


def test_slopes_are_those_of_the_light_vectors(pixels):
    middle = pixels.set_up.middle_mm
    positions = places_in_reach(REACH, middle, 120.0)[:5]

    def values(positions):
        return np.einsum("fpi,pi->fp", lights_at(positions, middle).toward(pixels.points), pixels.b)

    slopes = light_slopes(positions, middle, pixels.points, pixels.b)
    for axis in range(3):
        step = 0.01 * np.eye(3)[axis]
        change = (values(positions + step) - values(positions - step)) / 0.02
        assert slopes[..., axis] == pytest.approx(change, rel=1e-4, abs=1e-9)
    assert slopes[..., 3] == pytest.approx(values(positions))


def test_sigma_is_that_of_least_squares_under_noise_and_misplaced_lights(pixels, spheres):
    """Lights drawn from their joint covariance, samples from their noise, solved by plain least squares."""
    middle, rng = pixels.set_up.middle_mm, np.random.default_rng(0)
    positions = places_in_reach(REACH, middle, 120.0)[::5]
    known = light_sigmas(pixels.set_up, spheres, positions)
    covariance = joint_covariance(known)
    shown = pixels.under(lights_at(positions, middle))
    predicted = predict(pixels, shown, light_slopes(positions, middle, pixels.points, pixels.b), covariance)
    assert predicted.sigma_deg.max() < 90
    assert np.hypot(predicted.noise_deg, predicted.lights_deg) == pytest.approx(np.median(predicted.sigma_deg), rel=0.1)
    flat = covariance.reshape(4 * len(positions), -1)
    errors = []
    for draw in rng.multivariate_normal(np.zeros(len(flat)), flat, 60).reshape(60, -1, 4):
        given = lights_at(positions + draw[:, :3], middle).toward(pixels.points)
        samples = np.einsum("fpi,pi->fp", shown.vectors, pixels.b) + shown.noise * rng.standard_normal(shown.seen.shape)
        # Taken at a wrong place and strength, the light explains what the true one has done.
        samples = samples / (1 + draw[:, 3:])
        matrix = np.einsum("fp,fpi,fpj->pij", shown.seen, given, given)
        right = np.einsum("fp,fpi,fp->pi", shown.seen, given, samples)
        found = np.linalg.solve(matrix, right[..., None])[..., 0]
        errors.append(np.radians(angular_error_deg(unit(found), pixels.normals)) ** 2)
    found = np.degrees(np.sqrt(np.mean(errors) / 2))
    assert found == pytest.approx(np.sqrt(np.mean(predicted.sigma_deg**2)), rel=0.1)


def test_a_plan_beats_the_even_dome_and_ends_where_the_accuracy_is_reached(pixels, spheres):
    plan, middle = planned(pixels, spheres, 8), pixels.set_up.middle_mm
    places = places_in_reach(REACH, middle, 120.0, 8)
    covariance = joint_covariance(light_sigmas(pixels.set_up, spheres, places))
    slopes = light_slopes(places, middle, pixels.points, pixels.b)
    even = predict(pixels, pixels.under(lights_at(places, middle)), slopes, covariance)
    assert plan.result.sigma_deg.mean() < even.sigma_deg.mean()
    assert plan.flashes == 8
    assert plan.stop_after is None
    wanted = 1.05 * plan.result.error_deg
    short = planned(pixels, spheres, 8, accuracy_deg=wanted)
    assert short.flashes == short.stop_after <= 8
    assert short.result.error_deg <= wanted


def test_flashes_so_far_count_and_the_next_one_comes_from_elsewhere(pixels, spheres):
    middle = pixels.set_up.middle_mm
    places = places_in_reach(REACH, middle, 120.0)
    right = places[places[:, 0] > 150][:8]
    lights = lights_at(right, middle)
    for given in (lights, replace(lights, positions_mm=None, direction_sigma_deg=np.linspace(0.5, 0.9, 8))):
        so_far = UnderWay(pixels, np.zeros((0, 2), int), given, spheres, pixels.under(given))
        plan = planned(pixels, spheres, 9, so_far=so_far)
        assert plan.there == 8
        assert plan.positions_mm[8, 0] < 0
        if given is lights:
            assert plan.positions_mm[:8] == pytest.approx(right)
        else:
            # No ball tells the places of distant lights: the next one is as well known as those before.
            assert plan.lights.direction_sigma_deg == pytest.approx(np.full(9, 0.7))
            own = np.einsum("fifj->fij", plan.lights.position_covariance_mm2)
            away = np.linalg.norm(plan.positions_mm[:9] - middle, axis=1)
            turn = np.degrees(np.sqrt(np.trace(own, axis1=1, axis2=2) / 2)) / away
            assert turn == pytest.approx(np.full(9, 0.7))


def test_a_session_that_has_all_its_flashes_is_told_what_it_has(pixels, spheres):
    """Balls whose size nobody stated are in no drawing."""
    middle = pixels.set_up.middle_mm
    given = lights_at(places_in_reach(REACH, middle, 120.0)[::6], middle)
    for some in (spheres, [replace(sphere, diameter_mm=None) for sphere in spheres]):
        so_far = UnderWay(pixels, np.zeros((0, 2), int), given, some, pixels.under(given))
        plan = planned(pixels, some, len(given), so_far=so_far)
        assert plan.flashes == plan.there == len(given)
        facts = plan_facts(plan) | {"name": "a"}
        assert len(facts["balls"]) == (len(spheres) if some is spheres else 0)
        page = plan_page(facts)
        assert page.endswith("</html>\n")
        assert ("none is of known diameter" in page) == (not facts["balls"])
        assert ("from the middle, cm" in page) == bool(facts["balls"])


def test_when_more_flashes_do_not_help():
    assert enough([1.0, 0.5, 0.3, 0.2], 0.3, 3) == (5, 6)
    assert enough([1.0, 0.5, 0.499, 0.498, 0.497, 0.496], 0.1, 3) == (None, 4)


def test_balls_stand_whole_in_the_picture_beside_the_object_and_apart(pixels, spheres):
    outline = CAMERA.project(pixels.set_up.mesh.vertices)
    for number, sphere in enumerate(spheres):
        places = sphere.outline(CAMERA)
        assert (places > 0).all()
        assert (places < [CAMERA.width - 1, CAMERA.height - 1]).all()
        assert np.linalg.norm(outline - sphere.center_px, axis=1).min() > sphere.radius_px
        for other in spheres[:number]:
            assert np.hypot(*(sphere.center_px - other.center_px)) > sphere.radius_px + other.radius_px
        assert sphere.center_mm(CAMERA)[2] == pytest.approx(pixels.set_up.table_mm + 20.0)
    with pytest.raises(SceneError, match="no room in the picture"):
        stand_balls(pixels.set_up, pixels.points, [("chrome", 400.0)])


def test_the_smallest_balls_that_suffice_are_taken(pixels):
    positions = places_in_reach(REACH, pixels.set_up.middle_mm, 120.0)[::6]
    sigma = {}
    for wanted in (2.0, 0.1):
        spheres = best_balls(pixels.set_up, positions, wanted)
        assert [one.kind for one in spheres] == ["chrome"] * (len(spheres) - 1) + ["white"]
        sigma[wanted] = np.median(light_sigmas(pixels.set_up, spheres, positions).direction_sigma_deg), spheres
    assert sigma[2.0][0] <= 1.0
    assert sigma[2.0][1][0].radius_px >= GOOD_PX
    assert sigma[0.1][0] < sigma[2.0][0]
    assert sigma[0.1][1][0].diameter_mm > sigma[2.0][1][0].diameter_mm


def test_numbers_have_no_exponent():
    values = {0.1234: "0.12", 3.44: "3.4", 99.4: "99", 99.6: "100", 110: "110", 3204.0: "3204"}
    assert {value: brief(value) for value in values} == values


def test_the_page_is_whole_and_says_what_the_plan_says(pixels, spheres):
    plan = planned(pixels, spheres, 6, accuracy_deg=0.001)
    facts = plan_facts(plan) | {"name": "<cup & saucer>"}
    page = plan_page(facts)
    assert page.endswith("</html>\n")
    assert "&lt;cup &amp; saucer&gt;" in page
    assert "<script" not in page
    assert f"{facts['predicted']['error_median_deg']:.2g}°" in page
    assert "gloss and shadows left out" in page
    assert any("are not reached" in text for text in facts["warnings"])
    for row in facts["flashes"]:
        assert f"flash {row['number']}: {row['from_axis_deg']:.0f} degrees" in page
        position = np.array(row["position_mm"]) - facts["object"]["middle_mm"]
        assert row["aside_mm"] ** 2 + position[2] ** 2 == pytest.approx(row["distance_mm"] ** 2)
    assert [clock(a) for a in (90, 0, 270, 180, 45, 82.5)] == ["12:00", "3:00", "6:00", "9:00", "1:30", "12:15"]


@pytest.mark.full
def test_the_page_is_one_sheet(chromium, pixels, spheres):
    """With as many flashes as its table holds, and warnings."""
    plan = planned(pixels, spheres, MOST_ROWS, accuracy_deg=0.001)
    facts = plan_facts(plan) | {"name": "relief"}
    assert len(facts["flashes"]) == MOST_ROWS
    assert facts["warnings"]
    page = chromium.new_page()
    page.set_content(plan_page(facts))
    printed = page.pdf(format="A4", prefer_css_page_size=True)
    page.close()
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
