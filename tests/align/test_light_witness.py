"""The registered scan tells which lights are off, by how much, and puts them right without harm to the others."""

from dataclasses import replace

import numpy as np
import pytest

from align.light_probe.joint_fit import ask_scan, refined
from align.pose.scan_view import View
from lab.registration import _by_the_scan
from scene.normals import angular_error_deg, unit
from scene.rays import RayCaster

WRONG = 3


def _spoilt(lights, turn_deg, brighter):
    """One light turned, and stated so much too dim; the rest as they are, and each with the sigma of a good session."""
    directions = lights.directions.copy()
    axis = unit(np.cross(directions[WRONG], [0.3, 0.5, 0.2]))
    directions[WRONG] = unit(directions[WRONG] + np.tan(np.deg2rad(turn_deg)) * axis)
    far = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1, keepdims=True)
    intensities = lights.intensities.copy()
    intensities[WRONG] *= np.exp(-brighter)
    return replace(
        lights,
        directions=directions,
        positions_mm=lights.reference_point_mm + far * directions,
        intensities=intensities,
        direction_sigma_deg=np.full(len(lights), 0.2),
        intensity_sigma=np.full(len(lights), 0.01),
    ).normalised()


def _asked(world, lights):
    photographs = replace(world.photographs, lights=lights)
    return ask_scan(View(RayCaster(world.mesh), world.camera, world.pose), photographs)


@pytest.fixture(scope="module")
def glossy(build, bumpy, rotations):
    return build(bumpy, rotations[1], gloss=0.3, table=0.4)


@pytest.mark.parametrize(("turn", "brighter"), [(4.0, 0.0), (0.0, 0.12), (2.0, -0.08)])
@pytest.mark.parametrize("kind", ["matte", "glossy"])
def test_the_light_that_is_off_is_named_and_put_right(world, glossy, kind, turn, brighter):
    scene = world if kind == "matte" else glossy
    lights = _spoilt(scene.lights, turn, brighter)
    witness = _asked(scene, lights)
    assert np.flatnonzero(witness.off(lights)).tolist() == [WRONG]
    assert witness.brighter[WRONG] == pytest.approx(brighter, abs=0.025)
    better = refined(lights, witness)
    error = angular_error_deg(better.directions, scene.lights.directions)
    assert error[WRONG] < (0.2 if kind == "matte" else 1.0)
    assert np.delete(error, WRONG).max() < 0.25
    np.testing.assert_allclose(better.intensities, scene.lights.intensities, rtol=0.015)
    assert "moved by the scan's shading" in better.flags[WRONG]
    # Seen from the object the light stands where its direction says.
    toward = unit(better.positions_mm - better.reference_point_mm)
    np.testing.assert_allclose(toward, better.directions, atol=1e-9)


def test_right_lights_are_left_alone(world, glossy):
    """What gloss and bounced light bend is no light's fault: the usual change of a light is the witness's own error."""
    for scene in (world, glossy):
        lights = _spoilt(scene.lights, 0.0, 0.0)
        witness = _asked(scene, lights)
        assert not witness.off(lights).any()
        assert angular_error_deg(refined(lights, witness).directions, lights.directions).max() < 0.1


def test_three_frames_contradict_nobody(world):
    """Three lights explain any pixel: nothing is asked, no light is moved, and none is surer than it was."""
    every = slice(0, None, 4)
    lights = _spoilt(world.lights, 4.0, 0.0)
    few, frames = lights.only(every).normalised(), world.frames.only(every)
    photographs = replace(world.photographs, frames=frames, lights=few)
    assert len(photographs.frames) == len(few) == 3
    witness = ask_scan(View(RayCaster(world.mesh), world.camera, world.pose), photographs)
    better = refined(few, witness)
    assert not witness.moved.any()
    np.testing.assert_allclose(better.directions, few.directions, atol=1e-12)
    np.testing.assert_array_equal(better.direction_sigma_deg, few.direction_sigma_deg)


def test_an_unknown_sigma_is_no_bar(world):
    lights = _spoilt(world.lights, 6.0, 0.0)
    unknown = replace(
        lights, direction_sigma_deg=np.full(len(lights), np.nan), intensity_sigma=np.full(len(lights), np.nan)
    )
    better = refined(unknown, _asked(world, unknown))
    assert angular_error_deg(better.directions, world.lights.directions)[WRONG] < 0.3
    assert better.direction_sigma_deg[WRONG] < 0.5


def test_a_contradiction_is_a_warning_and_a_refinement_only_by_request(world):
    lights = _spoilt(world.lights, 4.0, 0.0)
    view = View(RayCaster(world.mesh), world.camera, world.pose)
    kept, result, (warning,) = _by_the_scan(view, replace(world.photographs, lights=lights), refine=False)
    assert kept is lights
    assert "flash_003 (by 3.9 degrees" in warning
    assert "--refine-lights" in warning
    assert result["off"] == ["flash_003"]
    assert not result["refined"]
    moved, result, (warning,) = _by_the_scan(view, replace(world.photographs, lights=lights), refine=True)
    assert angular_error_deg(moved.directions, world.lights.directions)[WRONG] < 0.2
    assert "judged by the same scan" in warning
    assert result["refined"]
