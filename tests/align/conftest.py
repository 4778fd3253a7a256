"""A small world with known truth: bumpy meshes, near flashes, and a Lambert renderer."""

from dataclasses import dataclass

import numpy as np
import pytest

from align.pose.photographed import Photographs
from align.pose.scan_view import View
from fixtures.lit_surfaces import lights_along, spiral
from fixtures.mesh_scene import random_rotation
from fixtures.mesh_shapes import ball
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.rays import RayCaster


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
        toward = generator.standard_normal(3)
        toward /= np.linalg.norm(toward)
        width = generator.uniform(0.2, 0.6)
        reach += generator.uniform(-0.2, 0.45) * np.exp((directions @ toward - 1) / width**2)
    return Mesh(radius_mm * directions * reach[:, None], sphere.faces)


def ring_lights(middle: np.ndarray, *, count: int = 10, away: float = 1.0) -> Lights:
    """Flashes at unequal distances around the viewing axis, of unequal power and colour."""
    generator = np.random.default_rng(7)
    directions = spiral(np.cos(np.radians(np.linspace(15, 55, count))))
    positions = middle + away * directions * generator.uniform(600, 900, (count, 1))
    intensities = generator.uniform(0.7, 1.3, (count, 1)) * generator.uniform(0.95, 1.05, (count, 3))
    return lights_along(directions, intensities, positions_mm=positions, reference_point_mm=middle).normalised()


def make_world(
    mesh: Mesh,
    rotation: np.ndarray,
    *,
    camera: Camera | None = None,
    gloss: float = 0.0,
    noise: float = 0.002,
    table: float = 0.0,
    away: float = 1.0,
    metal: float = 0.0,
    bounce: float = 0.0,
) -> World:
    """Photograph a mesh at a rotation, some 600 mm away, by flashes 0.6 to 0.9 m times `away` off.

    `metal`: share of a broad lobe about the mirror direction in place of Lambert's law. `bounce`: what comes back from
    behind and below, relative to the light.
    """
    camera = camera or Camera(160, 120, 300.0, 300.0, 83.0, 57.0)
    depth = -2.2 * mesh.radius_mm if camera.is_orthographic else -600.0
    target = np.array([6.0, -4.0, depth])
    pose = Pose.from_rotation_translation(rotation, target - rotation @ mesh.center_mm)
    lights = ring_lights(target, away=away)
    caster = RayCaster(mesh)
    oversampling = 3
    # Rays at the centres of 3 x 3 sub-pixels: edges are as soft as a sensor makes them.
    step = (np.arange(oversampling) - (oversampling - 1) / 2) / oversampling
    total = np.zeros((len(lights), camera.height, camera.width, 3))
    cover = np.zeros((camera.height, camera.width))
    for dv in step:
        for du in step:
            image, hit = _shade(caster, camera, pose, lights, camera.grid() + [du, dv], gloss, table, metal, bounce)
            total += image / oversampling**2
            cover += hit / oversampling**2
    generator = np.random.default_rng(11)
    images = 0.6 * total + noise * generator.standard_normal(total.shape)
    frames = Frames.from_linear(lights.names, images)
    mask = cover > 0.5
    gray = (frames.read() / lights.intensities[:, None, None, :]).mean(-1)
    normals = np.full((*mask.shape, 3), np.nan)
    solution = np.linalg.lstsq(lights.directions, gray[:, mask], rcond=None)[0].T
    normals[mask] = solution / np.linalg.norm(solution, axis=1, keepdims=True)
    return World(mesh, camera, frames, lights, mask, normals, pose)


def _shade(caster, camera, pose, lights, pixels, gloss, table, metal, bounce):
    mesh = caster.mesh
    shape = pixels.shape[:2]
    hits = View(caster, camera, pose).hits(pixels.reshape(-1, 2))
    origins, rays = (x.reshape(-1, 3) for x in camera.rays(pixels))
    plane = pose.apply(mesh.center_mm)[2] - mesh.radius_mm
    on_plane = (plane - origins[:, 2]) / rays[:, 2]
    points = origins + rays * np.where(hits.hit, hits.distance, on_plane)[:, None]
    normals = pose.rotate(hits.interpolate(mesh, mesh.vertex_normals))
    normals[~hits.hit] = [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    on_scan = pose.inverse().apply(points)
    wave = np.sin(on_scan / 9.0 + [0.3, 1.1, 2.0]).sum(1)
    albedo = np.where(hits.hit, 0.55 + 0.1 * wave, table)[:, None] * [1.0, 0.9, 0.75]
    out = np.zeros((len(lights), len(points), 3))
    vectors = lights.at(points)
    for index in range(len(lights)):
        toward = pose.inverse().apply(lights.positions_mm[index]) - on_scan
        far = np.linalg.norm(toward, axis=1)
        lifted = on_scan + 0.05 * pose.inverse().rotate(normals)
        lit = ~caster.blocked(lifted, toward / far[:, None], far)
        cosine = np.maximum(np.einsum("pck,pk->pc", vectors[index], normals), 0)
        half = vectors[index][:, 1] / np.linalg.norm(vectors[index][:, 1], axis=1, keepdims=True) - rays
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        mirrored = np.maximum(np.einsum("pk,pk->p", half, normals), 0)
        strength = np.linalg.norm(vectors[index], axis=-1)
        broad = (strength * mirrored[:, None] ** 12) * (cosine > 0)
        surface = (1 - metal) * cosine + metal * np.where(hits.hit[:, None], broad, cosine)
        shine = gloss * mirrored**60 * hits.hit
        around = bounce * strength * (1 - normals @ unit(np.array([0.3, 0.9, 0.5])))[:, None] * hits.hit[:, None]
        out[index] = lit[:, None] * (albedo * surface + shine[:, None] * (cosine > 0)) + albedo * around
    return out.reshape(len(lights), *shape, 3), hits.hit.reshape(shape)


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
