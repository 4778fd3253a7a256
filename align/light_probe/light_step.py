"""What a small change of each light does to the shading, and the lights after it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from scene.lights import Lights
from scene.normals import unit

Array = NDArray[np.float64]
NEAREST, FARTHEST = 1.3, 300.0
"""Distances of a light from the object's middle that are tried, in radii of the object."""


def light_slopes(lights: Lights, points: Array, normals: Array, *, near: bool) -> Array:
    """Return d(vector . normal) (N, P, 3 or 4) of lights of intensity 1 at points and normals (P, 3), mm.

    Per light: its direction's turn along two tangents (radians), the logarithm of its intensity at the reference point
    c, and where `near` the inverse k of its distance from there (1 / mm). With u = d - k (p - c) the vector at p is
    s u / |u|^3, which for k = 0 is a distant light's: a light can be followed from there without a jump.
    """
    arm, nearness = points - lights.reference_point_mm, nearness_of(lights)
    u = lights.directions[:, None] - nearness[:, None, None] * arm
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    along, cosine = u / length, np.einsum("npk,pk->np", u / length, normals)
    # d(u / |u|^3) . n = du . gradient
    gradient = (normals - 3 * cosine[..., None] * along) / length**3
    across = looking_along(lights.directions)[:, :2]
    columns = [np.einsum("npk,nk->np", gradient, across[:, axis]) for axis in range(2)]
    columns.append(cosine / length[..., 0] ** 2)
    if near:
        columns.append(-np.einsum("npk,pk->np", gradient, arm))
    return np.stack(columns, -1)


def changed(lights: Lights, step: Array, radius_mm: float) -> Lights:
    """Return the lights after a step (N, 3 or 4) of `light_slopes`; with positions where it has four columns."""
    across = looking_along(lights.directions)[:, :2]
    directions = unit(lights.directions + np.einsum("na,nak->nk", step[:, :2], across))
    positions = None
    if step.shape[1] == 4:
        limits = 1 / (FARTHEST * radius_mm), 1 / (NEAREST * radius_mm)
        nearness = np.clip(nearness_of(lights) + step[:, 3], *limits)
        positions = lights.reference_point_mm + directions / nearness[:, None]
    brighter = np.exp(step[:, 2:3])
    return replace(lights, directions=directions, positions_mm=positions, intensities=lights.intensities * brighter)


def nearness_of(lights: Lights) -> Array:
    """Return (N,) 1 / distance from the reference point, 1 / mm; 0 of distant lights."""
    if lights.positions_mm is None:
        return np.zeros(len(lights))
    return 1 / np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
