"""The twin: closed forms, known points, and what must not change it."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
import trimesh

from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import PEDESTAL
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.store import Store
from twin.description.description import Sampling
from twin.engines.render import render_scene
from twin.scan_scene import scan_scene
from twin.visibility import Sight

pytestmark = pytest.mark.render

CAMERA = Camera(96, 80, 150.0, 150.0, 53.4, 35.2)
CENTER = np.array([-4.0, -6.0, -300.0])
ORTHOGRAPHIC = Camera(96, 80, 0.6, 0.6, 53.4, 35.2, projection="orthographic")


def render(
    scan, pose, camera, lights, albedo, *, white_value=None, samples_per_pixel=None, max_depth=3, error=0.01,
    albedo_depth_mm=None, **how,
):  # fmt: skip
    """Render a scan with its albedo by stock Mitsuba."""
    sampling = Sampling("mitsuba", samples_per_pixel, max_depth, error)
    lights = lights if white_value is None else replace(lights, white_value=white_value)
    sight = Sight.of_scan(scan, pose, camera, lights)
    scene, warnings = scan_scene(sight, albedo, sampling, albedo_depth_mm=albedo_depth_mm)
    rendered = render_scene(scene, **how)
    return replace(rendered, warnings=(*warnings, *rendered.warnings))


def ball(radius=60.0, subdivisions=5):
    shape = trimesh.creation.icosphere(subdivisions, radius)
    return Mesh(np.array(shape.vertices), np.array(shape.faces))


def squares(points, half):
    """Return squares that face the camera, centred at points (P, 3)."""
    corner = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        (points[:, None] + corner).reshape(-1, 3),
        (faces + 4 * np.arange(len(points))[:, None, None]).reshape(-1, 3),
    )


def distant(*directions, intensities=None):
    directions = unit(np.array(directions, float))
    if intensities is None:
        intensities = np.ones((len(directions), 3))
    names = tuple(f"flash_{i}" for i in range(len(directions)))
    return Lights(names, directions, intensities, white_value=np.full(3, 0.8))


def near(*positions, at=CENTER, intensities=None):
    lights = distant(*(np.array(positions) - at), intensities=intensities)
    return replace(lights, positions_mm=np.array(positions, float), reference_point_mm=np.array(at, float))


def flat(camera, value=0.5):
    return np.full((camera.height, camera.width, 3), value, np.float32)


def ball_truth(camera, radius, center):
    """Return normals and points (H, W, 3) of a ball, NaN beside it."""
    origins, rays = camera.rays(camera.grid())
    offset = origins - center
    along = np.sum(rays * offset, -1)
    square = along**2 - np.sum(offset**2, -1) + radius**2
    points = origins + rays * (-along - np.sqrt(np.where(square > 0, square, np.nan)))[..., None]
    return (points - center) / radius, points


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"fy": 158.0},
        {"distortion": (-0.2, 0.05, 0.004, -0.003, 0.0)},
        {"projection": "orthographic", "fx": 0.5, "fy": 0.5},
    ],
    ids=["pinhole", "oblong pixels", "distortion", "orthographic"],
)
def test_known_points_are_rendered_where_the_camera_projects_them(sign, change):
    camera = replace(CAMERA, cx=47.5 + sign * 9.3, cy=39.5 - sign * 7.7, **change)
    u, v = np.meshgrid([14.3, 40.8, 77.6], [11.7, 33.4, 66.2])
    wanted = np.stack([u, v], -1).reshape(-1, 2)
    points = np.array([camera.points_at_depth(p, z) for p, z in zip(wanted, np.linspace(-330, -270, 9), strict=True)])
    mesh = squares(points, 3.0 if not camera.is_orthographic else 4.0)
    image = render(mesh, Pose(np.eye(4)), camera, distant([0, 0, 1]), flat(camera)).frames.frame(0)[..., 1]
    rows, columns = np.mgrid[:80, :96]
    for p in wanted:
        weight = image * (np.hypot(columns - p[0], rows - p[1]) < 7)
        found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        assert np.linalg.norm(found - p) < 0.1


@pytest.mark.parametrize("camera", [CAMERA, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("kind", ["distant", "near"])
def test_a_lambertian_ball_has_the_closed_form(camera, kind):
    """Pixel = albedo * intensity * cos, to 1 %, with an albedo that varies over the picture and by channel."""
    # The scan's frame is another than the camera's, so a pose that is not applied, or applied twice, shows.
    pose = Pose.exp([0.7, -0.4, 1.1, 0, 0, 0])
    pose = Pose.from_rotation_translation(pose.rotation, CENTER - pose.rotate([30.0, 20.0, 10.0]))
    mesh = Mesh(ball().vertices + [30.0, 20.0, 10.0], ball().faces)
    colours = np.array([[1.2, 0.9, 1.0], [0.8, 1.1, 1.0]])
    positions = CENTER + [[-150.0, 120.0, 160.0], [90.0, -60.0, 220.0]]
    lights = near(*positions, intensities=colours)
    if kind == "distant":
        lights = replace(lights, positions_mm=None)
    u, v = camera.grid()[..., 0], camera.grid()[..., 1]
    albedo = np.stack([0.2 + 0.004 * u, 0.6 - 0.003 * u, 0.3 + 0.003 * v], -1).astype(np.float32)
    frames = render(mesh, pose, camera, lights, albedo, max_depth=2, samples_per_pixel=64).frames
    normals, points = ball_truth(camera, 60.0, CENTER)
    inside = -np.nan_to_num(np.sum(normals * camera.rays(camera.grid())[1], -1)) > 0.35
    vectors = lights.at(points[inside])
    for index in range(2):
        expected = albedo[inside] * np.einsum("pcx,px->pc", vectors[index], normals[inside])
        bright = expected.min(1) > 0.08
        ratio = frames.frame(index)[inside][bright] / expected[bright]
        assert bright.sum() > 300
        assert np.abs(ratio - 1).max() < 0.02
        assert np.abs(np.median(ratio, 0) - 1).max() < 0.003
        assert np.percentile(np.abs(ratio - 1), 95) < 0.01


def test_a_plane_under_a_near_light_has_the_right_energy():
    """Fall-off and cosine, pixel by pixel and in the mean, with the reference point beside the plane's middle."""
    camera = CAMERA
    mesh = squares(np.array([[0.0, 0.0, -300.0]]), 400.0)
    lights = near([40.0, 70.0, -180.0], at=[20.0, -30.0, -280.0])
    image = render(mesh, Pose(np.eye(4)), camera, lights, flat(camera, 0.3), max_depth=2).frames.frame(0)
    points = camera.points_at_depth(camera.grid(), -300.0).reshape(-1, 3)
    expected = 0.3 * lights.at(points)[0][..., 2].reshape(80, 96, 3)
    assert np.isclose(image.mean(), expected.mean(), rtol=2e-3)
    assert np.abs(image / expected - 1).max() < 0.02


def test_a_cast_shadow_falls_where_the_light_throws_it():
    """A plate of 16 mm, 40 mm before a wall: its shadow's middle lies on the line from the light."""
    plate = np.array([10.0, 5.0, -260.0])
    wall = squares(np.array([[0.0, 0.0, -300.0], plate]), 200.0)
    vertices = wall.vertices.copy()
    vertices[4:] = plate + (vertices[4:] - plate) * (8.0 / 200.0)
    position = np.array([110.0, 75.0, -100.0])
    lights = near(position, at=[0.0, 0.0, -300.0])
    image = render(Mesh(vertices, wall.faces), Pose(np.eye(4)), CAMERA, lights, flat(CAMERA), max_depth=2)
    image = image.frames.frame(0)[..., 0]
    scale = (position[2] + 300) / (position[2] + 260)
    # A plate parallel to the wall throws a square, whose middle is the plate's middle carried along.
    shadow = CAMERA.project(position + (plate - position) * scale)
    dark = 1 - image / np.median(image)
    rows, columns = np.mgrid[:80, :96]
    weight = np.where((dark > 0.5) & (np.hypot(columns - shadow[0], rows - shadow[1]) < 12), dark, 0)
    found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    assert np.linalg.norm(found - shadow) < 0.3
    assert weight.sum() == pytest.approx((16 * scale * 150 / 300) ** 2, rel=0.1)


@pytest.mark.full
def test_interreflection_in_a_bowl_is_that_of_an_integrating_sphere():
    """A white furnace with a closed form.

    Every point of a sphere's inside sees every other alike: a half sphere of reflectance r under an even sky of
    radiance 1 has the radiance r f / (1 - r (1 - f)), f = 1/2 the share of the missing half; r f without
    interreflection.
    """
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 65), np.linspace(0, np.pi / 2, 25))
    direction = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), -np.cos(v)], -1).reshape(-1, 3)
    corner = np.arange(24 * 65).reshape(24, 65)[:, :-1].ravel()
    around, down = corner + 1, corner + 65
    faces = np.concatenate([np.stack([corner, down, around], 1), np.stack([around, down, down + 1], 1)])
    shape = Mesh(50 * direction + [0, 0, -100.0], faces)
    if np.sum(shape.face_normals * direction[faces[:, 0]]) > 0:  # the inside is the outside here
        shape = Mesh(shape.vertices, shape.faces[:, ::-1].copy())
    camera = Camera(40, 40, 0.36, 0.36, 19.5, 19.5, projection="orthographic")
    count = 96
    z = (np.arange(count) + 0.5) / count
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    rim = np.sqrt(1 - z * z)
    sky = distant(*np.stack([rim * np.cos(angle), rim * np.sin(angle), z], -1))
    r, f = 0.6, 0.5
    inside = np.linalg.norm(camera.grid() - 19.5, axis=-1) < 0.36 * 42
    for depth, expected in ((2, r * f), (3, r * f * (1 + r * (1 - f))), (12, r * f / (1 - r * (1 - f)))):
        rendered = render(shape, Pose(np.eye(4)), camera, sky, flat(camera, r), samples_per_pixel=16, max_depth=depth)
        radiance = rendered.frames.read().mean(0)[inside].mean() * 2
        assert radiance == pytest.approx(expected, rel=0.01), depth


def test_the_white_ball_sets_interreflection_and_never_the_direct_light():
    mesh = squares(np.array([[0.0, 0.0, -300.0]]), 60.0)
    floor = mesh.vertices @ Pose.exp([np.pi / 2, 0, 0, 0, 0, 0]).rotation.T
    floor = floor - floor[0] + mesh.vertices[0]
    corner = Mesh(np.concatenate([mesh.vertices, floor]), np.concatenate([mesh.faces, mesh.faces[:, ::-1] + 4]))
    lights = distant([0.2, 0.8, 1.0])

    def mean(white, depth):
        rendered = render(
            corner, Pose(np.eye(4)), CAMERA, lights, flat(CAMERA), white_value=np.full(3, white), max_depth=depth
        )
        return rendered.frames.read().mean()

    direct = mean(0.8, 2)
    assert mean(1.6, 2) == pytest.approx(direct, rel=1e-4)
    bounced = {white: mean(white, 3) - direct for white in (0.8, 1.6)}
    assert bounced[0.8] > 0.02 * direct
    # Twice the white value is half the reflectance: one interreflection is half as strong.
    assert bounced[1.6] == pytest.approx(bounced[0.8] / 2, rel=0.05)


def test_frames_are_named_stored_and_the_same_wherever_they_are_rendered(tmp_path):
    lights = distant([-1, 1, 2], [1, 0, 2], [0, -1, 3])
    pose = Pose.from_rotation_translation(np.eye(3), CENTER)
    told = []
    here = render(ball(subdivisions=3), pose, CAMERA, lights, flat(CAMERA), samples_per_pixel=4)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        there = render(
            ball(subdivisions=3),
            pose,
            CAMERA,
            lights,
            flat(CAMERA),
            samples_per_pixel=4,
            executor=executor,
            store=Store(tmp_path),
            progress=lambda done, total: told.append((done, total)),
        )
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert there.frames.names == lights.names
    assert np.array_equal(here.frames.codes, there.frames.codes)
    assert isinstance(there.frames.codes, np.memmap)
    assert np.array_equal(Store(tmp_path).load_frames().codes, there.frames.codes)
    assert (here.frames.codes[:, :4, :4] == PEDESTAL).all()
    assert 0 < here.choice.noise == there.choice.noise
    assert (here.variant, here.choice.samples, here.sampling.max_depth) == (there.variant, 4, 3)


def test_albedo_that_was_measured_on_a_plane_gives_the_frames_that_it_was_measured_from():
    """A ball that stands out of the plane at which its albedo was fitted: the twin is not brighter for it."""
    pose = Pose.from_rotation_translation(np.eye(3), CENTER)
    toward = unit(np.array([[-1, 1, 2], [1, 1, 2.5], [0, -1, 2], [1, -0.5, 2], [-1, -0.7, 3.0]]))
    lights = near(*(CENTER + 300 * toward))
    real = render(ball(), pose, CAMERA, lights, flat(CAMERA, 0.4), max_depth=2).frames
    normals, _ = ball_truth(CAMERA, 60.0, CENTER)
    pixels = np.nan_to_num(normals[..., 2]) > 0.7
    vectors = lights.at(CAMERA.points_at_depth(CAMERA.grid()[pixels], CENTER[2]))[:, :, 1]
    shading = np.einsum("npx,px->np", vectors, normals[pixels])
    fitted = np.full((80, 96, 3), np.nan, np.float32)
    fitted[pixels] = (np.sum(shading * real.read()[:, pixels, 1], 0) / np.sum(shading**2, 0))[:, None]
    naive, mended = (
        render(ball(), pose, CAMERA, lights, fitted, albedo_depth_mm=depth, max_depth=2).frames.read()[:, pixels].mean()
        for depth in (None, CENTER[2])
    )
    truth = real.read()[:, pixels].mean()
    assert naive > 1.2 * truth
    assert mended == pytest.approx(truth, rel=5e-3)


def test_what_the_twin_does_not_have_is_told():
    pose = Pose.from_rotation_translation(np.eye(3), CENTER)
    lights = replace(distant([0, 0, 1]), white_value=None)
    camera = replace(CAMERA, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    warnings = " ".join(render(ball(subdivisions=2), pose, camera, lights, flat(camera), samples_per_pixel=4).warnings)
    assert "white ball's pixel value is unknown" in warnings
    assert "resampled" in warnings
    lights = replace(lights, white_value=np.full(3, 0.2))
    warnings = " ".join(render(ball(subdivisions=2), pose, CAMERA, lights, flat(CAMERA), samples_per_pixel=4).warnings)
    assert "100.0 % of the object's pixels have an albedo above 0.98" in warnings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": Pose.from_rotation_translation(np.eye(3), [0, 0, 300.0])}, "behind the camera"),
        ({"pose": Pose.from_rotation_translation(np.eye(3), [900, 0, -300.0])}, "outside 96 x 80"),
        (
            {"lights": near(CENTER + [10.0, 0, 5.0])},
            "lights flash_0: at .* inside 'object'.*diameter_mm and scan_unit",
        ),
        ({"lights": distant([0, 0, 1], intensities=np.array([[1.0, np.nan, 1.0]]))}, "lights flash_0: .*frames.skip"),
        ({"lights": distant([0, 0, 1], intensities=np.array([[1.0, -1.0, 1.0]]))}, "no negative intensity"),
        ({"albedo": np.ones((80, 90, 3), np.float32)}, "80 x 90 x 3, the camera 80 x 96 x 3"),
        ({"albedo": np.full((80, 96, 3), np.nan, np.float32)}, "albedo is unknown"),
        ({"albedo": np.zeros((80, 96, 3), np.float32), "white_value": np.zeros(3)}, "3 positive numbers"),
        ({"mesh": Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))}, "0 faces"),
        ({"mesh": Mesh(ball(subdivisions=1).vertices * np.nan, ball(subdivisions=1).faces)}, "126 of its coordinates"),
    ],
)
def test_what_cannot_be_rendered_is_named(change, message, tmp_path):
    given = {
        "mesh": ball(subdivisions=2),
        "pose": Pose.from_rotation_translation(np.eye(3), CENTER),
        "camera": CAMERA,
        "lights": distant([0, 0, 1]),
        "albedo": flat(CAMERA),
        **change,
    }
    order = ("mesh", "pose", "camera", "lights", "albedo")
    options = {key: value for key, value in given.items() if key not in order}
    with pytest.raises(RenderError, match=message):
        render(*(given[key] for key in order), store=Store(tmp_path), **options)
    assert not list(tmp_path.rglob("*"))
