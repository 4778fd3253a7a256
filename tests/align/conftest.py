"""A small world with known truth: a bumpy mesh under near flashes."""

from dataclasses import dataclass

import numpy as np
import pytest

from align.pose.photographed import Photographs
from fixtures.lit_surfaces import lights_along, spiral
from fixtures.mesh_scene import Scene, Tracer, random_rotation
from fixtures.mesh_shapes import ball
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from twin.camera.virtual_camera import Sensor


@dataclass(frozen=True)
class World:
    """One synthetic session: what a registration is given, and its truth."""

    mesh: Mesh
    camera: Camera
    frames: Frames
    lights: Lights
    mask: np.ndarray
    normals: np.ndarray
    """Least squares under the lights' directions at the middle: distorted by near light, shadows and noise."""
    pose: Pose

    @property
    def photographs(self) -> Photographs:
        return Photographs(self.camera, self.frames, self.lights, self.mask)


def bumpy_mesh(seed: int, *, subdivisions: int = 5, radius_mm: float = 50.0) -> Mesh:
    """A closed blob without symmetry: a sphere pushed out and in by a few random bumps."""
    generator, sphere = np.random.default_rng(seed), ball(1.0, subdivisions)
    directions = sphere.vertices
    reach = np.ones(len(directions))
    for _ in range(12):
        toward = unit(generator.standard_normal(3))
        width = generator.uniform(0.2, 0.6)
        reach += generator.uniform(-0.2, 0.45) * np.exp((directions @ toward - 1) / width**2)
    return Mesh(radius_mm * directions * reach[:, None], sphere.faces)


class Smooth(Scene):
    """On an even table, with an albedo of broad waves."""

    def texture(self, points, on_object):
        wave = np.sin(self.pose.inverse().apply(points) / 9.0 + [0.3, 1.1, 2.0]).sum(1)
        return np.where(on_object, 0.55 + 0.1 * wave, self.table_albedo)[:, None] * [1.0, 0.9, 0.75]


def make_world(
    mesh: Mesh, rotation: np.ndarray, *, camera: Camera | None = None, away: float = 1.0, table: float = 0.0, **look
) -> World:
    """Photograph a mesh at a rotation, some 600 mm away, on a table across the view, 0.002 noise.

    Ten flashes of unequal power and colour stand 0.6 to 0.9 m times `away` off, around the viewing axis. `table`: its
    albedo; `look` goes to `Scene`.
    """
    camera = camera or Camera(160, 120, 300.0, 300.0, 83.0, 57.0)
    target = np.array([6.0, -4.0, -2.2 * mesh.radius_mm if camera.is_orthographic else -600.0])
    pose = Pose.from_rotation_translation(rotation, target - rotation @ mesh.center_mm)
    generator, directions = np.random.default_rng(7), spiral(np.cos(np.radians(np.linspace(15, 55, 10))))
    positions = target + away * directions * generator.uniform(600, 900, (10, 1))
    powers = generator.uniform(0.7, 1.3, (10, 1)) * generator.uniform(0.95, 1.05, (10, 3))
    lights = lights_along(directions, powers, positions_mm=positions, reference_point_mm=target).normalised()
    look = {"gloss": 0.0, "sensor": Sensor(), "seed": 0} | look
    across, depth = np.array([0.0, 0.0, 1.0]), target[2] - mesh.radius_mm
    tracer = Tracer(Smooth(mesh, pose, camera, lights, across, depth, table, **look))
    images = 0.6 * np.stack(list(tracer.pictures()))
    frames = Frames.from_linear(lights.names, images + 0.002 * np.random.default_rng(11).standard_normal(images.shape))
    mask = tracer.cover > 0.5
    gray = (frames.read() / lights.intensities[:, None, None, :]).mean(-1)
    normals = np.full((*mask.shape, 3), np.nan)
    normals[mask] = unit(np.linalg.lstsq(lights.directions, gray[:, mask], rcond=None)[0].T)
    return World(mesh, camera, frames, lights, mask, normals, pose)


@pytest.fixture(scope="session")
def bumpy() -> Mesh:
    return bumpy_mesh(3)


@pytest.fixture(scope="session")
def coarse() -> Mesh:
    return bumpy_mesh(3, subdivisions=3)


@pytest.fixture(scope="session")
def rotations() -> list[np.ndarray]:
    generator = np.random.default_rng(5)
    return [random_rotation(generator) for _ in range(4)]


@pytest.fixture(scope="session")
def world(bumpy, rotations) -> World:
    return make_world(bumpy, rotations[0])


@pytest.fixture(scope="session")
def build():
    """The world's maker, for tests that want another one."""
    return make_world
