"""The twin of a scan: closed forms, known points, and what must not change it."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
import trimesh

from fixtures.lit_surfaces import ball_seen, even_cap
from fixtures.mesh_shapes import ball
from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import PEDESTAL
from scene.mesh import Mesh
from scene.pose import Pose, rotation_from_vector
from scene.store import Store
from tests.twin import twin_scenes
from tests.twin.twin_scenes import NEEDS_LLVM
from twin.description.description import Sampling
from twin.engines.render import render_scene
from twin.scan_scene import scan_scene
from twin.visibility import Sight

pytestmark = pytest.mark.render

CAMERA = Camera(96, 80, 150.0, 150.0, 53.4, 35.2)
CENTER = np.array([-4.0, -6.0, -300.0])
ORTHOGRAPHIC = Camera(96, 80, 0.6, 0.6, 53.4, 35.2, projection="orthographic")
HERE, AT_CENTER = Pose(np.eye(4)), Pose.from_rotation_translation(np.eye(3), CENTER)
BRIGHT = np.full(3, 0.8)
ROWS, COLUMNS = np.mgrid[:80, :96]


def render(scan, lights, albedo=0.5, *, pose=HERE, camera=CAMERA, engine="mitsuba", samples=None, depth=3, **how):
    """Render a scan with its albedo, one for all or a picture."""
    if np.ndim(albedo) == 0:
        albedo = np.full((camera.height, camera.width, 3), albedo, np.float32)
    sight = Sight(scan.moved(pose.matrix), camera, lights)
    scene, warnings = scan_scene(sight, albedo, Sampling(engine, samples, depth))
    rendered = render_scene(scene, **how)
    return replace(rendered, warnings=(*warnings, *rendered.warnings))


def squares(points, half):
    """Return squares that face the camera, centred at points (P, 3)."""
    corner = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(points))[:, None, None]
    return Mesh((np.asarray(points, float)[:, None] + corner).reshape(-1, 3), faces.reshape(-1, 3))


def distant(*directions, **more):
    return twin_scenes.lights(*directions, **{"white": BRIGHT, **more})


def near(*positions, at=CENTER, **more):
    return twin_scenes.lights(*(np.array(positions) - at), near=True, middle=np.array(at, float), white=BRIGHT, **more)


def middle_of(weight):
    return np.array([(weight * COLUMNS).sum(), (weight * ROWS).sum()]) / weight.sum()


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("change", "engine"),
    [
        ({}, "mitsuba"),
        ({"fy": 158.0}, "mitsuba"),
        ({"distortion": (-0.2, 0.05, 0.004, -0.003, 0.0)}, "mitsuba"),
        ({"projection": "orthographic", "fx": 0.5, "fy": 0.5}, "mitsuba"),
        pytest.param({"fy": 158.0, "distortion": (-0.9, 0.5, 0.03, -0.04, 0.0)}, "many", marks=NEEDS_LLVM),
    ],
    ids=["pinhole", "oblong pixels", "distortion", "orthographic", "many"],
)
def test_known_points_are_rendered_where_the_camera_projects_them(sign, change, engine):
    camera = replace(CAMERA, cx=47.5 + sign * 9.3, cy=39.5 - sign * 7.7, **change)
    u, v = np.meshgrid([14.3, 40.8, 77.6], [11.7, 33.4, 66.2])
    wanted = np.stack([u, v], -1).reshape(-1, 2)
    points = [camera.points_at_depth(p, z) for p, z in zip(wanted, np.linspace(-330, -270, 9), strict=True)]
    mesh = squares(points, 4.0 if camera.is_orthographic else 3.0)
    straight = replace(camera, distortion=(0.0,) * 5).project(np.array(points))
    assert np.linalg.norm(straight - wanted, axis=1).max() > 1 or "distortion" not in change, "the lens matters here"
    image = render(mesh, distant([0, 0, 1]), camera=camera, engine=engine).frames.frame(0)[..., 1]
    for p in wanted:
        assert np.linalg.norm(middle_of(image * (np.hypot(COLUMNS - p[0], ROWS - p[1]) < 7)) - p) < 0.1


@pytest.mark.parametrize("camera", [CAMERA, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("is_near", [False, True])
def test_a_lambertian_ball_has_the_closed_form(camera, is_near):
    """Pixel = albedo * intensity * cos, to 1 %, with an albedo that varies over the picture and by channel.

    The lights' reference point lies beside the ball's middle.
    """
    # The scan's frame is another than the camera's, so a pose that is not applied, or applied twice, shows.
    turn, shift = rotation_from_vector([0.7, -0.4, 1.1]), np.array([30.0, 20.0, 10.0])
    pose = Pose.from_rotation_translation(turn, CENTER - turn @ shift)
    positions = CENTER + [[-150.0, 120.0, 160.0], [90.0, -60.0, 220.0]]
    beside = CENTER + [24.0, -24.0, 20.0]
    lights = near(*positions, at=beside, intensities=[[1.2, 0.9, 1.0], [0.8, 1.1, 1.0]])
    lights = lights if is_near else replace(lights, positions_mm=None)
    albedo = np.stack([0.2 + 0.004 * COLUMNS, 0.6 - 0.003 * COLUMNS, 0.3 + 0.003 * ROWS], -1).astype(np.float32)
    shape = ball(60.0)
    mesh = Mesh(shape.vertices + shift, shape.faces)
    frames = render(mesh, lights, albedo, pose=pose, camera=camera, depth=2, samples=64).frames
    points, normals, inside = ball_seen(camera, CENTER, 60.0, rim=0.35)
    vectors = lights.at(points[inside])
    for index in range(2):
        expected = albedo[inside] * np.einsum("pcx,px->pc", vectors[index], normals[inside])
        bright = expected.min(1) > 0.08
        ratio = frames.frame(index)[inside][bright] / expected[bright]
        assert bright.sum() > 300
        assert np.abs(ratio - 1).max() < 0.02
        assert np.abs(np.median(ratio, 0) - 1).max() < 0.003
        assert np.percentile(np.abs(ratio - 1), 95) < 0.01


@pytest.mark.full
def test_interreflection_in_a_bowl_is_that_of_an_integrating_sphere():
    """A white furnace with a closed form.

    Every point of a sphere's inside sees every other alike: a half sphere of reflectance r under an even sky of
    radiance 1 has the radiance r f / (1 - r (1 - f)), f = 1/2 the share of the missing half; r f without
    interreflection.
    """
    sphere = trimesh.creation.uv_sphere(50.0, count=[49, 64])
    # Its farther half; the inside is the outside here.
    faces = np.array(sphere.faces)[sphere.triangles_center[:, 2] < 0][:, ::-1]
    shape = Mesh(np.array(sphere.vertices) + [0, 0, -100.0], faces.copy())
    camera = Camera(40, 40, 0.36, 0.36, 19.5, 19.5, projection="orthographic")
    sky = distant(*even_cap(96, 90))
    inside, (r, f) = np.linalg.norm(camera.grid() - 19.5, axis=-1) < 0.36 * 42, (0.6, 0.5)
    for depth, expected in ((2, r * f), (3, r * f * (1 + r * (1 - f))), (12, r * f / (1 - r * (1 - f)))):
        rendered = render(shape, sky, r, camera=camera, samples=16, depth=depth)
        assert rendered.frames.read().mean(0)[inside].mean() * 2 == pytest.approx(expected, rel=0.01), depth


def test_the_white_ball_sets_interreflection_and_never_the_direct_light():
    mesh = squares([[0.0, 0.0, -300.0]], 60.0)
    floor = mesh.vertices @ rotation_from_vector([np.pi / 2, 0, 0]).T
    floor = floor - floor[0] + mesh.vertices[0]
    corner = Mesh(np.concatenate([mesh.vertices, floor]), np.concatenate([mesh.faces, mesh.faces[:, ::-1] + 4]))

    def mean(white, depth):
        return render(corner, distant([0.2, 0.8, 1.0], white=np.full(3, white)), depth=depth).frames.read().mean()

    direct = mean(0.8, 2)
    assert mean(1.6, 2) == pytest.approx(direct, rel=1e-4)
    bounced = {white: mean(white, 3) - direct for white in (0.8, 1.6)}
    assert bounced[0.8] > 0.02 * direct
    # Twice the white value is half the reflectance: one interreflection is half as strong.
    assert bounced[1.6] == pytest.approx(bounced[0.8] / 2, rel=0.05)


def test_frames_are_named_stored_and_the_same_wherever_they_are_rendered(tmp_path):
    lights, told = distant([-1, 1, 2], [1, 0, 2], [0, -1, 3]), []
    how = {"pose": AT_CENTER, "samples": 4}
    here = render(ball(60.0, 3), lights, **how)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        how |= {"executor": executor, "store": Store(tmp_path), "progress": lambda *done: told.append(done)}
        there = render(ball(60.0, 3), lights, **how)
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert there.frames.names == lights.names
    assert isinstance(there.frames.codes, np.memmap)
    for codes in (there.frames.codes, Store(tmp_path).load_frames().codes):
        assert np.array_equal(here.frames.codes, codes)
    assert (here.frames.codes[:, :4, :4] == PEDESTAL).all()
    assert 0 < here.choice.noise == there.choice.noise
    assert (here.variant, here.choice.samples, here.sampling.max_depth) == (there.variant, 4, 3)


def test_what_the_twin_does_not_have_is_told():
    camera = replace(CAMERA, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    for white, lens, told in (
        (None, camera, "white ball's pixel value is unknown"),
        (None, camera, "resampled"),
        (np.full(3, 0.2), CAMERA, "100.0 % of the object's pixels have an albedo above 0.98"),
    ):
        lights = distant([0, 0, 1], white=white)
        assert told in " ".join(render(ball(60.0, 2), lights, pose=AT_CENTER, camera=lens, samples=4).warnings)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": Pose.from_rotation_translation(np.eye(3), [0, 0, 300.0])}, "behind the camera"),
        ({"pose": Pose.from_rotation_translation(np.eye(3), [900, 0, -300.0])}, "outside 96 x 80"),
        ({"lights": near(CENTER + [10.0, 0, 5.0])}, "lights flash_0: at .* inside 'object'.*diameter_mm and scan_unit"),
        ({"lights": distant([0, 0, 1], intensities=[[1.0, np.nan, 1.0]])}, "lights flash_0: .*frames.skip"),
        ({"lights": distant([0, 0, 1], intensities=[[1.0, -1.0, 1.0]])}, "no negative intensity"),
        ({"albedo": np.ones((80, 90, 3), np.float32)}, "80 x 90 x 3, the camera 80 x 96 x 3"),
        ({"albedo": np.nan}, "albedo is unknown"),
        ({"albedo": 0.0, "lights": distant([0, 0, 1], white=np.zeros(3))}, "3 positive numbers"),
        ({"scan": Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))}, "0 faces"),
        ({"scan": Mesh(ball(60.0, 1).vertices * np.nan, ball(60.0, 1).faces)}, "126 of its coordinates"),
    ],
)
def test_what_cannot_be_rendered_is_named(change, message, tmp_path):
    given = {"scan": ball(60.0, 2), "pose": AT_CENTER, "lights": distant([0, 0, 1]), **change}
    with pytest.raises(RenderError, match=message):
        render(store=Store(tmp_path), **given)
    assert not list(tmp_path.rglob("*"))
