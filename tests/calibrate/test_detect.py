"""Balls without clicks, among shadows, mirrored rims and an object made of round lumps."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calibrate.detection.balls import _by_diameters, _open, find_balls
from calibrate.detection.choice import Suspect, choose, weights
from calibrate.detection.coarse import shrink
from calibrate.detection.detect import detect
from calibrate.detection.diameters import Diameter
from calibrate.detection.mirror_outline import about_horizon, circles_about
from calibrate.lights.directions import mirrored_rays
from calibrate.silhouette.ball_silhouette import OutlineFit
from fixtures import ball_scene
from fixtures.ball_scene import World, dust, flashes
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.normals import unit
from scene.spheres import Sphere, SphereRequest


def _truth(world):
    camera = world.camera
    return [
        (ball.kind, camera.project(ball.center), camera.fx * ball.radius / -ball.center[2])
        for ball in world.balls
        if ball.kind != "object"
    ]


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


@pytest.mark.parametrize("ball", [0, 2], ids=["chrome", "white"])
@pytest.mark.parametrize(
    "slip",
    [
        (0.11, 0, 0),
        (0, 0.06, -0.1),
        *(pytest.param(slip, marks=pytest.mark.full) for slip in ((0, 0, 0), (-0.08, 0.08, 0), (0, 0, 0.11))),
    ],
)
def test_a_hint_is_a_hint(table, ball, slip):
    """Off by a ninth of the radius it used to win over the outline, and bent the lights by up to 10 degrees."""
    world, frames = table
    kind, center, radius = _truth(world)[ball]
    u, v, r = np.array([*center, radius]) + radius * np.array(slip)
    balls, _, warnings = find_balls(frames, world.camera, [SphereRequest(kind, center_px=(u, v), radius_px=r)])
    assert not warnings
    np.testing.assert_allclose(balls[0].sphere.center_px, center, atol=0.12)
    assert balls[0].sphere.radius_px == pytest.approx(radius, abs=0.1 if kind == "chrome" else 0.3)


def test_a_hint_where_no_ball_is_gets_a_doubt_of_its_size():
    rng = np.random.default_rng(0)
    frames = Frames.from_linear(tuple("abcd"), 0.2 + 0.01 * rng.normal(size=(4, 200, 240, 3)).astype(np.float32))
    request = SphereRequest("chrome", center_px=(120.0, 100.0), radius_px=60.0)
    (ball,), _, (warning,) = find_balls(frames, Camera.orthographic(240, 200), [request])
    assert ball.sphere.sigma_px == pytest.approx(3.0)
    np.testing.assert_allclose(ball.covariance, 9 * np.eye(3))
    assert "no outline was found" in warning
    assert "3.0 px of doubt" in warning


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (SphereRequest("chrome", center_px=(50.0, 50.0)), "radius_px"),
        (SphereRequest("chrome", mask=np.zeros((400, 600), bool)), "only 0 px"),
        (SphereRequest("chrome", mask=np.ones((4, 6), bool)), "but the frames are 600 x 400"),
    ],
)
def test_requests_that_cannot_be_met(table, request_, message):
    world, frames = table
    with pytest.raises(CalibrationError, match=message):
        find_balls(frames, world.camera, [request_])


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


@pytest.mark.parametrize(("tilt", "turn"), [(11, 0), (11, 120), (23, 60), (23, 300)])
def test_what_a_mirror_shows_of_the_horizon_tells_outline_and_tilt(tilt, turn):
    """Upside down or mirrored, the table would lean to another side."""
    a, b = np.deg2rad([tilt, turn])
    up = np.array([np.sin(a) * np.cos(b), -np.sin(a) * np.sin(b), np.cos(a)])
    camera, ball = (
        Camera(600, 600, 6000.0, 6000.0, 300.0, 300.0),
        Sphere("chrome", np.array([300.0, 300.0]), 100.0, 1.0),
    )
    top = unit(up + [0, 0, 1])[:2] * [1, -1]  # there the ball mirrors the zenith
    way = np.stack([np.cos(angles := np.arange(0, 2 * np.pi, 0.1)), np.sin(angles)], -1)
    places = ball.center_px + 100 * top + np.linspace(0, 99, 1000)[:, None, None] * way
    _, mirrored = mirrored_rays(camera, ball, places)
    is_below = ~(np.sum(mirrored * up, -1) > 0)
    edge = places[is_below.argmax(0), np.arange(len(way))]
    design = np.column_stack([2 * edge, np.ones(len(edge))])
    u, v, rest = np.linalg.lstsq(design, np.sum(edge**2, 1), rcond=None)[0]
    shown = Sphere("chrome", np.array([u, v]), float(np.sqrt(rest + u * u + v * v)))
    off = [
        (max(np.hypot(*(start.center_px - 300)), abs(start.radius_px - 100)), plane)
        for start, plane in about_horizon(shown)
    ]
    nearest, plane = min(off, key=lambda one: one[0])
    assert nearest < 3
    np.testing.assert_allclose(plane[:2], up[:2] / up[2], atol=0.02)


def test_a_mirror_whose_outline_is_not_sure_is_named():
    """Two circles stand as still, and neither holds the other."""
    start = Sphere("chrome", np.array([53.0, 50.0]), 30.0)
    best, rival, *_ = circles_about(_rings((50, 50, 30), (57, 50, 30)), start)
    assert {round(best.center_px[0]), round(rival.center_px[0])} == {50, 57}
    (warning,) = _open(OutlineFit(best, np.eye(3), 0.1, rival=rival))
    assert "a circle of 30 px stands as still" in warning


def test_diameters_tell_a_mirror_from_the_table_s_edge_in_it(table):
    """Of two circles that stand as still, the one that its diameter asks for beside a white ball is taken."""
    world, frames = table
    chrome, white = world.spheres()[0], world.spheres()[2]
    inner = replace(chrome, radius_px=0.7 * chrome.radius_px)
    fits = [OutlineFit(sphere, 0.01 * np.eye(3), 0.1) for sphere in (chrome, inner)]
    mm = chrome.diameter_mm

    def told(found, diameter, sure):
        return _by_diameters(frames, world.camera, found, Diameter(diameter, 0.0), sure, search_px=2.0)

    right = told(replace(fits[0], rival=inner), mm, [white])
    assert right.rival is None
    assert right.sphere.radius_px == chrome.radius_px
    doubtful = replace(fits[1], rival=chrome)
    exchanged = told(doubtful, mm, [white])
    assert exchanged.rival is None
    assert exchanged.sphere.radius_px == pytest.approx(chrome.radius_px, abs=0.1)
    # Nothing is known without diameters, and a diameter that fits none of both is at fault itself.
    for unknown in ((None, [white]), (mm, []), (5 * mm, [white])):
        assert told(doubtful, *unknown).rival


def _suspect(kind, place, own):
    """A circle of given log-odds of its own."""
    of_kind = weights()["ball"][kind]
    features = np.zeros(len(of_kind))
    features[0] = own / of_kind[0]
    return Suspect(Sphere(kind, np.array([600 + 300 * place, 400.0]), 40.0), kind, features)


def test_the_likeliest_circles_are_taken_one_at_a_place():
    some = [_suspect(*one) for one in (("chrome", 0, 1), ("chrome", 0.1, 0.5), ("chrome", 1, 2), ("white", 3, -0.5))]
    taken, left = choose(some, None)
    assert [id(one) for one in taken] == [id(some[2]), id(some[0])]
    assert left == [some[3]]
    assert [id(one) for one in choose(some, {"chrome": 1})[0]] == [id(some[2])]
    # Asked for, a doubtful one is believed; what nothing speaks for is not.
    assert choose(some, {"white": 2})[0] == [some[3]]
    assert not choose([_suspect("white", 0, -5.0)], {"white": 1})[0]
