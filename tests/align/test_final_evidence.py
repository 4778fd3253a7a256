"""What outline and shading say of a pose: how they count together, and which of two poses the photographs are of."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.full_resolution import CHECKED, EDGE_BIAS_PX, EDGE_DOUBT_PX, UNMODELLED, FinalEvidence, ObservedObject
from align.pose.motion import nudge
from align.pose.outline_edges import EdgePictures
from align.pose.search import compare_poses, pixel_costs
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def evidence_at(world):
    pictures = EdgePictures.of(world.photographs)

    def at(pose, mesh=world.mesh):
        seen = ObservedObject.of(RayCaster(mesh), world.photographs, pictures, count=1500, cells=100)
        return FinalEvidence(seen, pose, 6.0)

    return at


def test_the_true_pose_wins_from_either_side(world, evidence_at):
    true = evidence_at(world.pose)
    for degrees in (3, 20, 180):
        twist = [0, 0, np.radians(degrees), 0, 0, 0]
        other = evidence_at(nudge(world.pose, twist, world.pose.apply(world.mesh.center_mm)))
        won, lost = compare_poses(true, other), compare_poses(other, true)
        assert won > 4
        assert lost == pytest.approx(-won)


def test_a_pose_does_not_differ_from_itself(world, evidence_at):
    true = evidence_at(world.pose)
    assert abs(compare_poses(true, true)) < 0.01


def test_a_hole_in_view_does_not_speak_against_a_pose(world, evidence_at):
    """A scan's hole lies where it stood, not where it fits badly: a wrong pose that shows none won by it."""
    mesh = world.mesh
    seen = world.pose.apply(mesh.vertices)
    front = world.pose.apply(mesh.center_mm)[2] + 0.8 * mesh.radius_mm
    open_front = replace(mesh, faces=mesh.faces[~(seen[:, 2] > front)[mesh.faces].any(1)])
    turned = nudge(world.pose, [0, 0, np.radians(20), 0, 0, 0], world.pose.apply(mesh.center_mm))
    true, other = evidence_at(world.pose, open_front), evidence_at(turned)
    hole = ~np.isfinite(pixel_costs(true, 0.05))
    assert 0.02 < hole.mean() < 0.5
    assert compare_poses(true, other) > 4


def test_a_scan_seen_from_its_open_side_explains_nothing(world, evidence_at):
    seen = world.pose.apply(world.mesh.vertices)
    front = (world.pose.rotate(world.mesh.vertex_normals) * seen).sum(1) < 0
    back_only = replace(world.mesh, faces=world.mesh.faces[~front[world.mesh.faces].any(1)])
    true, inside = evidence_at(world.pose), evidence_at(world.pose, back_only)
    assert compare_poses(true, inside) > 4


def test_what_can_check_the_shading_bounds_what_it_counts_for(world, evidence_at):
    """By the number of its samples it counted for a hundred times the outline, and bronzes were ten times too sure."""
    here = evidence_at(world.pose)
    outline, shading, _ = here.weighed.weights
    most = CHECKED / here.shading_sigma
    assert shading <= most * outline * (1 + 1e-9)
    assert len(here.shading(world.pose).residuals) > 2 * most * len(here.edges.pixels)


def test_edges_that_lie_where_they_may_not_widen_the_doubt(world, evidence_at):
    """Nearer by 2 %, the outline lies outside its edges all round."""
    middle = world.pose.apply(world.mesh.center_mm)
    right = evidence_at(world.pose)
    near = evidence_at(nudge(world.pose, [0, 0, 0, *(-0.02 * middle)], middle))
    assert near.edges.bias_px > right.edges.bias_px + 0.3
    for one in (right, near):
        units = one.steps(1.0)
        alone = UNMODELLED * np.linalg.inv(one.weighed.information) * units * units[:, None]
        excess = max(1.0, ((one.edges.bias_px - EDGE_BIAS_PX) / EDGE_DOUBT_PX) ** 2)
        np.testing.assert_allclose(one.covariance(), excess * alone, rtol=1e-6)
    assert excess > 5
