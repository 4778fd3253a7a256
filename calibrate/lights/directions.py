"""The law of the mirror on an exact sphere; and what white balls' shading says beside it, from other places.

One chrome ball shows each flash's direction where it stands; a white ball beside it shows another, less exactly, and
the two meet where the flash is. A white ball's error is its surroundings': light that the table and its neighbours
reflect onto it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
USUAL_FOCAL = 1.4  # widths of the picture that an unknown camera is taken to have: 50 mm on 36 mm
TURNS, RESTS = 60, 1e-12
"""Of the iteration to where a ball mirrors a light: each brings it nearer by the ball's radius over its distance."""
NEAREST_LIGHT, ARC_STEPS = 0.4, 33
"""Least range of a light, of the ball's distance from the camera; steps of the inverse range from there to infinity."""
SURROUNDINGS_DEG = 1.3
"""What bends a white ball's shading, one axis: a vector, added to the direction in all frames and on all balls, and as
much again in each frame. On 36 balls of path-traced scenes by others the vectors had 0.8, 0.7 and 1.2 degrees (rms),
what was left 0.6: more is stated of it, since lights that stand side by side err alike. With 1.0 to 1.5 for either,
lights differ by less than their sigma."""
CLEAR_DEG, CLEAR = 1.0, 5.0
"""The fit's own sigma up to which a frame's shading is clear, or times the ball's median: half in shadow it is 3 to 12
degrees, else 0.2."""


def toward_camera(camera: Camera, points: Array) -> Array:
    """Return the unit vectors (..., 3) from points to the camera, NaN where they are."""
    if camera.is_orthographic:
        return np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    return -points / np.linalg.norm(points, axis=-1, keepdims=True)


def mirrored_at(camera: Camera, sphere: Sphere, toward: Callable[[Array], Array]) -> Array:
    """Return the pixels (N, 2) at which a mirror ball shows N lights.

    `toward` gives the unit vectors (N, 3) from points (N, 3), mm, to the lights.

    Notes
    -----
    The normal halves the angle between view and light: n = unit(v + l), x = c + R n, again from there until it rests.
    """
    center, radius = sphere.center_mm(camera), sphere.radius_mm
    normals = np.array([[0.0, 0.0, 1.0]])
    for _ in range(TURNS):
        points = center + radius * normals
        normals, before = unit(toward_camera(camera, points) + toward(points)), normals
        if np.abs(normals - before).max() < RESTS:
            break
    if camera.is_orthographic:
        return sphere.center_px + sphere.radius_px * normals[:, :2] * [1.0, -1.0]
    return camera.project(center + radius * normals)


def mirrored_rays(camera: Camera, sphere: Sphere, pixels: NDArray) -> tuple[Array, Array]:
    """Return where the rays of pixels (..., 2) meet a mirror ball, and where they go from there.

    Points (..., 3) in mm, or in radii where the diameter is unknown, and unit vectors (..., 3) toward what is mirrored;
    NaN where the ray misses.

    Notes
    -----
    l = 2 (n . v) n - v with v toward the camera along the pixel's own ray. With v = (0, 0, 1) in a
    perspective picture the error is twice the angle off axis.
    """
    normals, points = sphere.normals(camera, pixels)
    view = toward_camera(camera, points)
    return points, 2 * np.sum(normals * view, -1, keepdims=True) * normals - view


def arc_miss_deg(center: Array, directions: Array, other: Array, seen: Array) -> Array:
    """Return (F, K, L), by how many degrees what another ball sees misses what this one's lights may be seen as there.

    A light that one ball shows lies on its mirrored ray, and the other sees that ray as an arc. Centres (3,); unit
    vectors `directions` (F, K, 3) from this one and `seen` (F, L, 3) from the other. All centres 0: distant lights.
    """
    inverse = np.linspace(0, 1, ARC_STEPS)[:, None, None, None] / (NEAREST_LIGHT * np.linalg.norm(center) or 1.0)
    arc = unit(directions + inverse * (center - other))
    return np.rad2deg(np.arccos(np.clip(np.einsum("sfki,fli->sfkl", arc, seen).max(0), -1, 1)))


def two_across(directions: Array) -> tuple[Array, Array]:
    """Return two unit vectors (..., 3) across each unit direction (..., 3) and each other."""
    helper = np.where(np.abs(directions[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    side = unit(np.cross(directions, helper))
    return side, np.cross(directions, side)


def unknown_view_deg(camera: Camera, spheres: list[Sphere]) -> float:
    """Return by how much all directions may turn because nothing is known of the camera, degrees, one axis.

    An orthographic camera sees every ball from straight ahead. From beside the axis, at a usual focal length, its
    directions are off by about as much as the ball lies off it; balls on opposite sides cancel each other's error.
    0 for any camera of which something is known.
    """
    if not camera.is_orthographic or camera.source != "assumed":
        return 0.0
    offset = np.mean([sphere.center_px for sphere in spheres], axis=0) - [camera.cx, camera.cy]
    return float(np.rad2deg(np.arctan(np.hypot(*offset) / (USUAL_FOCAL * camera.width))) / np.sqrt(2))


@dataclass(frozen=True)
class Shading:
    """What W white balls show of F lights by their shading."""

    directions: Array  # (W, F, 3) unit, from each ball; NaN where it shows too little
    sigma_deg: Array  # (W, F) one tangent axis, of the fit alone
    centers_mm: Array  # (W, 3) NaN where the distance is not known

    @cached_property
    def clear(self) -> NDArray[np.bool_]:
        """(W, F): whether the ball shows the light, and it alone."""
        known = np.isfinite(self.sigma_deg)
        usual = [np.median(row[good]) if good.any() else 0.0 for row, good in zip(self.sigma_deg, known, strict=True)]
        limit = np.maximum(CLEAR * np.array(usual).reshape(-1, 1), CLEAR_DEG)
        return known & (np.nan_to_num(self.sigma_deg, nan=np.inf) < limit)

    @property
    def rough(self) -> Array:
        """(F, 3) the mean of the balls that show the light clearly, NaN where none does."""
        return unit(np.where(self.clear[..., None], self.directions, 0).sum(0))

    @property
    def placed(self) -> int:
        """How many of the balls show a light clearly, from a known place."""
        return int(np.sum(np.isfinite(self.centers_mm).all(1) & self.clear.any(1)))

    @cached_property
    def own_deg(self) -> Array:
        """(W, F) one tangent axis, beside what all frames have in common."""
        return np.hypot(self.sigma_deg, SURROUNDINGS_DEG)

    def only(self, frames: NDArray[np.bool_]) -> "Shading":
        """Return the same with nothing shown in all other frames."""
        sigma = np.where(frames, self.sigma_deg, np.nan)
        return Shading(np.where(frames[:, None], self.directions, np.nan), sigma, self.centers_mm)

    def misses(self, directions: Array, inverse: Array, reference: Array, bend: Array) -> Array:
        """Return (W, F, 2), how far lights are beside the shading, in sigmas; NaN where it shows too little.

        `directions` (F, 3) from the reference point (3,), and inverse ranges (F,): 0 for distant lights. A ball whose
        place is not known is taken to be at the reference point. `bend` (3,): what the surroundings add to all.
        """
        arm = np.nan_to_num(reference - self.centers_mm)[:, None]
        target = unit(unit(directions + inverse[:, None] * arm) + bend)
        # Stereographic, as in `Adjustment`.
        half = np.maximum(1 + np.sum(self.directions * target, -1), 1e-6) / 2
        miss = np.stack([np.sum(axis * target, -1) for axis in self._across], -1) / half[..., None]
        return np.where(self.clear, 1.0, np.nan)[..., None] * miss / np.deg2rad(self.own_deg)[..., None]

    @cached_property
    def _across(self) -> tuple[Array, Array]:
        return two_across(self.directions)


def no_shading(frames: int) -> Shading:
    """Return what no white ball shows."""
    return Shading(np.zeros((0, frames, 3)), np.zeros((0, frames)), np.zeros((0, 3)))
