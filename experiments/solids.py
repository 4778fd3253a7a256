"""The catalogue's further shapes: solids whose surface lies where a formula is zero, with its own normals."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.mesh import Mesh

Array = NDArray[np.float64]

LOW, HIGH, CELLS = -1.5, 1.5031, 136
"""Of the grid, in the formulas' unit: its ends, off the solids' planes of symmetry, and its cells along a side."""
STEPS = 6
"""Of Newton's method: they carry the grid's corners onto the surface."""
COMPLEX_STEP = 1e-30
"""Of `slope`: it cancels nothing, and so is as small as numbers allow."""
TILT_DEG, TURN_DEG = 24.0, 33.0
"""About x and about y: a solid is seen from above and from the side, not along an axis of its own."""
GOLDEN = (1 + 5**0.5) / 2
TWELVE_FACES = ((0, 1, GOLDEN), (0, -1, GOLDEN), (1, GOLDEN, 0), (-1, GOLDEN, 0), (GOLDEN, 0, 1), (GOLDEN, 0, -1))
EIGHT_FACES = ((1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1))
"""Of one of each two opposite faces, the direction; of any length."""
BEAR = (
    (0, 0.5, 0, 0.4), (0, -0.3, 0, 0.52), (-0.33, 0.85, 0, 0.16), (0.33, 0.85, 0, 0.16), (0, 0.42, 0.36, 0.18),
    (-0.55, 0, 0.2, 0.2), (0.55, 0, 0.2, 0.2), (-0.35, -0.7, 0.4, 0.25), (0.35, -0.7, 0.4, 0.25),
)  # fmt: skip
"""Balls that melt together, x, y, z, radius: head, belly, ears, muzzle, arms, legs."""


def _ball(x: Any, y: Any, z: Any, radius: float = 1.0) -> Any:
    return x * x + y * y + z * z - radius * radius


def _torus(x: Any, y: Any, z: Any, radius: float = 0.7, thick: float = 0.35) -> Any:
    return (_ball(x, y, z, thick) + radius**2) ** 2 - 4 * radius**2 * (x * x + y * y)


def _blunt(x: Any, y: Any, z: Any, faces: Any, power: int) -> Any:
    """Return a solid with flat faces and rounded edges: the sum over its faces of (face . p)^power is 1."""
    return sum(((a * x + b * y + c * z) / np.sqrt(a * a + b * b + c * c)) ** power for a, b, c in faces) - 1


def _least(*values: Any, width: float = 0.1) -> Any:
    """Return the least of some values, rounded off where two are alike: the union of solids."""
    # Any number taken out is put back: with this one no power overflows.
    low = np.minimum.reduce([np.real(value) for value in values])
    return low - width * np.log(sum(np.exp((low - value) / width) for value in values))


def _most(*values: Any) -> Any:
    return -_least(*(-value for value in values))


FIELDS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "torus": _torus,
    "dodecahedron": lambda x, y, z: _blunt(x, y, z, TWELVE_FACES, 24),
    "bear": lambda x, y, z: _least(*(_ball(x - a, y - b, z - c, r) / r for a, b, c, r in BEAR), width=0.08),
    "peanut": lambda x, y, z: _ball(x, y - 0.6, z, 0) * _ball(x, y + 0.6, z, 0) - 0.65**4,
    "gyroid": lambda x, y, z: _most(
        _ball(x, y, z),
        (np.sin(5 * x) * np.cos(5 * y) + np.sin(5 * y) * np.cos(5 * z) + np.sin(5 * z) * np.cos(5 * x)) ** 2 - 0.5,
    ),
    "barrel": lambda x, y, z: ((x * x + z * z) / 0.45) ** 4 + y**8 - 1,
    "heart": lambda x, y, z: (x * x + y * y + 2.25 * z * z - 1) ** 3 - (x * x + 0.1125 * z * z) * y**3 + 0.003,
    "links": lambda x, y, z: _least(_torus(x + 0.33, y, z, 0.6, 0.2), _torus(x - 0.33, z, y, 0.6, 0.2), width=0.02),
    "ball": _ball,
    "jack": lambda x, y, z: _least(
        *((b * b + c * c) / 0.07 + a**8 - 1 for a, b, c in ((x, y, z), (y, z, x), (z, x, y))), width=0.4
    ),
    "clover": lambda x, y, z: _ball(x, 1.2 * y, z, 0) ** 2 - 0.45 * (x**4 - 6 * x * x * z * z + z**4) - 1,
    "tangle": lambda x, y, z: sum((2.4 * a) ** 4 - 5 * (2.4 * a) ** 2 for a in (x, y, z)) + 11.8,
    "vase": lambda x, y, z: _most(x * x + z * z - (0.45 + 0.2 * np.sin(3.6 * y + 2.6)) ** 2, y * y - 0.9),
    "cushion": lambda x, y, z: _blunt(x, y, z, np.eye(3), 4),
    "cage": lambda x, y, z: _least(
        *(_torus(a, b, c, 0.85, 0.17) for a, b, c in ((x, y, z), (y, z, x), (z, x, y))), width=0.02
    ),
    "egg": lambda x, y, z: 1.8 * (x * x + z * z) * np.exp(0.5 * y) + y * y - 1,
    "twist": lambda x, y, z: _blunt(
        (np.cos(2 * y) * x + np.sin(2 * y) * z) / 0.5, y, (np.cos(2 * y) * z - np.sin(2 * y) * x) / 0.5, np.eye(3), 8
    ),
    "sponge": lambda x, y, z: _most(
        _blunt(x, y, z, np.eye(3), 8) / 6, (np.cos(6 * x) + np.cos(6 * y) + np.cos(6 * z) - 0.5) / 6
    ),
    "octahedron": lambda x, y, z: _blunt(1.3 * x, 1.3 * y, 1.3 * z, EIGHT_FACES, 24),
    "pretzel": lambda x, y, z: (x * x * (1 - x * x) - y * y) ** 2 + 0.5 * z * z - 0.012,
    "pebble": lambda x, y, z: (
        _ball(x, 1.15 * y, 1.3 * z) + 0.2 * np.sin(4 * x + 1) * np.sin(4 * y) + 0.1 * np.sin(7 * z + 2 * x)
    ),
}  # fmt: skip
"""By name, a function of x, y, z that is negative inside. It is given complex numbers too: all in it is analytic."""


def slope(field: Callable[[Any, Any, Any], Any], points: Array) -> Array:
    """Return a field's gradient (P, 3) at points (P, 3), exact to rounding, by the complex step [Squire1998].

    The imaginary part of f(p + i h e), over h, is the derivative along e: no difference is taken, h may be tiny.
    """
    columns = points.T.astype(complex)
    steps = 1j * COMPLEX_STEP * np.eye(3)
    return np.stack([field(*(columns + step[:, None])).imag / COMPLEX_STEP for step in steps], -1)


@cache
def solid(name: str) -> Mesh:
    """Return a solid of `FIELDS` as a closed mesh about the origin, within a radius of 1, seen along z.

    Marching cubes [Lorensen1987], whose corners Newton's method then carries onto the surface; the normals are the
    field's gradient there. Texture coordinates are laid on along z: what is seen has no seam.
    """
    from skimage.measure import marching_cubes

    field, side = FIELDS[name], np.linspace(LOW, HIGH, CELLS + 1)
    found = marching_cubes(field(*np.meshgrid(side, side, side, indexing="ij")), 0.0, gradient_direction="descent")
    points, faces = found[0].astype(float) * (side[1] - side[0]) + LOW, found[1].astype(np.int64)
    for _ in range(STEPS):
        gradient = slope(field, points)
        points -= (field(*points.T) / np.sum(gradient**2, 1))[:, None] * gradient
    turn, tilt = np.radians(TURN_DEG), np.radians(TILT_DEG)
    about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    normals, points = (each @ (about_x @ about_y).T for each in (slope(field, points), points))
    points -= (points.max(0) + points.min(0)) / 2
    points /= np.linalg.norm(points, axis=1).max()
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(points, faces, normals, (points[:, :2] * [1, -1] + 1) / [4, 2])
