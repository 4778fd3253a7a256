"""A small ray tracer that makes what calibrate must undo. It shares no formula with calibrate's fits.

Balls, a finite table with a black world around it, a round flash that mirrors show as a disc, cast
shadows, one or two bounces between mirrors, supersampled edges, lens blur, photon and read noise.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from scene.camera import Camera
from scene.frames import Frames

MATTE, MIRROR, PLASTER = "white", "chrome", "object"
ALBEDO = {MATTE: 0.85, PLASTER: 0.5}


@dataclass
class Ball:
    kind: str
    center: np.ndarray
    radius: float


@dataclass
class World:
    """What stands before the camera; lengths in mm."""

    camera: Camera
    balls: list[Ball]
    lights: np.ndarray
    """(F, 3) positions."""
    powers: np.ndarray
    """(F, 3) pixel value of white that faces the flash at 1 m."""
    table_point: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -1050.0]))
    table_normal: np.ndarray = field(
        default_factory=lambda: np.array([0.02, 0.12, 1.0]) / np.linalg.norm([0.02, 0.12, 1.0])
    )
    table_half: float = 450.0
    table_albedo: float = 0.15
    flash_radius: float = 25.0
    mirror: float = 0.75

    def stand(self, kind: str, x: float, y: float, radius: float) -> "World":
        """Put a ball on the table, above the table's point (x, y)."""
        n, p = self.table_normal, self.table_point
        z = p[2] - ((x - p[0]) * n[0] + (y - p[1]) * n[1]) / n[2]
        self.balls.append(Ball(kind, np.array([x, y, z]) + radius * n, radius))
        return self


def _first_hit(world, origins, directions):
    """Distance along each ray and what it hits: -1 nothing, -2 the table, else the ball's number."""
    n = world.table_normal
    with np.errstate(divide="ignore", invalid="ignore"):
        best = (world.table_point - origins) @ n / (directions @ n)
        where = origins + best[:, None] * directions - world.table_point
        inside = (best > 1e-6) & (np.abs(where[:, 0]) < world.table_half) & (np.abs(where[:, 1]) < world.table_half)
    what = np.where(inside, -2, -1)
    best = np.where(inside, best, np.inf)
    for number, ball in enumerate(world.balls):
        offset = origins - ball.center
        half = np.einsum("ij,ij->i", offset, directions)
        disc = half * half - np.einsum("ij,ij->i", offset, offset) + ball.radius**2
        root = -half - np.sqrt(np.maximum(disc, 0))
        closer = (disc > 0) & (root > 1e-6) & (root < best)
        best[closer], what[closer] = root[closer], number
    return best, what


def _blocked(world, points, toward):
    """Whether a ball stands between each point and the light; `toward` is unnormalised."""
    out = np.zeros(len(points), bool)
    square = np.einsum("ij,ij->i", toward, toward)
    for ball in world.balls:
        offset = ball.center - points
        along = np.clip(np.einsum("ij,ij->i", offset, toward) / square, 0, 1)
        gap = offset - along[:, None] * toward
        out |= (np.einsum("ij,ij->i", gap, gap) < (ball.radius * (1 - 1e-9)) ** 2) & (along > 1e-9)
    return out


def _paths(world, pixels, oversample):
    """Follow `oversample`^2 rays of each pixel (P, 2) through mirrors to the point that sends the light."""
    camera = world.camera
    step = (np.arange(oversample) + 0.5) / oversample - 0.5
    du, dv = np.meshgrid(step, step)
    u = (pixels[:, :1] + du.ravel()).ravel()
    v = (pixels[:, 1:] + dv.ravel()).ravel()
    zero = np.zeros_like(u)
    if camera.is_orthographic:
        origins = np.stack([(u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, zero], -1)
        directions = np.stack([zero, zero, zero - 1], -1)
    else:
        directions = np.stack([(u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, zero - 1], -1)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        origins = np.zeros_like(directions)
    factor = np.ones(len(origins))
    distance, what = _first_hit(world, origins, directions)
    mirrors = np.array([ball.kind == MIRROR for ball in world.balls] + [False, False])
    mirrored = np.zeros(len(origins), bool)
    for _ in range(2):
        chosen = np.flatnonzero(mirrors[what])
        if not len(chosen):
            break
        points = origins[chosen] + distance[chosen, None] * directions[chosen]
        normals = _ball_normals(world, points, what[chosen])
        heading = directions[chosen]
        directions[chosen] = heading - 2 * np.einsum("ij,ij->i", heading, normals)[:, None] * normals
        origins[chosen] = points
        factor[chosen] *= world.mirror
        mirrored[chosen] = True
        distance[chosen], what[chosen] = _first_hit(world, origins[chosen], directions[chosen])
    return origins, directions, distance, what, factor, mirrored


def _ball_normals(world, points, numbers):
    centers = np.stack([ball.center for ball in world.balls])
    radii = np.array([ball.radius for ball in world.balls])
    return (points - centers[numbers]) / radii[numbers, None]


def _radiance(world, pixels, oversample, ambient):
    """Yield (P, 3), what each pixel receives, one light after another."""
    origins, directions, distance, what, factor, mirrored = _paths(world, pixels, oversample)
    matte = np.flatnonzero((what == -2) | np.isin(what, [k for k, b in enumerate(world.balls) if b.kind != MIRROR]))
    points = origins[matte] + distance[matte, None] * directions[matte]
    on_ball = what[matte] >= 0
    normals = np.broadcast_to(world.table_normal, points.shape).copy()
    normals[on_ball] = _ball_normals(world, points[on_ball], what[matte][on_ball])
    albedo = np.full(len(points), world.table_albedo)
    for k, ball in enumerate(world.balls):
        albedo[what[matte] == k] = ALBEDO.get(ball.kind, 0)
    glints = np.flatnonzero(mirrored)
    for light, power in zip(world.lights, world.powers, strict=True):
        values = np.zeros((len(origins), 3))
        toward = light - points
        length = np.linalg.norm(toward, axis=1)
        cosine = np.maximum(np.einsum("ij,ij->i", normals, toward) / length, 0)
        cosine[_blocked(world, points + 1e-3 * normals, toward)] = 0
        values[matte] = (factor[matte] * albedo * cosine * (1000 / length) ** 2)[:, None] * power
        values[matte] += (ambient * factor[matte] * albedo)[:, None]
        offset = light - origins[glints]
        along = np.einsum("ij,ij->i", offset, directions[glints])
        gap = np.linalg.norm(offset - along[:, None] * directions[glints], axis=1)
        seen = glints[(along > 0) & (along < distance[glints]) & (gap < world.flash_radius)]
        values[seen] = 60.0 * factor[seen, None] * power
        yield values.reshape(len(pixels), -1, 3).mean(1)


def render(world, *, blur_px=0.6, electrons=20000.0, read_noise=2e-4, ambient=0.0, seed=0):
    """Return the session's `Frames`, clipped at 1: 36 rays a pixel where the balls stand, 4 elsewhere."""
    rng = np.random.default_rng(seed)
    camera = world.camera
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    fine = np.zeros(u.shape, bool)
    for ball in world.balls:
        if ball.kind != PLASTER:
            center = camera.project(ball.center)
            scale = camera.fx * ball.radius / (1.0 if camera.is_orthographic else -ball.center[2])
            fine |= np.hypot(u - center[0], v - center[1]) < 1.08 * scale + 3
    parts = [(fine, 6), (~fine, 2)]
    rays = [(mask, _radiance(world, np.stack([u[mask], v[mask]], -1).astype(float), n, ambient)) for mask, n in parts]
    images = []
    for _ in world.lights:
        image = np.zeros((camera.height, camera.width, 3))
        for mask, source in rays:
            image[mask] = next(source)
        image = gaussian_filter(image, (blur_px, blur_px, 0))
        image += rng.normal(size=image.shape) * np.sqrt(np.maximum(image, 0) / electrons + read_noise**2)
        images.append(np.clip(image, -0.02, 1.0))
    return Frames.from_linear(tuple(f"flash_{i:03d}" for i in range(len(images))), np.stack(images).astype(np.float32))


def flashes(count, *, near_mm=800.0, far_mm=1150.0, center=(0.0, 0.0, -1000.0), seed=0):
    """Return (F, 3) positions around and above the scene, 15 to 60 degrees off the camera's axis."""
    rng = np.random.default_rng(seed)
    azimuth = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.6, count)) / count
    polar = np.deg2rad(rng.uniform(15, 58, count))
    direction = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    return np.array(center) + direction * rng.uniform(near_mm, far_mm, count)[:, None]


def table_scene(*, count=10, width=600, height=400, seed=0):
    """Two mirrors and a matte ball around an object of three merged lumps; near flashes."""
    rng = np.random.default_rng(seed)
    camera = Camera(width, height, 1.4 * width, 1.4 * width, width / 2 + 4.3, height / 2 - 3.1)
    powers = 0.55 * rng.uniform(0.7, 1.4, (count, 1)) * rng.uniform(0.96, 1.04, (count, 3))
    world = World(camera, [], flashes(count, seed=seed), powers)
    world.stand(MIRROR, -215, -110, 38).stand(MIRROR, 220, 130, 38).stand(MATTE, 205, -130, 35)
    world.stand(PLASTER, -40, -10, 62).stand(PLASTER, 40, -25, 60).stand(PLASTER, 0, 55, 58)
    return world


@pytest.fixture(scope="session")
def tracer():
    """The tracer's names, for tests that build a world of their own."""
    import types

    return types.SimpleNamespace(Ball=Ball, World=World, render=render, flashes=flashes, table_scene=table_scene)


@pytest.fixture(scope="session")
def table(tracer):
    """(world, frames) of the usual scene."""
    world = tracer.table_scene()
    return world, tracer.render(world)
