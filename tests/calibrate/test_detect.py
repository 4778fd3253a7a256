"""Balls without clicks, among shadows, mirrored rims and an object made of round lumps."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calibrate.detection.balls import find_balls
from calibrate.detection.choice import Rays, Suspect, agreement, choose, considered, fitted
from calibrate.detection.coarse import shrink
from calibrate.detection.detect import detect
from calibrate.detection.mirror_outline import circles_about
from calibrate.silhouette.mirrored_fit import MirroredTable
from calibrate.silhouette.mirrored_surroundings import ANY_PLANE
from fixtures import ball_scene
from fixtures.ball_scene import World, dust, flashes
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.normals import unit
from scene.spheres import Sphere, SphereRequest


def _truth(world):
    return [(ball.kind, ball.center_px, ball.radius_px) for ball in world.spheres()]


@pytest.mark.full
def test_every_ball_is_found_and_no_other(table):
    world, frames = table
    found, rejected = detect(frames, world.camera, shrink(frames, world.camera), wanted={"chrome": 2, "white": 1})
    assert len(found) == 3
    for kind, center, radius in _truth(world):
        ball = min(found, key=lambda one: np.hypot(*(one.sphere.center_px - center))).sphere
        assert ball.kind == kind
        # A matte ball darkens at its limb, which drew its edge inward by a fifth of a pixel.
        np.testing.assert_allclose(ball.center_px, center, atol=0.05)
        assert ball.radius_px == pytest.approx(radius, abs=0.05)
        assert ball.score > 0.9
    assert all(r.reason for r in rejected)


@pytest.mark.full
def test_order_of_frames_does_not_matter(table):
    world, frames = table
    order = np.random.default_rng(0).permutation(len(frames))
    shuffled = Frames(tuple(frames.names[i] for i in order), frames.codes[order], frames.gain[order])
    one, _ = detect(frames, world.camera, shrink(frames, world.camera), wanted={"chrome": 2})
    two, _ = detect(shuffled, world.camera, shrink(shuffled, world.camera), wanted={"chrome": 2})
    for a, b in zip(one, two, strict=True):
        # Sums in another order: the fit may stop a step earlier.
        np.testing.assert_allclose(a.sphere.center_px, b.sphere.center_px, atol=3e-3)


@pytest.mark.full
def test_a_forgotten_mirror_is_named_where_it_stands(table):
    world, frames = table
    balls, _, warnings = find_balls(frames, world.camera, [SphereRequest("chrome", 76.0), SphereRequest("white", 70.0)])
    mirror = next(ball.sphere for ball in balls if ball.sphere.kind == "chrome")
    centers = [center for kind, center, _ in _truth(world) if kind == "chrome"]
    other = max(centers, key=lambda center: np.hypot(*(center - mirror.center_px)))
    place = rf"a chrome ball that session.toml does not list stands at \({other[0]:.0f}, {other[1]:.0f}\) px"
    assert [w for w in warnings if re.match(place, w)], warnings


def test_a_ball_that_the_border_cuts_is_named():
    world = World(Camera(160, 120, 400.0, 400.0, 80.0, 60.0), [], flashes(6, seed=3), np.full((6, 3), 0.8))
    world.stand("white", -170, 0, 60).stand("white", 60, 0, 60)
    frames = ball_scene.render(world, seed=3)
    hints = [SphereRequest("white", 120.0, center_px=tuple(c), radius_px=r) for _, c, r in _truth(world)]
    _, _, warnings = find_balls(frames, world.camera, hints)
    named = [w for w in warnings if "cut by the picture's border" in w]
    assert len(named) == 1
    assert f"the white ball at ({_truth(world)[0][1][0]:.0f}, " in named[0]


def test_no_ball_is_an_error_that_says_what_was_seen():
    rng = np.random.default_rng(0)
    frames = Frames.from_linear(tuple("abcd"), 0.2 + 0.01 * rng.normal(size=(4, 120, 160, 3)).astype(np.float32))
    asked = [SphereRequest("chrome"), SphereRequest("chrome"), SphereRequest("white")]
    with pytest.raises(CalibrationError, match=r"no ball found \(asked for: 2 chrome, 1 white\).*lights.file"):
        find_balls(frames, Camera.orthographic(160, 120), asked)


@pytest.mark.parametrize("ball", [pytest.param(0, id="chrome", marks=pytest.mark.full), pytest.param(2, id="white")])
@pytest.mark.parametrize(
    "slip",
    [
        (0.11, 0, 0),
        (0, 0.06, -0.1),
        *(pytest.param(slip, marks=pytest.mark.full) for slip in ((0, 0, 0), (-0.08, 0.08, 0), (0, 0, 0.11))),
    ],
)
def test_a_hint_is_a_hint_and_a_mask_the_ball_itself(table, ball, slip):
    """Off by a ninth of the radius it used to win over the outline, and bent the lights by up to 10 degrees."""
    world, frames = table
    true = world.spheres()[ball]
    u, v, r = np.array([*true.center_px, true.radius_px]) + true.radius_px * np.array(slip)
    told = {"center_px": (u, v), "radius_px": r} if any(slip) else {"mask": true.mask(world.camera)}
    (found,), rejected, warnings = find_balls(frames, world.camera, [SphereRequest(true.kind, 76.0, **told)])
    assert not warnings
    assert not rejected, "no other ball is sought"
    assert found.sphere.diameter_mm == 76.0
    np.testing.assert_allclose(found.sphere.center_px, true.center_px, atol=0.06 if "mask" in told else 0.12)
    assert found.sphere.radius_px == pytest.approx(true.radius_px, abs=0.1 if true.kind == "chrome" else 0.3)


@pytest.mark.full
@pytest.mark.parametrize(("electrons", "stays"), [(400.0, False), (12.0, True)])
@pytest.mark.parametrize("seed", [10001, 10002])
def test_a_given_mirror_is_not_lost_in_noise(seed, electrons, stays):
    """On a wide table its outline has no contrast, and the rim of the dark that it mirrors all: 6 px inside of 25."""
    camera = Camera(150, 140, 480.0, 480.0, 75.3, 68.6)
    wide = {"table_normal": np.array([0, 0, 1.0]), "table_point": np.array([0, 0, -1015.0]), "table_half": 3000.0}
    world = World(camera, [], flashes(10, seed=seed), np.full((10, 3), 0.8), table_albedo=0.2, **wide)
    world.balls.append(ball_scene.Ball("chrome", np.array([12.0, -8.0, -960.0]), 50.0, albedo=1.0))
    frames = ball_scene.render(world, electrons=electrons, read_noise=4.0 / electrons, seed=seed)
    ((_, center, radius),) = _truth(world)
    true = np.array([*center, radius])
    u, v, r = given = true + [0.9, -0.7, -0.6]
    (ball,), _, warnings = find_balls(frames, camera, [SphereRequest("chrome", center_px=(u, v), radius_px=r)])
    found = np.array([*ball.sphere.center_px, ball.sphere.radius_px])
    assert np.all(np.abs(found - true) < 3 * np.sqrt(np.diag(ball.covariance)))
    if stays:
        assert np.array_equal(found, given)
        assert "it is taken as it is" in warnings[0]
    else:
        assert np.abs(found - true).max() < 0.5
        assert not warnings


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"center_px": (50.0, 50.0)}, "radius_px"),
        ({"mask": np.zeros((400, 600), bool)}, "only 0 px"),
        ({"mask": np.ones((4, 6), bool)}, "but the frames are 600 x 400"),
        ({"frames": slice(4)}, "4 photographs of the ball, but 10 flash frames"),
    ],
)
def test_requests_that_cannot_be_met(table, asked, message):
    world, frames = table
    asked = {name: frames.only(value) if name == "frames" else value for name, value in asked.items()}
    with pytest.raises(CalibrationError, match=message):
        find_balls(frames, world.camera, [SphereRequest("chrome", **asked)])


@pytest.fixture(scope="module")
def printed():
    """(world, frames): a checkered table; mirrors that touch, one dusty; a matte ball; a pebble; a cut mirror."""
    rng = np.random.default_rng(10007)
    camera = Camera(640, 440, 960.0, 960.0, 322.0, 217.0)
    count = 9
    powers = 0.4 * rng.uniform(0.8, 1.2, (count, 1)) * np.ones((1, 3))
    world = World(camera, [], flashes(count, seed=10007), powers, table_texture="checker", table_half=500.0)
    world.table_albedo, world.table_second, world.table_grain_mm = 0.3, 0.15, 18.0
    specks = dust(rng, 12, radius_mm=1.0, ball_mm=40.0)
    world.stand("chrome", -180, 90, 40).stand("chrome", -99, 90, 40, marks=specks).stand("white", 190, 80, 36)
    world.put("ellipsoid", 120, -110, (45, 45, 24), albedo=0.7)
    world.stand("chrome", -345, -120, 40)
    return world, ball_scene.render(world, seed=10007)


@pytest.mark.full
def test_print_dust_and_touching_balls_do_not_hide_balls(printed):
    world, frames = printed
    found, rejected = detect(frames, world.camera, shrink(frames, world.camera))
    whole = [one.sphere for one in found if one.sphere.center_px[0] > 40]
    for kind, center, radius in _truth(world)[:3]:
        ball = min(whole, key=lambda s: np.hypot(*(s.center_px - center)))
        assert ball.kind == kind
        np.testing.assert_allclose(ball.center_px, center, atol=0.4)
        assert ball.radius_px == pytest.approx(radius, abs=0.4)
    assert len(whole) == 3
    pebble = world.camera.project(world.clutter[0].center)
    near = [r for r in rejected if np.hypot(*(r.center_px - pebble)) < 15]
    assert any("flatter body" in r.reason for r in near), [r.reason for r in near]


def _rings(*circles):
    """Return a picture of slopes (100, 120, 2) that stands on circles (u, v, radius)."""
    v, u = np.mgrid[0:100, 0:120]
    slopes = np.zeros((100, 120, 2), np.float32)
    for center_u, center_v, radius in circles:
        away = np.stack([u - center_u, v - center_v], -1)
        far = np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1)
        slopes += np.where(np.abs(far - radius) < 1.5, 0.1 * away / far, 0).astype(np.float32)
    return slopes


def test_the_circle_about_the_mirrored_edge_of_the_table_is_the_likeliest_outline():
    """The table's edge stands out as much, and is no outline: another circle of its kind lies about it."""
    standing = _rings((50, 50, 30), (50.5, 50, 21))
    for known in ((50.5, 50.0, 21.0), (47.0, 52.0, 24.0), (50.0, 50.0, 30.0)):
        best, *others = circles_about(standing, Sphere("chrome", np.array(known[:2]), known[2]))
        np.testing.assert_allclose([*best.center_px, best.radius_px], [50, 50, 30], atol=1)
        assert best.score > 0.8
        assert any(abs(one.radius_px - 21) < 1 for one in others)


CENTERS = np.array([[0.0, 0, -1500], [300.0, 100, -1500]])


def _rays(center, lights, *, flat=1.0, turned=0.0, sigma=2.0):
    """Where a ball sees lights (F, 3); `flat`: a mirror's height over its width, `turned`: error, degrees."""
    toward = unit(lights - center)
    half = unit(toward + unit(-center))
    half = unit(half * [1, 1, 1 / flat])
    view = unit(-center)
    seen = 2 * np.sum(half * view, -1, keepdims=True) * half - view
    seen = unit(seen + np.tan(np.deg2rad(turned)) * unit(np.cross(seen, [0.3, 0.2, 1.0])))
    return Rays(center, seen[:, None], np.ones((len(lights), 1), bool), sigma)


def test_balls_agree_on_near_lights_and_a_flat_mirror_does_not():
    """A metal pebble two thirds as high as wide passed for a ball among balls."""
    rng = np.random.default_rng(10029)
    lights = rng.normal(0, 500, (12, 3)) * [1, 1, 0.3] + [0, 0, -300]
    one, other = (_rays(center, lights) for center in CENTERS)
    agree, differ = agreement(one, other)
    # To the steps along the arc.
    assert agree == pytest.approx(np.sqrt(12), rel=0.01)
    assert differ == pytest.approx(0, abs=0.03)
    agree, differ = agreement(one, _rays(CENTERS[1], lights, flat=0.67))
    assert differ > 1.5 * agree
    # Off by one sigma of both across the arc, at most.
    agree, _ = agreement(one, _rays(CENTERS[1], lights, turned=2 * np.sqrt(2)))
    assert agree > np.exp(-0.5) * np.sqrt(12)


def _suspect(kind, place, *, own, lights, flat=1.0):
    """A circle of given log-odds of its own."""
    weights = fitted()["ball"][kind]
    sphere = Sphere(kind, np.array([600 + 300 * place, 400.0]), 40.0)
    features = np.zeros(len(weights))
    features[0] = own / weights[0]
    return Suspect(sphere, kind, features, _rays(np.array([300.0 * place, 0, -1500]), lights, flat=flat))


def test_a_circle_that_mirrors_the_table_is_always_considered():
    """Its flashes lay far out: the dark discs inside it seemed better, and the ball was lost."""
    lights = np.random.default_rng(4).normal(0, 500, (9, 3)) * [1, 1, 0.3] + [0, 0, -300]
    mirror, *discs = (_suspect("chrome", 0.01 * n, own=-1.0, lights=lights) for n in range(3))
    mirror.features[-2], discs[0].features[-2], discs[1].features[-2] = 0.5, 1.0, 1.0
    assert not any(one is mirror for one in considered([mirror, *discs]))
    shown = replace(mirror, table=MirroredTable(mirror.sphere, np.eye(3), ANY_PLANE, 1.0, 0.6, 0.999, 0.0, 3.0))
    assert any(one is shown for one in considered([*discs, shown]))


def test_the_likeliest_set_is_taken():
    """Against every set there is; those that see the same lights outvote a surer one that does not."""
    lights = np.random.default_rng(4).normal(0, 500, (9, 3)) * [1, 1, 0.3] + [0, 0, -300]
    others = np.random.default_rng(5).normal(0, 500, (9, 3)) * [1, 1, 0.3] + [0, 0, -300]
    same = [_suspect("chrome", n, own=1.0, lights=lights) for n in (-1, 0, 1)]
    odd = _suspect("chrome", 2, own=2.0, lights=others)
    twin = _suspect("chrome", 0.1, own=0.5, lights=lights)
    white = _suspect("white", 3, own=-0.5, lights=lights)
    some = [odd, twin, white, *same]
    taken, left = choose(some, None)
    assert {id(one.suspect) for one in taken} == {id(s) for s in (*same, white)}
    assert all(one.probability > 0.5 for one in taken)
    assert next(one for one in left if one.suspect is odd).probability < 0.1
    taken, _ = choose(some, {"chrome": 2})
    assert len(taken) == 2
    assert all(one.suspect.sphere.kind == "chrome" for one in taken)
    assert not any(one.suspect is odd for one in taken)
    # Asked for, a doubtful one is believed; what nothing speaks for is not.
    doubtful = _suspect("white", 0, own=-1.5, lights=lights)
    assert not choose([doubtful], None)[0]
    assert choose([doubtful], {"white": 2})[0]
    assert not choose([_suspect("white", 0, own=-5.0, lights=lights)], {"white": 1})[0]
