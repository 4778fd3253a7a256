"""Sessions whose material is known: a textured, glossy object, rendered by the twin's engines and photographed.

What the fit is given has errors: lights as two chrome balls and a white one leave them, a scan with noise and fewer
triangles, a pose and a white value that are a little off, and a sensor's noise, clipping and colour filter.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.truth import ground_truth
from fixtures.ball_scene import develop
from fixtures.mesh_scene import as_calibrated, random_scene
from fixtures.mesh_shapes import SHAPES, scan_of
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose, rotation_from_vector
from scene.spheres import WHITE_BALL_ALBEDO
from twin.camera.virtual_camera import Sensor
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import RoughPlastic, Texture
from twin.description.object_mesh import ObjectMesh
from twin.engines.direct import Direct
from twin.engines.many import Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.variant import import_mitsuba

AMBIENT = 0.004
"""Pixel value of the room's light in every frame; a frame without flash tells it."""
POSE_MM, POSE_DEG, SCAN_MM, WHITE = 0.03, 0.04, 0.03, 0.003
"""Standard deviations: of the pose along and about each axis, of the scanner's points, of the white value."""


@dataclass(frozen=True)
class MaterialSession:
    """What a session gives, with its errors, and the truth."""

    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    scan: Mesh
    pose: Pose
    normals: NDArray[np.float32]
    sigma_deg: NDArray[np.float32]
    material: RoughPlastic
    white: NDArray[np.float64]
    """(3,) true pixel value of reflectance 1 that faces a light of intensity 1."""
    albedo: NDArray[np.float32]
    """(H, W, 3) true pixel value of the body: reflectance times `white`, NaN off the object."""


def texture_of(generator: np.random.Generator, side: int = 512) -> Texture:
    """Return coloured blotches between 0.1 and 0.8, some with sharp borders."""
    y, x = np.mgrid[0:side, 0:side] / side
    waves = sum(
        np.sin(2 * np.pi * (generator.integers(1, 7) * x + generator.integers(1, 7) * y) + generator.uniform(0, 6))
        for _ in range(5)
    )
    level = 0.42 + 0.07 * np.asarray(waves)
    level = np.where(np.sin(2 * np.pi * (3 * x + 2 * y)) > 0.7, 0.5 * level, level)
    tint = generator.uniform(0.6, 1.0, 3)
    return Texture(np.clip(level[..., None] * tint / tint.max(), 0.05, 0.8).astype(np.float32), "clamp")


def material_session(
    seed: int, *, shape: str, material: RoughPlastic, near: bool = True, flashes: int = 32, height: int = 360,
    depth: int = 4, perfect: bool = False,
) -> MaterialSession:  # fmt: skip
    """Return a session; `material`'s reflectance becomes a texture of this seed.

    `depth`: light meets so many surfaces less one. `perfect`: all that is given but the photographs is true.
    """
    generator = np.random.default_rng([seed, 41])
    mesh = SHAPES[shape]()
    world = random_scene(mesh, seed, width=height * 4 // 3, height=height, flashes=flashes)
    material = replace(material, reflectance=texture_of(generator))
    lights = world.lights if near else replace(world.lights, positions_mm=None)
    # Looked at from the front, the texture is spread over the object as a slide would be.
    local = mesh.vertices @ world.pose.rotation.T
    span = np.ptp(local, axis=0)[:2]
    texcoords = (local[:, :2] - local[:, :2].min(0)) / span
    textured = ObjectMesh(mesh.vertices, mesh.faces, mesh.vertex_normals, texcoords)
    matrix = world.pose.matrix
    scene = TwinScene(world.camera, (TwinObject("object", textured, "plastic", matrix),), {"plastic": material}, lights)
    film = scene.film()
    import_mitsuba()
    shapes = mitsuba_scene(scene)
    images = Direct(shapes, film, lights, error=0.004).images()
    if depth > 2:
        images = images + Indirect(shapes, film, lights, samples=36, max_depth=depth, seed=seed).images()
    seen = images.max((0, -1)) > 0
    # The first flash's exposure is kept for all; highlights may clip.
    level = 0.62 / np.quantile(images[0][seen], 0.99)
    tint = np.array([0.9, 1.0, 0.8])
    codes = []
    sensor = Sensor(full_well_e=20000, blur_px=0.5)
    for image in images:
        whole = np.full((world.camera.height, world.camera.width, 3), AMBIENT, np.float32)
        whole[film.rows, film.columns] += level * tint * image
        codes.append(develop(whole, sensor, generator))
    ambient = develop(np.full_like(whole, AMBIENT), sensor, generator)
    frames = Frames(lights.names, np.stack(codes), np.ones(len(lights)), ambient, is_mosaic=True)
    white = level * tint * np.array(sensor.neutral)
    pose, scan, given, value = world.pose, mesh, lights, WHITE_BALL_ALBEDO * white
    if not perfect:
        turn = rotation_from_vector(np.radians(POSE_DEG) * generator.standard_normal(3))
        target = pose.apply(mesh.center_mm)
        off = Pose.from_rotation_translation(turn, target - turn @ target + POSE_MM * generator.standard_normal(3))
        pose = off @ pose
        scan = scan_of(mesh, generator, faces=120_000, noise_mm=SCAN_MM)
        given = as_calibrated(lights, generator) if near else _as_calibrated(lights, generator)
        value = value * (1 + WHITE * generator.standard_normal())
    given = replace(given, white_value=value)
    truth = ground_truth(scan, pose, world.camera)
    real = ground_truth(
        mesh,
        world.pose,
        world.camera,
        at_vertices=(mesh.vertex_normals, np.zeros(len(mesh.vertices))),
    )
    albedo = np.full((*real.mask.shape, 3), np.nan, np.float32)
    inside = real.mask
    pixels = world.camera.grid()[inside]
    points = world.camera.points_at_depth(pixels, -real.depth_mm[inside].astype(float)[:, None])
    flat = world.pose.inverse().apply(points) @ world.pose.rotation.T
    albedo[inside] = white * material.reflectance.at((flat[:, :2] - local[:, :2].min(0)) / span)  # type: ignore[union-attr]
    return MaterialSession(
        frames, given, world.camera, truth.mask, scan, pose, truth.normals, truth.sigma_deg, material, white, albedo
    )


def _as_calibrated(lights: Lights, generator: np.random.Generator) -> Lights:
    """Return distant lights with the same errors of direction and intensity."""
    off = np.radians(0.03) * generator.standard_normal(lights.directions.shape)
    intensities = lights.intensities * (1 + 0.0015 * generator.standard_normal(lights.intensities.shape))
    return replace(lights, directions=unit(lights.directions + off), intensities=intensities).normalised()
