"""A scan is probe enough: where it stands and where the lights stood come from its own photographs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align.light_probe.from_scan import lights_from_scan
from align.light_probe.joint_equations import JointEquations, changed, light_slopes, nearness_of
from align.light_probe.joint_fit import begin, settled
from align.mask.object_mask import find_object
from align.pose.photographed import Photographs
from align.scan.smooth_normals import smooth_normals
from fixtures.mesh_scene import random_scene
from fixtures.mesh_shapes import ball, relief, scan_of
from scene.errors import AlignError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.rays import RayCaster


def _found(world, mesh=None, **how):
    mesh = mesh or world.mesh
    normals, sigma_deg = smooth_normals(mesh)
    unknown = replace(world.photographs, lights=Lights.unknown(world.frames.names))
    return lights_from_scan(RayCaster(mesh, normals), sigma_deg, unknown, **how)


def _places_off(found, truth):
    """Distance of each light from where it is, of its distance from the object."""
    far = np.linalg.norm(truth.positions_mm - truth.reference_point_mm, axis=1)
    return np.linalg.norm(found.positions_mm - truth.positions_mm, axis=1) / far


@pytest.fixture(scope="module")
def found(world):
    return _found(world)


@pytest.fixture(scope="module")
def at_truth(world):
    """(equations, lights, evidence) at the true pose under the true lights."""
    lights = world.lights.seen_from(world.pose.apply(world.mesh.center_mm))
    photographs = replace(world.photographs, lights=lights)
    evidence = begin(RayCaster(world.mesh), photographs, world.pose, count=1200, cells=120)
    doubt = np.full(len(evidence.seen.samples.pixels), 0.3)
    return JointEquations.about(evidence, doubt, near=True), lights, evidence


@pytest.mark.full
def test_lights_and_pose_come_from_photographs_and_scan_alone(world, found):
    assert found.lights.model == "near"
    assert np.median(angular_error_deg(found.lights.directions, world.lights.directions)) < 0.3
    assert angular_error_deg(found.lights.directions, world.lights.directions).max() < 0.6
    assert np.median(_places_off(found.lights, world.lights)) < 0.03
    truth = world.lights.seen_from(found.lights.reference_point_mm)
    np.testing.assert_allclose(found.lights.intensities, truth.intensities, rtol=0.01)
    assert (found.pose.inverse() @ world.pose).angle_deg() < 0.3
    assert found.lights.white_value is None


@pytest.mark.full
def test_the_sigmas_are_honest(world, found):
    """Neither smaller than the errors, nor so large that they say nothing."""
    off = angular_error_deg(found.lights.directions, world.lights.directions) / np.sqrt(2)
    assert 0.2 < np.sqrt(np.mean((off / found.lights.direction_sigma_deg) ** 2)) < 3
    truth = world.lights.seen_from(found.lights.reference_point_mm)
    off = np.log(found.lights.intensities / truth.intensities).mean(1)
    assert 0.1 < np.sqrt(np.mean((off / found.lights.intensity_sigma) ** 2)) < 3
    far = np.linalg.norm(truth.positions_mm - truth.reference_point_mm, axis=1)
    off = np.log(nearness_of(found.lights) * far)
    assert 0.1 < np.sqrt(np.mean((off / found.distance_sigma) ** 2)) < 3
    turn = np.sqrt(np.trace(found.covariance[:3, :3]))
    assert (found.pose.inverse() @ world.pose).angle_deg() < 3 * np.degrees(turn)


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("start", ["near", "distant"])
def test_slopes_are_those_of_the_change(world, column, start):
    """Of every unknown, from near lights and from distant ones; a wrong sign of any would fail."""
    lights = world.lights if start == "near" else replace(world.lights, positions_mm=None)
    generator = np.random.default_rng(3)
    points = lights.reference_point_mm + 40 * generator.standard_normal((30, 3))
    normals = unit(generator.standard_normal((30, 3)))
    step = np.zeros((len(lights), 4))
    step[:, column] = small = 1e-6 if column == 3 else 1e-5

    def shade(some):
        strength = (some.intensities / lights.intensities).mean(1)
        return strength[:, None] * np.einsum("npk,pk->np", some.toward(points), normals)

    # The least nearness that is tried stands in for none.
    before = changed(lights, np.zeros((len(lights), 4)), 0.5)
    slopes = light_slopes(before, points, normals, near=True)[..., column]
    measured = (shade(changed(before, step, 0.5)) - shade(before)) / small
    np.testing.assert_allclose(slopes, measured, rtol=2e-3, atol=2e-4 * np.abs(slopes).max())


def test_at_the_truth_no_step_is_large_and_sectors_agree(at_truth):
    equations, lights, evidence = at_truth
    step = equations.solve()[0]
    turns = equations.lights_of(step)
    assert np.degrees(np.abs(turns[:, :2])).max() < 0.5
    assert abs(turns[:, 2].sum()) < 1e-3
    assert np.abs(step[:6]).max() < 1.0
    assert evidence.seen.lights is lights


def test_a_spoilt_light_and_a_moved_scan_come_back_together(world):
    """All lights 5 degrees off, in turns, the scan 2 px: one fit of both."""
    lights = world.lights.seen_from(world.pose.apply(world.mesh.center_mm))
    wrong = changed(
        lights, np.tile([0.09, -0.05, 0.1, 0.0], (len(lights), 1)) * np.resize([1, -1], len(lights))[:, None], 50.0
    )
    normals, sigma_deg = smooth_normals(world.mesh)
    photographs = replace(world.photographs, lights=wrong)
    moved = begin(RayCaster(world.mesh, normals), photographs, world.pose, count=800, cells=100)
    there = settled(moved, sigma_deg, near=True, rounds=6)
    found = there.evidence.seen.lights
    assert angular_error_deg(wrong.directions, lights.directions).min() > 4
    assert np.median(angular_error_deg(found.directions, lights.directions)) < 0.5


def test_too_few_frames_are_refused(world):
    frames = world.frames.only(slice(4))
    photographs = Photographs(world.camera, frames, Lights.unknown(frames.names), world.mask)
    with pytest.raises(AlignError, match="4 frames are too few for the scan to tell the lights"):
        lights_from_scan(RayCaster(world.mesh), np.zeros(len(world.mesh.vertices)), photographs)


def _box(height):
    import trimesh

    box = trimesh.creation.box((90, 70, height))
    for _ in range(5):
        box = box.subdivide()
    return Mesh(np.array(box.vertices), np.array(box.faces))


@pytest.mark.full
def test_a_flat_thing_does_not_tell_lights(build):
    """Seen from the front it has one normal: either no sample is left that speaks, or the sigmas say how little."""
    with pytest.raises(AlignError, match=r"too flat.*lights\.file"):
        _found(build(_box(20.0), Rotation.from_rotvec([0.3, 0.3, 0.0]).as_matrix()))


@pytest.mark.full
def test_a_ball_turns_as_it_likes_and_tells_its_lights_all_the_same(build, rotations):
    world = build(ball(50.0), rotations[0])
    found = _found(world)
    assert np.median(angular_error_deg(found.lights.directions, world.lights.directions)) < 0.6
    assert any("nearly symmetric" in text for text in found.warnings)


@pytest.mark.full
def test_lights_far_away_are_distant(build, bumpy, rotations):
    world = build(bumpy, rotations[0], away=1000.0)
    found = _found(world)
    assert found.lights.model == "distant"
    assert np.isnan(found.distance_sigma).all()
    assert np.median(angular_error_deg(found.lights.directions, world.lights.directions)) < 0.2


@pytest.mark.full
def test_the_scans_own_frame_and_the_frames_order_change_nothing(world, found, rotations):
    turned = replace(world.mesh, vertices=world.mesh.vertices @ rotations[2].T + [30.0, -200.0, 7.0])
    order = np.random.default_rng(4).permutation(len(world.lights))
    again = _found(replace(world, frames=world.frames.only(order)), turned)
    error = angular_error_deg(again.lights.directions, found.lights.directions[order])
    # Another start ends elsewhere within what this small picture tells.
    assert np.median(error) < 0.5
    np.testing.assert_allclose(again.lights.intensities, found.lights.intensities[order], rtol=0.01)


@pytest.mark.full
def test_noise_of_the_scan_does_not_push_the_lights_away():
    """Taken as exact, noisy normals flatten what shading tells: lights seem farther. Known as noisy, they do not."""
    scene = random_scene(relief(), 2002, width=480, height=320, flashes=12)
    scene = replace(scene, gloss=0.0)
    scan = scan_of(scene.mesh, np.random.default_rng(9), faces=20_000, noise_mm=0.05)
    frames, lights = scene.photograph(), scene.lights.seen_from(scene.pose.apply(scan.center_mm))
    assert lights.positions_mm is not None
    far = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    photographs = Photographs(scene.camera, frames, lights, find_object(frames, scene.camera, []).mask)
    normals, sigma_deg = smooth_normals(scan)
    start = begin(RayCaster(scan, normals), photographs, scene.pose, count=3000, cells=160)

    def range_off(sigma_deg):
        joint = settled(start, sigma_deg, near=True)
        return float(np.median(1 / nearness_of(joint.evidence.seen.lights) / far)) - 1

    assert range_off(np.zeros_like(sigma_deg)) > 0.1
    assert abs(range_off(sigma_deg)) < 0.04
