"""The whole room on rendered photographs: lights against the truth that the tracer used; what is told of flags."""

from dataclasses import replace

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.calibration import flag_warnings
from calibrate.known_lights.read_known import read_lights
from fixtures.ball_scene import World, render
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import SphereRequest

OBJECT = np.array([0.0, 0.0, -1000.0])
BALLS = [SphereRequest("chrome", 76.0), SphereRequest("chrome", 76.0), SphereRequest("white", 70.0)]


@pytest.fixture(scope="module")
def found(table):
    world, frames = table
    return calibrate(frames, world.camera, BALLS)


def _truth(world, point=OBJECT):
    """Directions, and intensities as `Lights` has them: 1 in the mean of the flashes."""
    directions, irradiances = world.truth(point)
    return directions, irradiances / irradiances.mean(0)


def test_lights_at_the_object(table, found):
    """Balls of 31 px: one pixel of error is 4 degrees."""
    world, _ = table
    lights = found.lights.seen_from(OBJECT)
    directions, intensities = _truth(world)
    angle = angular_error_deg(lights.directions, directions)
    assert np.median(angle) < 0.7
    assert angle.max() < 1.5
    assert np.sqrt(np.mean((lights.intensities / intensities - 1) ** 2)) < 0.02
    assert lights.model == "near"
    ranges = np.linalg.norm(world.lights - OBJECT, axis=1)
    assert np.median(np.linalg.norm(lights.positions_mm - world.lights, axis=1) / ranges) < 0.04
    assert not found.warnings


def test_stated_sigma_covers_the_truth(table, found):
    world, _ = table
    reference = found.lights.reference_point_mm
    directions, intensities = _truth(world, reference)
    angle = angular_error_deg(found.lights.directions, directions)
    assert np.mean(angle < 2.448 * found.lights.direction_sigma_deg) > 0.75
    assert (found.lights.direction_sigma_deg < 1).all()
    off = found.lights.intensities.mean(1) / intensities.mean(1) - 1
    assert np.mean(np.abs(off) < 3 * found.lights.intensity_sigma) > 0.75


def test_white_value_ties_albedo_to_the_ball(table, found):
    """A pixel of the ball's own albedo, 0.85, facing a light of intensity 1 at the reference point."""
    world, _ = table
    distance = np.linalg.norm(world.lights - found.lights.reference_point_mm, axis=1, keepdims=True)
    expected = (0.85 * world.powers * (1000 / distance) ** 2).mean(0)
    np.testing.assert_allclose(found.lights.white_value, expected, rtol=0.03)


@pytest.mark.full
def test_one_chrome_ball_claims_directions_only(table):
    world, frames = table
    result = calibrate(frames, world.camera, world.requests("chrome", hints=True)[:1])
    assert result.lights.model == "distant"
    directions, _ = _truth(world, world.balls[0].center)
    # The ball mirrors beside its centre: as if lights were at infinity they would be 1 degree off there.
    error = angular_error_deg(result.lights.directions, directions)
    assert np.median(error) < 0.3
    assert np.mean(error < 2.45 * result.lights.direction_sigma_deg) > 0.8
    # Without a white ball the object tells the strengths: far better than taking all flashes for equally bright.
    _, truth = _truth(world, world.table_point)
    rms = np.sqrt(np.mean((result.lights.intensities / truth - 1) ** 2))
    assert rms < 0.5 * np.sqrt(np.mean((1 / truth - 1) ** 2))
    assert any("no white ball" in warning for warning in result.warnings)


@pytest.mark.full
def test_unknown_diameters_give_the_directions_at_the_balls_middle_and_no_ranges(table):
    """Taken as distant, the mean of what the balls see was a degree or two beside it."""
    world, frames = table
    requests = [replace(request, diameter_mm=None) for request in world.requests("chrome", hints=True)]
    result = calibrate(frames, world.camera, requests)
    assert result.lights.positions_mm is None
    assert any("near" in warning and "State diameter_mm" in warning for warning in result.warnings)
    middle = np.mean([ball.center for ball in world.balls[:2]], axis=0)
    assert np.median(angular_error_deg(result.lights.directions, _truth(world, middle)[0])) < 0.3
    np.testing.assert_allclose(result.spheres[0].center_px, requests[0].center_px, atol=0.2)


def test_white_ball_alone(table):
    world, frames = table
    result = calibrate(frames, world.camera, world.requests("white", hints=True))
    directions, _ = _truth(world, world.balls[2].center)
    assert np.median(angular_error_deg(result.lights.directions, directions)) < 2.5
    assert "shading" in " ".join(result.evidence)
    (warning,) = result.warnings
    assert "only a white ball: the directions hold where it stands" in warning


@pytest.mark.full
def test_a_ball_shot_apart(table):
    """The chrome ball's photographs are other frames than the object's."""
    world, frames = table
    chrome, _, white = world.requests(hints=True)
    own = Frames(frames.names, frames.codes.copy(), frames.gain)
    result = calibrate(frames, world.camera, [replace(chrome, frames=own), white])
    assert {sphere.kind: sphere.apart for sphere in result.spheres} == {"chrome": True, "white": False}
    # One chrome ball and the white ball's shading, from two places, show how far the flashes are.
    lights = result.lights
    directions, _ = _truth(world, lights.reference_point_mm)
    error = angular_error_deg(lights.directions, directions)
    assert np.median(error) < 0.5
    assert np.mean(error < 2.45 * lights.direction_sigma_deg) > 0.8
    distance = np.linalg.norm(world.lights - lights.reference_point_mm, axis=1)
    found = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    assert np.median(np.abs(found / distance - 1)) < 0.05


def test_known_positions_without_a_camera_are_taken_as_distant(table):
    """Millimetres mean nothing to a camera of unknown scale: used all the same they cost 18 degrees."""
    world, frames = table
    directions, intensities = _truth(world)
    known = Lights(frames.names, directions, intensities, world.lights, OBJECT)
    result = calibrate(frames, Camera.orthographic(frames.width, frames.height), [], known_lights=known)
    assert result.lights.model == "distant"
    np.testing.assert_allclose(result.lights.directions, directions)
    assert any("[camera]" in warning for warning in result.warnings)


def _written(path, world, frames, point):
    """Write an .lp file of the true directions at a point, and read it back."""
    rows = zip(frames.names, _truth(world, point)[0], strict=True)
    path.write_text(f"{len(frames)}\n" + "".join(f"{name}.dng {x:.9f} {y:.9f} {z:.9f}\n" for name, (x, y, z) in rows))
    return read_lights(path, frames.names)


def test_a_file_without_intensities_takes_them_from_the_white_ball(table, tmp_path):
    """Taken as equally bright without a word, flashes that vary by a third bent normals by 9 degrees."""
    world, frames = table
    center = world.balls[2].center
    known = _written(tmp_path / "lights.lp", world, frames, center)
    result = calibrate(frames, world.camera, world.requests("white", hints=True), known_lights=known)
    np.testing.assert_array_equal(result.lights.directions, known.directions)
    _, intensities = _truth(world, center)
    assert np.sqrt(np.mean((result.lights.intensities / intensities - 1) ** 2)) < 0.03
    assert not any(result.lights.flags)
    assert not result.warnings
    assert np.isfinite(result.lights.intensity_sigma).all()


@pytest.mark.parametrize("kind", ["none", pytest.param("chrome", marks=pytest.mark.full)])
def test_a_file_without_intensities_and_no_white_ball_is_said(table, tmp_path, kind):
    world, frames = table
    known = _written(tmp_path / "lights.lp", world, frames, OBJECT)
    result = calibrate(frames, world.camera, world.requests(kind, hints=True), known_lights=known)
    # The object itself tells them; though its near flashes are taken as distant here, better than all as equal.
    _, intensities = _truth(world, OBJECT)
    rms = np.sqrt(np.mean((result.lights.intensities / intensities - 1) ** 2))
    assert rms < 0.6 * np.sqrt(np.mean((1 / intensities - 1) ** 2))
    assert np.isfinite(result.lights.intensity_sigma).all()
    (warning,) = result.warnings
    for said in ("lights.lp", "no white ball", "the shading of the object"):
        assert said in warning


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_than_three_lights(table, count):
    """They give no normals, and are told all the same: a scan finds its place by its outline."""
    world, frames = table
    few = Frames(frames.names[:count], frames.codes[:count], frames.gain[:count])
    lights = calibrate(few, world.camera, world.requests("white", hints=True)).lights
    directions = _truth(world, lights.reference_point_mm)[0][:count]
    assert angular_error_deg(lights.directions, directions).max() < 2.5


def test_coplanar_lights():
    angles = np.deg2rad([-40, -15, 20, 45])
    world = World(Camera(240, 160, 400.0, 400.0, 120.0, 80.0), [], np.zeros((4, 3)), np.full((4, 3), 0.6))
    world.stand("white", 0, 0, 60)
    # Lights on a circle around the ball, in the plane y = the ball's own.
    center = world.balls[0].center
    world.lights = center + 3000 * np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    world.powers = np.full((4, 3), 5.0)
    with pytest.raises(CalibrationError, match="in one plane"):
        calibrate(render(world), world.camera, [SphereRequest("white", 120.0)])


NAMES = tuple(f"flash_{i:03d}" for i in range(12))
ORDER = "taken in the file's order: its names are not the frames'"


def test_many_frames_are_one_sentence_with_what_to_do():
    (all_of_them,) = flag_warnings(NAMES, [(ORDER,)] * 12)
    assert all_of_them.startswith(f"lights, all 12: {ORDER}. If the photographs are in another order")
    (some,) = flag_warnings(NAMES, [(ORDER,)] * 7 + [()] * 5)
    assert "flash_000, flash_001, flash_002, flash_003, flash_004 and 2 more" in some


def test_a_kind_that_a_few_frames_may_have_is_a_warning_from_a_quarter_on():
    flag = "glare beside the highlight on chrome ball 2: the middle of its core is taken"
    assert not flag_warnings(NAMES, [(flag,)] * 2 + [()] * 10)
    assert flag_warnings(NAMES, [(flag,)] * 3 + [()] * 9)


def test_flags_that_a_file_brings_are_told_as_its_own():
    (told,) = flag_warnings(NAMES, [("dim",)] + [()] * 11)
    assert "flash_000 (dim)" in told
