"""How outline and shading count together, and what that says of the pose."""

import numpy as np
import pytest

from align.pose.full_resolution import CHECKED, EDGE_BIAS_PX, EDGE_DOUBT_PX, UNMODELLED, FinalEvidence, ObservedObject
from align.pose.motion import nudge
from align.pose.outline_edges import EdgePictures
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def seen(world):
    pictures = EdgePictures.of(world.photographs)
    return ObservedObject.of(RayCaster(world.mesh), world.photographs, pictures, count=1500, cells=100)


def test_what_can_check_the_shading_bounds_what_it_counts_for(world, seen):
    """By the number of its samples it counted for a hundred times the outline, and bronzes were ten times too sure."""
    here = FinalEvidence(seen, world.pose, 6.0)
    outline, shading, _ = here.weighed.weights
    most = CHECKED / here.shading_sigma
    assert shading <= most * outline * (1 + 1e-9)
    assert len(here.shading(world.pose).residuals) > 2 * most * len(here.edges.pixels)


def test_edges_that_lie_where_they_may_not_widen_the_doubt(world, seen):
    """Nearer by 2 %, the outline lies outside its edges all round."""
    middle = world.pose.apply(world.mesh.center_mm)
    right = FinalEvidence(seen, world.pose, 6.0)
    near = FinalEvidence(seen, nudge(world.pose, [0, 0, 0, *(-0.02 * middle)], middle), 6.0)
    assert near.edges.bias_px > right.edges.bias_px + 0.3
    for one in (right, near):
        units = one.steps(1.0)
        alone = UNMODELLED * np.linalg.inv(one.weighed.information) * units * units[:, None]
        excess = max(1.0, ((one.edges.bias_px - EDGE_BIAS_PX) / EDGE_DOUBT_PX) ** 2)
        np.testing.assert_allclose(one.covariance(), excess * alone, rtol=1e-6)
    assert excess > 5
