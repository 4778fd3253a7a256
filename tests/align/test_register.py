"""The pose comes back from any orientation; a scan that is not the object's is refused."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align.pose.motion import nudge
from align.pose.photographed import thinned
from align.pose.register import register
from align.pose.scan_view import View
from align.truth import ground_truth
from fixtures.mesh_shapes import ball, scan_of
from scene.camera import Camera
from scene.errors import AlignError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster


def apart(world, pose):
    """Return rms pixels between the scan's images at two poses, and degrees between the poses."""
    points = world.mesh.vertices
    gap = world.camera.project(pose.apply(points)) - world.camera.project(world.pose.apply(points))
    return np.sqrt(np.mean((gap**2).sum(1))), (pose.inverse() @ world.pose).angle_deg()


def assert_found(world, pose, px, deg):
    """Assert that a pose shows the scan within so many pixels, turned by so many degrees at most."""
    assert apart(world, pose)[0] < px
    assert apart(world, pose)[1] < deg


INSIDE = 12.592
"""95 % quantile of chi-square with 6 degrees of freedom."""


def deviations(world, found) -> float:
    """Return the squared distance of the true pose from the one found, in standard deviations."""
    turn = Rotation.from_matrix(world.pose.rotation @ found.pose.rotation.T).as_rotvec()
    middle_mm = world.mesh.center_mm
    twist = np.append(turn, world.pose.apply(middle_mm) - found.pose.apply(middle_mm))
    return float(twist @ np.linalg.solve(found.covariance, twist))


def run(world, **changes):
    mesh, normals = (changes.pop(name, getattr(world, name)) for name in ("mesh", "normals"))
    other = {name: changes.pop(name) for name in ("frames", "lights", "mask") if name in changes}
    return register(mesh, replace(world.photographs, **other), normals, **changes)


@pytest.mark.full
@pytest.mark.parametrize("index", [0, 1])
def test_any_orientation_is_found_to_a_tenth_of_a_pixel(bumpy, rotations, build, index):
    """Near lights, cast shadows, uneven albedo and gloss; the normals given are several degrees off."""
    world = build(bumpy, rotations[index], gloss=0.2 * index)
    truth = ground_truth(bumpy, world.pose, world.camera)
    assert np.nanmedian(angular_error_deg(world.normals, truth.normals)) > 3
    calls = []
    with ThreadPoolExecutor(2) as executor:
        found = run(world, executor=executor, progress=lambda done, total: calls.append((done, total)))
    # What gloss does is told by the photographs, and costs some of what they tell of the pose.
    assert_found(world, found.pose, 0.1 + 0.1 * index, 0.15 + 0.15 * index)
    assert found.residual_px < 0.3
    assert found.evidence["misfit"] < 0.4
    assert found.warnings == ()
    assert 0 < found.sigma_deg < 0.3
    assert 0 < found.sigma_mm < 1
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    assert calls[-1][0] == calls[-1][1]
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)
    registered = ground_truth(bumpy, found.pose, world.camera, covariance=found.covariance)
    assert np.nanmedian(angular_error_deg(registered.normals, truth.normals)) < 0.15 + 0.1 * index


@pytest.fixture(scope="module")
def bronze(bumpy, rotations, build):
    """A metal on a lit table, which sends light back: the normals that are given are no normals."""
    return build(bumpy, rotations[1], metal=1.0, bounce=0.15, table=0.1)


@pytest.mark.full
def test_a_metal_is_found_and_its_mirror_image_refused(bronze):
    px, _ = apart(bronze, run(bronze).pose)
    assert px < 0.15
    mirrored = replace(bronze.mesh, vertices=bronze.mesh.vertices * [1, -1, 1], faces=bronze.mesh.faces[:, ::-1])
    with pytest.raises(AlignError, match=r"mirrored only|does not fit"):
        run(bronze, mesh=mirrored)


@pytest.mark.full
def test_a_mask_with_the_shadow_in_it_and_out_to_the_border(bumpy, rotations, build):
    """A third too much on one side, a part of the object lacking, a strip along the border."""
    world = build(bumpy, rotations[2], table=0.1)
    mask = world.mask | np.roll(world.mask, 9, axis=1)
    mask[:, 60:70] &= ~world.mask[:, 60:70] | (np.arange(120) < 60)[:, None]
    mask[:, :3] = True
    found = run(world, mask=mask, normals=np.where(mask[..., None], np.nan_to_num(world.normals, nan=0.577), np.nan))
    assert_found(world, found.pose, 0.1, 0.15)


@pytest.mark.full
def test_a_scan_in_another_frame_gives_the_same_truth(world, rotations):
    """The scan's own frame is arbitrary: far away and turned, decimated to its front, noisy."""
    motion = Pose.from_rotation_translation(rotations[2], [900.0, -2000.0, 300.0])
    generator = np.random.default_rng(4)
    faces = world.mesh.faces
    # No back: what faced away from the camera by far was never scanned.
    faces = faces[world.pose.rotate(world.mesh.face_normals[:])[:, 2] > -0.6]
    vertices = world.mesh.vertices + 0.03 * generator.standard_normal(world.mesh.vertices.shape)
    used, inverse = np.unique(faces, return_inverse=True)
    scan = Mesh(motion.apply(vertices)[used], inverse.reshape(-1, 3))
    found = run(world, mesh=scan)
    assert_found(world, found.pose @ motion, 0.15, 0.2)


@pytest.mark.full
def test_orthographic_camera_and_distant_lights(bumpy, rotations, build):
    camera = Camera(160, 120, 0.6, 0.6, 83.0, 57.0, projection="orthographic")
    world = build(bumpy, rotations[1], camera=camera, away=1000.0)
    distant = Lights(world.lights.names, world.lights.directions, world.lights.intensities)
    found = run(world, lights=distant)
    assert_found(world, found.pose, 0.1, 0.15)
    assert found.warnings == ()
    assert found.covariance[5, 5] == pytest.approx(0, abs=1e-12)


@pytest.mark.full
def test_a_mirrored_scan_is_called_so(world):
    mirrored = replace(world.mesh, vertices=world.mesh.vertices * [1, -1, 1], faces=world.mesh.faces[:, ::-1])
    with pytest.raises(AlignError, match="mirrored only"):
        run(world, mesh=mirrored)


@pytest.mark.full
def test_another_objects_scan_is_refused_with_numbers(world):
    generator = np.random.default_rng(9)
    other = world.mesh.vertices * [1.0, 0.8, 0.6]
    other = other * (1 + 0.25 * np.sin(other @ generator.standard_normal(3) / 12))[:, None]
    with pytest.raises(AlignError, match=r"does not fit.*overlaps the mask by [\d.]+ %.*degrees"):
        run(world, mesh=replace(world.mesh, vertices=other))


@pytest.mark.full
def test_an_object_cut_by_the_border_is_named_where_its_scan_finds_no_place(world):
    cut = np.zeros_like(world.mask)
    cut[:60, :80] = True
    with pytest.raises(AlignError, match=r"139 of the mask's pixels lie on the image's border.*reshoot"):
        run(world, mask=cut, normals=np.full((*cut.shape, 3), 0.577))


@pytest.mark.full
def test_a_wrong_unit_is_noticed(world):
    with pytest.raises(AlignError, match=r"2[3-8]\.?\d* times too large.*scan_unit"):
        run(world, mesh=replace(world.mesh, vertices=25.4 * world.mesh.vertices))


@pytest.mark.full
def test_two_poses_that_look_alike_are_reported(build):
    """A brick with a tiny notch looks the same after half a turn."""
    sphere = ball(1.0, 4)
    p = np.sign(sphere.vertices) * np.abs(sphere.vertices) ** 0.5
    mesh = Mesh(p / np.linalg.norm(p, ord=4, axis=1, keepdims=True) * [50, 32, 20.0], sphere.faces)
    c, s = np.cos(0.5), np.sin(0.5)
    world = build(mesh, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]))
    found = run(world)
    assert any("two poses fit nearly as well" in warning for warning in found.warnings)
    assert found.evidence["second_angle_deg"] > 90


def test_input_that_cannot_work_is_refused_before_the_search(world):
    cut = np.zeros_like(world.mask)
    with pytest.raises(AlignError, match="too few"):
        run(world, mask=cut & False)
    with pytest.raises(AlignError, match="normals are known at"):
        run(world, normals=np.full((*cut.shape, 3), np.nan))


def test_normals_are_asked_for_where_the_search_reads_them():
    mask = np.zeros((1700, 1611), bool)
    mask[100:1500, 90:1400] = True
    few = thinned(mask)
    assert (few <= mask).all()
    assert few.sum() == mask[::3, ::3].sum()
    assert (few[::3, ::3] == mask[::3, ::3]).all()


@pytest.mark.full
def test_a_large_picture_is_searched_shrunken(world, monkeypatch):
    """The rough search on every second pixel leads to the same pose."""
    monkeypatch.setattr("align.pose.photographed.ACROSS", 40)
    assert_found(world, run(world).pose, 0.1, 0.15)


@pytest.mark.full
def test_a_noisy_scan_seen_through_its_hole(bumpy, rotations, build):
    """Noise of 0.05 mm, and the hole where it stood on the scanner's table toward the camera.

    The inside, seen through the hole, was taken for surface: the pose came out tens of degrees wrong, without a word.
    """
    world = build(bumpy, rotations[1])
    scan = scan_of(
        bumpy,
        np.random.default_rng(10_011),
        faces=15_000,
        noise_mm=0.05,
        unscanned=-world.pose.rotation[2],
    )
    seen_inside = View(RayCaster(scan), world.camera, world.pose).hits(world.camera.grid().reshape(-1, 2))
    assert (seen_inside.hit & ~seen_inside.front).sum() > 0.08 * seen_inside.hit.sum()
    found = run(world, mesh=scan)
    assert_found(world, found.pose, 0.25, 0.5)
    assert "nearly symmetric" not in " ".join(found.warnings)


def test_a_start_is_refined_and_nothing_else_is_looked_for(world, monkeypatch):
    monkeypatch.setattr("align.pose.search.find_starts", None)
    beside = nudge(world.pose, [0.03, -0.02, 0.04, 2.0, -1.0, 3.0], world.pose.apply(world.mesh.center_mm))
    assert_found(world, run(world, start=beside).pose, 0.1, 0.15)


@pytest.mark.full
@pytest.mark.parametrize("lit", [3, 2, 1, "unknown"])
def test_the_outline_places_a_scan_and_states_the_larger_doubt(world, lit):
    """Photographs too few to tell normals, or of unknown lights: so it is said."""
    some = slice(None) if lit == "unknown" else slice(0, 4 * lit, 4)
    frames, lights = world.frames.only(some), world.lights.only(some)
    lights = Lights.unknown(frames.names) if lit == "unknown" else lights.normalised()
    found = run(world, frames=frames, lights=lights, normals=None)
    assert apart(world, found.pose)[0] < 1
    assert deviations(world, found) < INSIDE
    (told, *_) = found.warnings
    assert f"by the outline alone: with {len(frames)} photographs" in told
    assert f"{found.sigma_deg:.2g} degrees" in told
    whole = run(world, start=found.pose)
    assert found.sigma_mm > 2 * whole.sigma_mm
    assert "outline alone" not in " ".join(whole.warnings)
