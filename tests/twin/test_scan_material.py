"""A scan's material from photographs to the twin's surface: each pixel's albedo, and whose normals the twin has."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from scene.camera import Camera
from scene.frames import Frames
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.spheres import WHITE_BALL_ALBEDO
from tests.twin.test_fit_material import RADIUS, SIDE, WHITE, ball, dome
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse
from twin.description.object_mesh import ObjectMesh
from twin.engines.render import render_scene
from twin.engines.variant import SLOW, pick_variant
from twin.material.measured_albedo import textured_surface
from twin.material.scan_material import scan_material
from twin.scan_scene import scan_scene
from twin.visibility import Sight

CAMERA = Camera(80, 80, 240.0, 240.0, 39.5, 39.5)


def bowl(half: float = 30.0, pieces: int = 48) -> Mesh:
    """Return a hollow that opens toward the camera, its rim 24 mm nearer than its middle at the sides."""
    line = np.linspace(-half, half, pieces + 1)
    across, up = np.meshgrid(line, line)
    depth = 0.8 * (across**2 + up**2) / half - 280
    vertices = np.stack([across, up, depth], -1).reshape(-1, 3)
    index = np.arange(len(vertices)).reshape(across.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return Mesh(vertices, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]))


@pytest.mark.render
@pytest.mark.full
@pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here")
def test_light_that_a_hollow_throws_on_itself_is_not_taken_for_albedo() -> None:
    """It was: the twin then had it twice, and was too bright in every hollow."""
    lights, mesh = dome(12), bowl()
    one = TwinObject("bowl", ObjectMesh(mesh.vertices, mesh.faces), "matte")
    scene = TwinScene(
        CAMERA, (one,), {"matte": Diffuse((0.6, 0.6, 0.6))}, lights, sampling=Sampling("many", max_depth=4, error=0.004)
    )
    images = render_scene(scene).frames.read()
    mask = images.max((0, -1)) > 0
    found = scan_material(Sight(mesh, CAMERA, lights), Frames.from_linear(lights.names, images), mask)
    true = 0.6 * WHITE
    # All of the mask has an albedo of its own, the outline too.
    assert np.isfinite(found.albedo[mask]).mean() > 0.95
    assert np.nanmedian(np.abs(found.albedo / true - 1)) < 0.06
    middle = mask & (np.hypot(*(CAMERA.grid() - 39.5).transpose(2, 0, 1)) < 10)
    assert abs(np.nanmedian(found.albedo[middle] / true) - 1) < 0.08
    assert found.onward_share > 0.15


@pytest.mark.render
@pytest.mark.full
@pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here")
@pytest.mark.parametrize("share", [0.15, 0.5])
def test_the_rooms_light_is_in_the_twin_and_not_in_the_albedo(share: float) -> None:
    """It was in the albedo alone: photographs under 40 % of room light were 10 degrees worse than their twin."""
    mesh, room = bowl(), share * np.array([1.0, 0.8, 1.2]) * WHITE
    lights = replace(dome(12), ambient=room * WHITE_BALL_ALBEDO, white_value=WHITE_BALL_ALBEDO * WHITE)
    one = TwinObject("bowl", ObjectMesh(mesh.vertices, mesh.faces), "matte")
    environment, sampling = Environment(ambient=tuple(room)), Sampling("many", max_depth=4, error=0.004)
    matte = {"matte": Diffuse((0.3, 0.5, 0.6))}
    scene = TwinScene(CAMERA, (one,), matte, lights, environment=environment, sampling=sampling)
    frames, sight = render_scene(scene).frames, Sight(mesh, CAMERA, lights)
    mask = frames.read().max((0, -1)) > 0
    found = scan_material(sight, frames, mask)
    assert np.nanmedian(np.abs(found.albedo / ([0.3, 0.5, 0.6] * WHITE) - 1)) < 0.06
    twin = scan_scene(sight, found.albedo, scene.sampling, fit=found.fit)[0]
    again, inner = render_scene(twin).frames.read()[:, mask], frames.read()[:, mask]
    assert np.linalg.norm(again - inner) < 0.05 * np.linalg.norm(inner)


def test_a_room_darker_than_the_renderings_error_is_left_out() -> None:
    camera, mask, normals = ball()
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    albedo = np.where(mask[..., None], np.float32(0.4), np.float32(np.nan)) * np.ones(3, np.float32)
    for ambient, is_dark in ((None, True), (np.full(3, 0.004), True), (np.full(3, 0.1), False)):
        lights = replace(dome(12), ambient=ambient, white_value=np.full(3, WHITE_BALL_ALBEDO))
        sight = Sight(Mesh(mesh.vertices, mesh.faces), camera, lights, normals)
        assert scan_scene(sight, albedo, Sampling(error=0.01))[0].environment.is_dark is is_dark


def test_the_twin_has_the_pictures_normals_where_it_is_seen_and_its_own_elsewhere() -> None:
    camera, mask, normals = ball()
    coarse = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    mesh = Mesh(np.array(coarse.vertices), np.array(coarse.faces))
    # The picture's lean by 5 degrees to the right of what the mesh has; on its left half they are unknown.
    turn = np.radians(5)
    leaning = normals @ np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    leaning[:, : SIDE // 2] = np.nan
    albedo = np.where(mask[..., None], np.full(3, 0.3, np.float32), np.float32(np.nan))
    box = slice(0, SIDE), slice(0, SIDE)
    made, _, _, _ = textured_surface(Sight(mesh, camera, dome(8), leaning.astype(np.float32)), albedo, *box)
    off = angular_error_deg(made.normals, made.vertices / np.linalg.norm(made.vertices, axis=1, keepdims=True))
    x, _, z = made.vertices.T / RADIUS
    right = (x > 0.1) & (z > 0.3)
    assert right.sum() > 50
    assert abs(off[right] - 5 * np.sqrt(1 - made.vertices[right, 1] ** 2 / RADIUS**2)).max() < 0.7
    assert off[(x < -0.1) | (z < -0.2)].max() < 0.7
    lean = np.degrees(np.arctan2(made.normals[:, 0], made.normals[:, 2]) - np.arctan2(x, z))
    assert (lean[right] > 3).all()
