"""The sweeps' shapes as formulas: about the origin, within a radius of 1, seen along z."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from experiments.solids import FIELDS, solid
from scene.mesh import Mesh
from twin.description.object_mesh import built_in, smooth

Array = NDArray[np.float64]


def pear(relief: float) -> Mesh:
    """Return a solid of revolution that stands upright: a ball that narrows to a neck."""
    t, s = _parameters(257, 513)
    y, around = np.cos(np.pi * t), 2 * np.pi * s
    radius = np.sin(np.pi * t) * (0.6 - 0.28 * np.tanh(3 * (y - 0.15)))
    return _surface(np.stack([radius * np.sin(around), y, radius * np.cos(around)], -1))


def blob(relief: float) -> Mesh:
    """Return a ball with twelve wide bumps and dents."""
    generator = np.random.default_rng(12345)
    toward = generator.standard_normal((12, 3))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    width, height = generator.uniform(0.3, 0.6, 12), generator.uniform(-0.2, 0.35, 12)
    ball = _ball()
    radius = 1 + np.exp((ball @ toward.T - 1) / width**2) @ height
    return _surface(ball * (radius / radius.max())[..., None])


def knot(relief: float) -> Mesh:
    """Return a trefoil tube: arms that cast shadows on each other."""
    t, s = _parameters(129, 769)
    along = 2 * np.pi * s
    wide = 2 + np.cos(3 * along)
    middle = np.stack([wide * np.cos(2 * along), wide * np.sin(2 * along), np.sin(3 * along)], -1)
    toward = np.gradient(middle[0], axis=0, edge_order=2)
    toward[[0, -1]] = toward[0] + toward[-1]
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    # From the knot's axis outward: never along the tube.
    across = np.stack([np.cos(2 * along[0]), np.sin(2 * along[0]), 0 * along[0]], -1)
    across -= np.sum(across * toward, 1, keepdims=True) * toward
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    aside, angle = np.cross(toward, across), 2 * np.pi * t
    points = middle + 0.6 * (np.cos(angle)[..., None] * across + np.sin(angle)[..., None] * aside)
    return _surface(points / 3.6)


def cone(relief: float) -> Mesh:
    """Return a cone of radius 1 and the height `relief`, seen from its base: a hollow."""
    return built_in("cone").moved(np.diag([1.0, 1.0, -relief, 1.0]))


def bowl(relief: float) -> Mesh:
    """Return a paraboloid of radius 1 and the depth `relief`, seen from its rim."""
    t, s = _parameters(129, 257)
    angle = 2 * np.pi * s
    return _surface(np.stack([t * np.cos(angle), t * np.sin(angle), relief * (t**2 - 1)], -1))


def waves(relief: float) -> Mesh:
    """Return z = relief sin x sin y over two periods each way."""
    return _relief(relief, lambda x, y: np.sin(x) * np.sin(y))


def ridges(relief: float) -> Mesh:
    """Return z = relief sin(x + 0.35 y) / 2: long ridges, half as high as `waves`."""
    return _relief(relief, lambda x, y: np.sin(x + 0.35 * y) / 2)


SHAPES: dict[str, Callable[[float], Mesh]] = {
    shape.__name__: shape for shape in (pear, blob, knot, cone, bowl, waves, ridges)
} | {name: lambda _, name=name: solid(name) for name in FIELDS}
"""By name; each takes its relief, which those without one leave aside."""


def _relief(height: float, form: Callable[[Array, Array], Array]) -> Mesh:
    t, s = _parameters(385, 385)
    x, y = 2 * np.pi * (2 * s - 1), 2 * np.pi * (1 - 2 * t)
    points = np.stack([x, y, height * form(x, y)], -1)
    return _surface(points / (2 * np.pi))


def _ball() -> Array:
    t, s = _parameters(257, 513)
    polar, around = np.pi * t, 2 * np.pi * s
    return np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], -1)


def _parameters(down: int, across: int) -> tuple[Array, Array]:
    """Return t (down) and s (across), 0 to 1, of a grid: the texture's coordinates."""
    t, s = np.meshgrid(np.linspace(0, 1, down), np.linspace(0, 1, across), indexing="ij")
    return t, s


def _surface(points: Array) -> Mesh:
    """Return the triangles between a grid's points (h, w, 3), out to the left of down and across, smooth."""
    height, width = points.shape[:2]
    # What closes the surface is one place, not two that differ by rounding.
    points = np.round(points, 12)
    t, s = _parameters(height, width)
    corner = np.arange(height * width).reshape(height, width)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    vertices = points.reshape(-1, 3)
    cross = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    faces = faces[np.linalg.norm(cross, axis=1) > 1e-12]
    return smooth(Mesh(vertices, faces, texcoords=np.stack([s, t], -1).reshape(-1, 2)))
