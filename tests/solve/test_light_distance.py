"""Lights whose directions alone are given: how far they are, by the object."""

import numpy as np
import pytest

from benchmarks.unknown_lights import photographed
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.problem import Problem
from solve.solve import solve
from solve.whole.near import find_positions


def directions_only(lights: Lights) -> Lights:
    return Lights(lights.names, lights.directions, lights.intensities).normalised()


def problem_of(frames, lights, camera, mask):
    return Problem(frames, lights, camera, mask, slice(0, len(mask)))


@pytest.mark.full
@pytest.mark.parametrize(("shape", "seed"), [("blob", 20_400), ("potato", 20_401)])
def test_distances_and_normals(shape, seed):
    """Flashes 0.5 to 0.9 m away."""
    frames, lights, camera, mask, normals, *_ = photographed(shape, seed, 1.5)
    given = directions_only(lights)
    placed = find_positions(problem_of(frames, given, camera, mask))
    found = placed.lights
    assert "without positions" in placed.cautions[0]
    # Of perspective pictures without a scale, everything is told up to one: the object is put at 1000.
    scale = -lights.reference_point_mm[2] / 1000
    far = np.linalg.norm(found.positions_mm - found.reference_point_mm, axis=1) * scale
    ratio = far / np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    assert np.mean(ratio) == pytest.approx(1, abs=0.15)
    # Not one distance for all: theirs differ by a sixth.
    assert np.std(ratio) < 0.06
    estimate = solve("near", frames, given, camera, mask)
    assert any("without positions" in doubt for doubt in estimate.warnings)
    assert estimate.lights is not None
    assert estimate.lights.positions_mm is not None
    error = np.nanmedian(angular_error_deg(estimate.normals, normals)[mask])
    distant = solve("iterative", frames, given, camera, mask)
    assert error < 0.3 * np.nanmedian(angular_error_deg(distant.normals, normals)[mask])


@pytest.mark.full
def test_distant_lights_stay_distant():
    frames, lights, camera, mask, *_ = photographed("blob", 20_402, 40.0)
    problem = problem_of(frames, directions_only(lights), camera, mask)
    assert find_positions(problem) is problem
