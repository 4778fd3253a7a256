"""Photographs too few to tell normals, or of unknown lights: the outline places the scan, and so it is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align.pose.photographed import Photographs
from align.pose.register import register
from scene.lights import Lights
from scene.pose import Pose
from tests.align.test_register import apart

INSIDE = 12.592
"""95 % quantile of chi-square with 6 degrees of freedom."""


def deviations(found, true: Pose, middle_mm) -> float:
    """Return the squared distance of the true pose from the one found, in standard deviations."""
    turn = Rotation.from_matrix(true.rotation @ found.pose.rotation.T).as_rotvec()
    twist = np.append(turn, true.apply(middle_mm) - found.pose.apply(middle_mm))
    return float(twist @ np.linalg.solve(found.covariance, twist))


@pytest.mark.full
@pytest.mark.parametrize("lit", [3, 2, 1, "unknown"])
def test_the_outline_places_a_scan_and_states_the_larger_doubt(world, lit):
    some = slice(None) if lit == "unknown" else slice(0, 4 * lit, 4)
    frames, lights = world.frames.only(some), world.lights.only(some)
    lights = Lights.unknown(frames.names) if lit == "unknown" else lights.normalised()
    found = register(world.mesh, Photographs(world.camera, frames, lights, world.mask), None)
    assert apart(world, found.pose)[0] < 1
    assert deviations(found, world.pose, world.mesh.center_mm) < INSIDE
    (told, *_) = found.warnings
    assert f"by the outline alone: with {len(frames)} photographs" in told
    assert f"{found.sigma_deg:.2g} degrees" in told
    whole = register(world.mesh, world.photographs, world.normals, start=found.pose)
    assert found.sigma_mm > 2 * whole.sigma_mm
    assert "outline alone" not in " ".join(whole.warnings)
