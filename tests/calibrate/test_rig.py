"""Lamps pooled from sessions that the test makes: laws, each fault named alone, and what a session takes from them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.calibration_sessions import session_world, world_peak
from calibrate.calibrate import calibrate
from calibrate.calibration import Calibration
from calibrate.known_lights.measured_lights import MeasuredLights
from calibrate.known_lights.read_known import lacks_intensities, read_lights
from calibrate.known_lights.rig import against_balls, pool_sessions
from fixtures.ball_scene import flashes, photograph
from fixtures.lit_surfaces import flashes_at
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.normals import angular_error_deg, unit
from twin.camera.virtual_camera import Sensor

COUNT, SESSIONS = 10, 5
NAMES = tuple(f"flash_{i:03d}" for i in range(COUNT))
CAMERA = Camera(1200, 800, 1666.7, 1666.7, 606.8, 394.9)
REFERENCE = np.array([0.0, 0.0, -1000.0])
TURN_DEG, RANGE, LEVEL = 0.1, 0.003, 0.005
"""Sigmas of a direction along one axis, of a range and of a strength, relative."""


def lamps(near):
    positions = flashes(COUNT, near_mm=700, far_mm=1200, center=REFERENCE, seed=3)
    levels = np.random.default_rng(3).uniform(0.7, 1.3, (COUNT, 3))
    sigma = {"direction_sigma_deg": np.full(COUNT, TURN_DEG), "intensity_sigma": np.full(COUNT, LEVEL)}
    return flashes_at(positions, REFERENCE, levels, near=near, **sigma).normalised()


def covariance_of(lights):
    away = lights.positions_mm - REFERENCE
    along = away[:, :, None] * away[:, None, :]
    square = np.sum(away**2, 1)[:, None, None]
    return np.radians(TURN_DEG) ** 2 * (square * np.eye(3) - along) + RANGE**2 * along


def noisy(near, count=SESSIONS, seed=0):
    """Sessions that measure the lamps with the errors that they state."""
    rng, true = np.random.default_rng(seed), lamps(near)
    cover = covariance_of(true) if near else np.tile(np.radians(TURN_DEG) ** 2 * np.eye(3), (COUNT, 1, 1))
    out = []
    for k in range(count):
        off = np.einsum("nij,nj->ni", np.linalg.cholesky(cover), rng.normal(size=(COUNT, 3)))
        positions = true.positions_mm + off if near else None
        toward = unit(positions - REFERENCE if near else true.directions + off)
        levels = true.intensities * np.exp(LEVEL * rng.normal(size=(COUNT, 1)))
        lights = replace(true, directions=toward, positions_mm=positions, intensities=levels).normalised()
        out.append(MeasuredLights(f"s{k}", lights, CAMERA, cover if near else None))
    return out


def changed(one, *, shift=None, level=None, turn=None, rows=None, names=NAMES):
    lights, cover = one.lights, one.covariance_mm2
    positions, levels, toward = lights.positions_mm, lights.intensities.copy(), lights.directions
    if shift:
        positions = positions.copy()
        positions[shift[0]] += shift[1]
    if level:
        levels[level[0]] *= level[1]
    if turn:
        toward, positions = (None if rows is None else turn.apply(rows) for rows in (toward, positions))
    lights = replace(lights, positions_mm=positions, intensities=levels, directions=toward)
    if rows is not None:
        lights = replace(lights.only(rows), names=names[: len(rows)])
        cover = None if cover is None else cover[rows]
    return replace(one, lights=lights.normalised(), covariance_mm2=cover)


@pytest.mark.parametrize("near", [True, False])
def test_five_equal_sessions_change_nothing_but_sigma(near):
    (one,) = noisy(near, 1)
    rig = pool_sessions([replace(one, name=f"s{k}") for k in range(5)])
    assert not rig.warnings
    for name in ("directions", "intensities", *(["positions_mm"] * near)):
        np.testing.assert_allclose(getattr(rig.lights, name), getattr(one.lights, name), rtol=1e-9)
    for name in ("direction_sigma_deg", "intensity_sigma"):
        np.testing.assert_allclose(getattr(rig.lights, name) * 5**0.5, getattr(one.lights, name), rtol=1e-9)
    np.testing.assert_allclose(5 * rig.covariance, one.covariance, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("near", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_named_without_a_fault_and_sigma_holds(near, seed):
    rig, true = pool_sessions(noisy(near, seed=100 + seed)), lamps(near)
    assert not rig.warnings
    off = angular_error_deg(rig.lights.directions, true.directions) / rig.lights.direction_sigma_deg
    assert np.sqrt(np.mean(off**2) / 2) < 1.5
    level = np.log(rig.lights.intensities / true.intensities).mean(1)
    assert np.sqrt(np.mean((level - level.mean()) ** 2)) < 1.5 * rig.lights.intensity_sigma.mean()


def test_scatter_beyond_the_stated_sigmas_widens_them_and_is_said():
    sessions = [replace(one, covariance_mm2=one.covariance_mm2 / 16) for one in noisy(True)]
    rig = pool_sessions(sessions)
    assert any("as much as their sigmas say" in text for text in rig.warnings)
    stated = pool_sessions(noisy(True)).lights.direction_sigma_deg
    # The directions' own sigmas are stated rightly, and so are four times too wide now.
    assert 3 < np.median(rig.lights.direction_sigma_deg / stated) < 5


@pytest.mark.parametrize("near", [True, False])
@pytest.mark.parametrize("k", [0, 2])
def test_frames_in_another_order_give_the_same_rig(near, k):
    sessions, order = noisy(near), np.random.default_rng(1).permutation(COUNT)
    mixed = [changed(one, rows=order) if s == k else one for s, one in enumerate(sessions)]
    plain, rig = pool_sessions(sessions), pool_sessions(mixed)
    np.testing.assert_allclose(rig.lights.directions, plain.lights.directions, atol=1e-12)
    np.testing.assert_allclose(rig.lights.intensities, plain.lights.intensities, rtol=1e-12)
    (text,) = rig.warnings
    assert text.startswith(f"s{k}: ")


SWAPPED, LACKING = [0, 1, 7, 3, 4, 5, 6, 2, 8, 9], [0, 1, 2, 3, 5, 6, 7, 8, 9]
TURNED = {"turn": Rotation.from_rotvec([0, np.radians(1), 0])}
FAULTS = {
    "two swapped": (4, {"rows": SWAPPED}, r"s4: flash_002, flash_007 are exchanged"),
    "moved last": (4, {"shift": (3, [20, 0, 0])}, r"flash_003: the lamp is (1[89]|2[012])\S* mm elsewhere in s4"),
    "moved since": (2, {"shift": (3, [0, 20, 0])}, r"flash_003: the lamp is (1[89]|2[012])\S* mm elsewhere since s2"),
    "missing": (4, {"rows": LACKING}, r"s4: no frame shows flash_004"),
    "dark": (4, {"level": (5, 0.02)}, r"flash_005: the lamp is 98 % weaker, dead or hidden, in s4"),
    "dimmed": (3, {"level": (5, 0.9)}, r"flash_005: the lamp is (9\S*|10|11) % weaker since s3"),
    "camera": (4, TURNED, r"s4: the camera was turned by (0\.[89]|1\.[01])\d degrees"),
    "another set-up": (4, {"shift": (slice(6), [-90, 90, 90])}, r"s4: all its lights are elsewhere"),
}
"""From which session on, what, and how it is named."""


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("seed", range(3))
def test_each_fault_is_named_alone(fault, seed):
    first, change, words = FAULTS[fault]
    sessions = noisy(True, seed=300 + seed)
    rig = pool_sessions([changed(one, **change) if k >= first else one for k, one in enumerate(sessions)])
    (text,) = rig.warnings
    assert re.match(words, text), text
    # A lamp that was moved is pooled as it is now; a session that does not fit is left out.
    off = angular_error_deg(rig.lights.directions, lamps(True).directions)
    assert np.delete(off, 3).max() < 0.3
    assert ("s4" in rig.sessions) == (fault not in ("camera", "another set-up"))


def test_a_lamp_that_drifts_and_another_lens_are_named():
    sessions = noisy(True)
    (text,) = pool_sessions([changed(one, shift=(3, [0, 8 * k, 0])) for k, one in enumerate(sessions)]).warnings
    assert re.match(r"flash_003: the lamp is (2[89]|3[0-6])\S* mm elsewhere in s4, by a drift", text)
    sessions[1] = replace(sessions[1], camera=replace(CAMERA, fx=1800.0))
    rig = pool_sessions(sessions)
    assert rig.sessions == ("s0", "s2", "s3", "s4")
    assert rig.warnings[0].startswith("s1: its focal length is 1.080")


def test_sessions_with_positions_count_and_strengths_come_from_those_that_know_them():
    near, far = noisy(True), noisy(False)
    rig = pool_sessions([*near[:2], replace(far[0], name="far")])
    assert rig.sessions == ("s0", "s1")
    assert rig.warnings == ("far: its lights have no positions; left out.",)
    unknown = {"intensities": np.ones((COUNT, 3)), "intensity_sigma": np.full(COUNT, np.nan)}
    dark = [replace(one, lights=replace(one.lights, **unknown)) for one in near]
    some = pool_sessions([dark[0], *near[1:]])
    np.testing.assert_allclose(some.lights.intensities, pool_sessions(near[1:]).lights.intensities, rtol=1e-9)
    none = pool_sessions(dark)
    assert lacks_intensities(none.lights)
    assert not none.warnings


def test_a_rig_needs_two_sessions_that_agree():
    one, other = noisy(True, 2)
    with pytest.raises(CalibrationError, match="found 1 session, expected two"):
        pool_sessions([one])
    turned = changed(other, turn=Rotation.from_rotvec([np.radians(2), 0, 0]))
    with pytest.raises(CalibrationError, match=r"turned by (1\.[89]|2\.[01])\d degrees, against"):
        pool_sessions([one, turned])


@pytest.mark.parametrize("near", [True, False])
def test_a_session_reads_a_rig_by_order_and_checks_its_camera(near, tmp_path):
    rig, path = pool_sessions(noisy(near)), tmp_path / "rig.json"
    rig.write(path)
    rig.write(path)
    by_name = read_lights(path, NAMES[::-1], camera=CAMERA)
    np.testing.assert_allclose(by_name.directions, rig.lights.directions[::-1])
    np.testing.assert_allclose(by_name.direction_sigma_deg, rig.lights.direction_sigma_deg[::-1])
    numbered = [changed(one, rows=np.arange(COUNT), names=[f"IMG_{k}{i}" for i in range(COUNT)])
                for k, one in enumerate(noisy(near))]  # fmt: skip
    other = pool_sessions(numbered)
    assert other.lights.names[3] == "lamp 4"
    other.write(path)
    photographs = tuple(f"DSC_{i:04d}" for i in range(950, 950 + COUNT))
    read = read_lights(path, photographs, camera=CAMERA)
    np.testing.assert_allclose(read.directions, rig.lights.directions)
    assert not any(read.flags)
    with pytest.raises(CalibrationError, match="10 lights for 9 flash frames"):
        read_lights(path, photographs[1:], camera=CAMERA)
    capital = path.rename(tmp_path / "RIG.JSON")
    np.testing.assert_allclose(read_lights(capital, photographs, camera=CAMERA).directions, rig.lights.directions)
    zoomed = read_lights(capital, photographs, camera=replace(CAMERA, fx=1900.0))
    assert all("another camera: its focal length is 1.140" in flags[-1] for flags in zoomed.flags)
    other = json.loads(capital.read_text())
    path.write_text(json.dumps({**other, "camera": {**other["camera"], "width": 0}}))
    with pytest.raises(CalibrationError, match=r"rig\.json: .*size 0 x 800"):
        read_lights(path, photographs, camera=CAMERA)
    path.write_text(json.dumps({"mine": 1}))
    with pytest.raises(CalibrationError, match="no lamps of rgbn"):
        rig.write(path)


BALL_FAULTS = {
    "nothing": ({}, None),
    "moved": ({"shift": (3, [20, 0, 0])}, r"flash_003: the lamp is .* mm elsewhere in these photographs"),
    "dimmed": ({"level": (5, 0.9)}, r"flash_005: the lamp is .* weaker in these photographs"),
    "camera": (TURNED, r"the camera was turned by (0\.[89]|1\.[01])\d degrees"),
}


@pytest.mark.parametrize("fault", BALL_FAULTS)
@pytest.mark.parametrize("seed", range(3))
def test_balls_check_a_rig(fault, seed):
    change, words = BALL_FAULTS[fault]
    *sessions, last = noisy(True, SESSIONS + 1, seed=200 + seed)
    own = changed(last, **change)
    said = against_balls(pool_sessions(sessions).lights, Calibration([], own.lights, np.zeros((0, COUNT, 2)),
                         position_covariance_mm2=own.covariance_mm2), CAMERA)  # fmt: skip
    if words is None:
        assert said == []
    else:
        (text,) = said
        assert re.search(words, text), text


@pytest.mark.full
def test_five_rendered_sessions_give_ten_lamps():
    """Objects, balls and table differ from session to session; the lights are for a session without balls."""
    seed = 3
    rng, lights = np.random.default_rng([seed, 99]), flashes(COUNT, near_mm=700, far_mm=1200, seed=seed)
    power = rng.uniform(0.75, 1.3, (COUNT, 1)) * rng.uniform(0.96, 1.04, (COUNT, 3))
    sessions = []
    for k in range(SESSIONS):
        world = session_world(10_000 + 100 * seed + k, "two")
        world.lights, world.flash_radius, world.flash_aspect = lights, 25.0, 0.0
        world.powers = 0.7 * power / max(world_peak(world, ball, power) for ball in world.balls)
        frames = photograph(world, Sensor(full_well_e=15000, blur_px=0.6), np.random.default_rng([seed, k]))
        own = calibrate(frames, world.camera, world.requests())
        sessions.append(MeasuredLights(f"s{k}", own.lights, world.camera, own.position_covariance_mm2))
    rig = pool_sessions(sessions)
    assert not rig.warnings
    found = rig.lights.seen_from(REFERENCE)
    off = angular_error_deg(found.directions, unit(lights - REFERENCE))
    level = power / np.sum((lights - REFERENCE) ** 2, 1)[:, None]
    error = np.sqrt(np.mean((found.intensities / (level / level.mean(0)) - 1) ** 2))
    assert off.max() < 0.1
    assert error < 0.005
