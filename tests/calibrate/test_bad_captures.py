"""Captures with something wrong: the lights are right all the same, or what is wrong is said by name. Never neither."""

from dataclasses import replace

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.detection.coarse import shrink
from calibrate.detection.evidence import contradicts_kind
from fixtures.ball_scene import Solid, exposed, radiance
from scene.errors import CalibrationError
from scene.normals import angular_error_deg
from tests.calibrate.conftest import table_scene

COUNT, SEED = 7, 10003


def _asked(world, *, scale=(), kinds=("chrome", "white")):
    """Requests that say where each ball is, for detection has its own tests; diameters times `scale`."""
    requests = world.requests(*kinds, hints=True)
    scale = [*scale, *[1.0] * (len(requests) - len(scale))]
    return [replace(r, diameter_mm=r.diameter_mm * k) for r, k in zip(requests, scale, strict=True)]


def _errors(world, found, camera=None):
    """Return each light's error in degrees and its strength's, relative, at the middle of the chrome balls.

    That middle is where the calibration has it: if all diameters are wrong alike, so are all lengths, and no direction.
    """
    chrome = [s for s in found.spheres if s.kind == "chrome"]
    lights = found.lights.seen_from(np.mean([s.center_mm(found.camera or camera or world.camera) for s in chrome], 0))
    places = np.array([ball.center for ball in world.balls])
    pixels = np.array([world.camera.project(place) for place in places])
    true = [places[np.linalg.norm(pixels - s.center_px, axis=1).argmin()] for s in chrome]
    directions, strengths = world.truth(np.mean(true, axis=0))
    relative = (lights.intensities / strengths).mean(1)
    return angular_error_deg(lights.directions, directions), np.abs(relative / np.median(relative) - 1)


def _right(world, found, *, camera=None, direction_deg=0.4, strength=0.02):
    angle, off = _errors(world, found, camera)
    assert angle.max() < direction_deg
    assert off.max() < strength


def _said(found, *words):
    """Assert that one warning has all these words."""
    assert any(all(word in warning for word in words) for warning in found.warnings), found.warnings


@pytest.fixture(scope="module")
def shot():
    """(world, images (F, H, W, 3), the picture without flash): two mirrors, a matte ball, three lumps."""
    world = table_scene(count=COUNT, seed=SEED)
    images, standing = radiance(world, blur_px=0.6)
    return world, images, standing


@pytest.fixture(scope="module")
def frames(shot):
    return exposed(shot[1])


# Wrong statements.


@pytest.mark.full
def test_a_wrong_diameter_of_the_white_ball_is_found_and_named(shot, frames):
    """A tenth too small cost 9 % in the strengths without a word, a fifth 21 %."""
    world = shot[0]
    found = calibrate(frames, world.camera, _asked(world, scale=[1, 1, 0.9]))
    _right(world, found, strength=0.01)
    _said(found, "the white ball contradicts", "not 63.0", "Check diameter_mm")
    (told,) = found.warnings
    assert float(told.split("unless it is about ")[1].split()[0]) == pytest.approx(70, rel=0.02)


@pytest.mark.full
@pytest.mark.parametrize("kinds", [("chrome",), ("chrome", "white")])
def test_of_two_chrome_balls_a_wrong_diameter_is_a_contradiction(shot, frames, kinds):
    """Whichever is right, all lengths scale alike: sigma must know that millimetres are a guess; a white ball tells."""
    world = shot[0]
    found = calibrate(frames, world.camera, _asked(world, kinds=kinds, scale=[1, 0.9]))
    _right(world, found, strength=0.01 if "white" in kinds else np.inf)
    guess = [] if "white" in kinds else ["which is a guess", "check diameter_mm"]
    _said(found, "the chrome balls contradict each other", "not 68.4", *guess)
    assert not any("frames.linear" in warning for warning in found.warnings), "a curve is not what explains it best"
    reference = found.lights.reference_point_mm
    off = angular_error_deg(found.lights.directions, world.truth(reference)[0])
    assert (off < 3 * found.lights.direction_sigma_deg).all()
    if guess:
        assert np.median(found.lights.direction_sigma_deg) > 0.5
    else:
        assert not any("which is a guess" in warning for warning in found.warnings)


# Bad photographs.


@pytest.mark.full
@pytest.mark.parametrize(("level", "kinds"), [(0.01, ("chrome", "white")), (0.0, ("white",))])
def test_a_flash_that_did_not_fire(shot, level, kinds):
    """Noise around zero became a strength of NaN where a white ball was the only one."""
    world, images, standing = shot
    images = images.copy()
    images[4] = standing + level * (images[4] - standing)
    with pytest.raises(CalibrationError, match=r"flash_004 \(.*did not fire.*frames\.skip"):
        calibrate(exposed(images), world.camera, _asked(world, kinds=kinds))


@pytest.mark.full
@pytest.mark.parametrize("unit", [0.1, 1 / 25.4], ids=["centimetres", "inches"])
def test_diameters_in_another_unit(shot, frames, unit):
    found = calibrate(frames, shot[0].camera, _asked(shot[0], scale=[unit] * 3))
    _said(found, "m from the camera", "in millimetres")
    _right(shot[0], found)


@pytest.mark.full
def test_two_flashes_from_one_place(shot):
    world, images, _ = shot
    images, lights, powers = images.copy(), world.lights.copy(), world.powers.copy()
    images[4], lights[4], powers[4] = images[1], lights[1], powers[1]
    found = calibrate(exposed(images), world.camera, _asked(world))
    _said(found, "flash_001 and flash_004 have the same light")
    assert found.lights.flags[4]
    _right(replace(world, lights=lights, powers=powers), found)


@pytest.mark.full
@pytest.mark.parametrize(
    ("power", "exposure", "words"),
    [
        # sRGB said to be linear was a ball that contradicts the lights.
        (1 / 2.2, 1, ("frames.linear: the white ball misses n.l", "frames.linear = false")),
        (2.2, 1, ("frames.linear: the white ball misses n.l", "frames.linear = true")),
        # Half of the room's light was left in all frames, without a word.
        (1, 0.5, ("frames.ambient: with the ambient frame taken off", "another exposure")),
    ],
)
def test_values_otherwise_coded_and_an_ambient_frame_otherwise_exposed_are_named(shot, power, exposure, words):
    world, images, _ = shot
    room = 0.25 * images.mean(0)
    coded, ambient = (np.clip(picture, 0, 1) ** power for picture in (images + room, exposure * room))
    found = calibrate(exposed(coded, ambient), world.camera, _asked(world))
    _said(found, *words)


def _flagged(world, images, ball, frame, *, half_mm):
    """Hold a card between a flash and a ball, out of the picture."""
    images = images.copy()
    center, light = world.balls[ball].center, world.lights[frame]
    way = (light - center) / np.linalg.norm(light - center)
    across = np.cross(way, [0.0, 1, 0]) / np.linalg.norm(np.cross(way, [0.0, 1, 0]))
    axes = np.stack([half_mm * across, half_mm * np.cross(way, across), 3 * way])
    with_card = replace(world, clutter=[Solid("box", center + 0.55 * (light - center), axes, 0.05)])
    images[frame] = radiance(with_card, slice(frame, frame + 1), blur_px=0.6)[0][0]
    return images


@pytest.mark.full
def test_a_chrome_ball_in_shadow(shot):
    world, images, _ = shot
    found = calibrate(exposed(_flagged(world, images, 0, 1, half_mm=60)), world.camera, _asked(world))
    angle, off = _errors(world, found)
    assert np.isnan(found.highlights_px[0, 1]).all()
    assert (angle < 3 * found.lights.direction_sigma_deg).all()
    assert np.delete(angle, 1).max() < 0.3
    assert off.max() < 0.03


@pytest.mark.full
def test_a_white_ball_in_shadow(shot):
    """The session was refused: as if the flash, which the mirrors show, had not fired."""
    world, images, _ = shot
    (white,) = (i for i, ball in enumerate(world.balls) if ball.kind == "white")
    found = calibrate(exposed(_flagged(world, images, white, 1, half_mm=60)), world.camera, _asked(world))
    _said(found, "flash_001", "every white ball stands in shadow", "shading of the", "frames.skip")
    angle, off = _errors(world, found)
    sigma = found.lights.intensity_sigma
    assert angle.max() < 0.4
    assert np.delete(off, 1).max() < 0.02
    assert off[1] < 3 * sigma[1] < 0.3
    assert (np.delete(sigma, 1) < 0.02).all()


@pytest.mark.full
def test_a_reflection_of_the_flash_in_something_else_is_named(shot):
    """The one chrome ball stands in shadow, and shows a small dark point elsewhere: that was the light, to 0.1 deg."""
    world, images, _ = shot
    images = _flagged(world, images, 0, 1, half_mm=60)
    ball = world.spheres()[0]
    v, u = np.indices(images.shape[1:3])
    place = ball.center_px + ball.radius_px * np.array([-0.3, 0.35])
    images[1] += 0.4 * np.exp(-((u - place[0]) ** 2 + (v - place[1]) ** 2) / (2 * 0.5**2))[..., None]
    found = calibrate(exposed(images), world.camera, [_asked(world, kinds=["chrome"])[0]])
    _said(found, "flash_001", "show another reflection of it", "frames.skip")
    sigma = found.lights.direction_sigma_deg
    assert sigma[1] > 20 > 10 * np.delete(sigma, 1).max()
    # A white ball that sees the flash tells its direction.
    requests = _asked(world)
    found = calibrate(exposed(images), world.camera, [requests[0], requests[-1]])
    assert requests[-1].kind == "white"
    assert not [text for text in found.warnings if "another reflection" in text]
    assert _errors(world, found)[0][1] < 10


# Bad balls.


def test_a_ball_of_the_other_kind_is_named():
    """A white ball said to be chrome was a mirror that disagrees; a chrome one said to be white, a dirty one."""
    world = table_scene(count=COUNT, seed=SEED)
    world.balls = [ball for ball in world.balls if ball.kind != "object"]
    frames = exposed(radiance(world, blur_px=0.6)[0])
    coarse = shrink(frames, world.camera)
    for sphere in world.spheres():
        assert contradicts_kind(coarse, sphere) is None
        other = "chrome" if sphere.kind == "white" else "white"
        told = contradicts_kind(coarse, replace(sphere, kind=other))
        assert f"said to be {other}" in told
        assert f"If it is {sphere.kind}" in told


@pytest.mark.full
def test_a_focal_length_a_tenth_wrong_bends_the_lights_no_further_than_stated(shot, frames):
    world = shot[0]
    camera = replace(world.camera, fx=1.1 * world.camera.fx, fy=1.1 * world.camera.fy)
    found = calibrate(frames, camera, _asked(world))
    angle, off = _errors(world, found, camera)
    assert (angle < 3 * found.lights.direction_sigma_deg).all()
    assert off.max() < 0.02
