"""Fitted materials against known ones: a textured, glossy object, rendered by the twin's engines and photographed.

What the fit is given has errors: lights as two chrome balls and a white one leave them, a scan with noise and fewer
triangles, a pose and a white value that are a little off, and a sensor's noise, clipping and colour filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.truth import ground_truth
from benchmarks.harness import Figures, Scale, Table, markdown
from fixtures.ball_scene import develop
from fixtures.mesh_scene import as_calibrated, random_scene
from fixtures.mesh_shapes import SHAPES, scan_of
from scene.clock import now, since
from scene.frames import Frames
from scene.mesh import Mesh
from scene.pose import Pose, rotation_from_vector
from scene.spheres import WHITE_BALL_ALBEDO
from twin.camera.virtual_camera import Sensor
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import RoughPlastic, Texture
from twin.engines.film import Film
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.variant import import_mitsuba
from twin.material.scan_material import scan_material
from twin.visibility import Sight

FIRST = 4000
"""Seeds below were looked at while the fit was made."""
DRAWN = ("blob", "potato", "relief", "knot", "dented_pear", "house", "brick", "mug")
AMBIENT = 0.004
"""Pixel value of the room's light in every frame; a frame without flash tells it."""
DEPTH, PATHS = 4, 36
"""Surfaces that light meets, one more than it leaves; paths a pixel."""
POSE_MM, POSE_DEG, SCAN_MM, WHITE = 0.03, 0.04, 0.03, 0.003
"""Standard deviations: of the pose along and about each axis, of the scanner's points, of the white value."""


class MaterialSession(NamedTuple):
    """What a fit is given, with its errors, and the pixel value (H, W, 3) that the body truly has, NaN beyond."""

    sight: Sight
    frames: Frames
    mask: NDArray[np.bool_]
    albedo: NDArray[np.float32]


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


def material_session(seed: int, material: RoughPlastic, *, near: bool, height: int, flashes: int) -> MaterialSession:
    """Return a session of the seed's shape, pose, lights and errors; `material` takes a texture of this seed."""
    generator = np.random.default_rng([seed, 41])
    mesh = SHAPES[DRAWN[seed % len(DRAWN)]]()
    world = random_scene(mesh, seed, width=height * 4 // 3, height=height, flashes=flashes)
    camera, lights = world.camera, world.lights if near else replace(world.lights, positions_mm=None)
    texture = texture_of(generator)
    # Looked at from the front, the texture is spread over the object as a slide would be.
    local = mesh.vertices @ world.pose.rotation.T
    corner, span = local[:, :2].min(0), np.ptp(local, axis=0)[:2]
    textured = Mesh(mesh.vertices, mesh.faces, mesh.vertex_normals, (local[:, :2] - corner) / span)
    thing = TwinObject("object", textured, "plastic", world.pose.matrix)
    images, film = _rendered(TwinScene(camera, (thing,), {"plastic": replace(material, reflectance=texture)}, lights))
    # The first flash's exposure is kept for all; highlights may clip.
    light = 0.62 / np.quantile(images[0][images.max((0, -1)) > 0], 0.99) * np.array([0.9, 1.0, 0.8])
    sensor, codes = Sensor(full_well_e=20000, blur_px=0.5), []
    for image in [*images, np.zeros_like(images[0])]:
        whole = np.full((camera.height, camera.width, 3), AMBIENT, np.float32)
        whole[film.rows, film.columns] += light * image
        codes.append(develop(whole, sensor, generator))
    frames = Frames(lights.names, np.stack(codes[:-1]), np.ones(len(lights)), codes[-1], is_mosaic=True)
    turn = rotation_from_vector(np.radians(POSE_DEG) * generator.standard_normal(3))
    target = world.pose.apply(mesh.center_mm)
    off = Pose.from_rotation_translation(turn, target - turn @ target + POSE_MM * generator.standard_normal(3))
    pose, scan = off @ world.pose, scan_of(mesh, generator, faces=120_000, noise_mm=SCAN_MM)
    white = light * np.array(sensor.neutral)
    value = WHITE_BALL_ALBEDO * white * (1 + WHITE * generator.standard_normal())
    given = as_calibrated(world.lights, generator)
    given = replace(given, white_value=value, **({} if near else {"positions_mm": None}))
    found = ground_truth(scan, pose, camera)
    true = ground_truth(mesh, world.pose, camera, at_vertices=(mesh.vertex_normals, np.zeros(len(mesh.vertices))))
    albedo, inside = np.full((*true.mask.shape, 3), np.nan, np.float32), true.mask
    points = camera.points_at_depth(camera.grid()[inside], -true.depth_mm[inside].astype(float)[:, None])
    flat = world.pose.inverse().apply(points) @ world.pose.rotation.T
    albedo[inside] = white * texture.at((flat[:, :2] - corner) / span)
    return MaterialSession(Sight(scan.moved(pose.matrix), camera, given, found.normals), frames, found.mask, albedo)


def _rendered(scene: TwinScene) -> tuple[NDArray[np.float32], Film]:
    """Return the images (F, h, w, 3) of a part of the picture, and which part it is."""
    import_mitsuba()
    film, shapes = scene.film(), mitsuba_scene(scene)
    many = Many(shapes, film, scene.lights, max_depth=DEPTH)
    return many.band(slice(0, film.size[0]), PATHS).sum(0), film


@dataclass(frozen=True)
class MaterialRow:
    """What is found of one object of rough plastic: relative errors in percent.

    Albedo: median over pixels, signed and absolute.
    `unexplained`: relative RMSE of the photographs that it was fitted to.
    """

    seed: int
    shape: str
    is_near: bool
    roughness: float
    roughness_percent: float
    specularity: float
    specularity_percent: float
    albedo_percent: float
    pixel_percent: float
    unexplained_percent: float
    processor_s: float


def _fitted(seed: int, height: int, flashes: int) -> list[MaterialRow]:
    generator = np.random.default_rng([seed, 43])
    roughness, strength = float(np.exp(generator.uniform(*np.log([0.05, 0.6])))), float(generator.uniform(0.25, 1.0))
    near, true = seed % 3 != 0, RoughPlastic((0.5, 0.5, 0.5), roughness, strength)
    session = material_session(seed, true, near=near, height=height, flashes=flashes)
    start = now()
    found = scan_material(session.sight, session.frames, session.mask)
    spent = since(start)["processor_seconds"]
    known = np.isfinite(found.albedo) & np.isfinite(session.albedo)
    off = 100 * (found.albedo[known] / session.albedo[known] - 1)
    rough, strong = found.fit.surface.roughness / roughness, found.fit.specularity / strength
    return [
        MaterialRow(
            seed, DRAWN[seed % len(DRAWN)], near, roughness, 100 * (rough - 1), strength, 100 * (strong - 1),
            float(np.median(off)), float(np.median(np.abs(off))), 100 * found.relative_rmse, spent,
        )
    ]  # fmt: skip


def _totals(rows: Sequence[MaterialRow]) -> dict[str, float]:
    """Return the root mean square over sessions of every error."""
    names = [name for name in vars(rows[0]) if name.endswith("_percent")]
    return {name: float(np.sqrt(np.mean([getattr(row, name) ** 2 for row in rows]))) for name in names}


def _shown(rows: Sequence[MaterialRow]) -> str:
    columns = {
        "object": "{object}", "lights": "{lights}",
        "roughness": "{roughness:.3f}", "roughness found": "{roughness_percent:+.1f} %",
        "specularity": "{specularity:.3f}", "specularity found": "{specularity_percent:+.1f} %",
        "albedo, median": "{albedo_percent:+.1f} %", "albedo of a pixel": "{pixel_percent:.1f} %",
        "unexplained": "{unexplained_percent:.2f} %",
    }  # fmt: skip
    shown = [
        {**vars(row), "object": f"{row.shape}, {row.seed}", "lights": ("distant", "near")[row.is_near]} for row in rows
    ]
    total = dict.fromkeys(vars(rows[0])) | {"object": "root mean square", "lights": ""}
    return markdown(columns, [*shown, {**total, **_totals(rows)}])


def _figures(rows: Sequence[MaterialRow]) -> Figures:
    return {f"{name}, rms": value for name, value in _totals(rows).items()}


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(FIRST, 60, 12)]
    return [(FIRST + 1, 240, 24)] if scale == "gates" else [(FIRST + k, 360, 32) for k in range(12)]


TABLES = (Table("twin", "material", ("twin.material.scan_material",), MaterialRow, _cases, _fitted, _shown, _figures),)
