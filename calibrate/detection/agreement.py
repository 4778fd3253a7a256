"""Whether two balls see the same lights: a light that one shows lies on its mirrored ray, and the other sees that ray.

The balls stand on one table, so their distances from the camera are taken as one, and the only length that is unknown
is the light's range along the ray. What the other ball may show is an arc, some ten degrees long and, but for the
errors of both, as thin as a line: few things that are no balls keep to it in frame after frame.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse
from calibrate.detection.evidence import Change, Shaded, brightest
from calibrate.lights.directions import USUAL_FOCAL, mirrored_rays
from scene.camera import Camera
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
NEAREST = 0.4  # of the balls' distance from the camera: the range of the nearest light
MATTE_DEG, MIRROR_DEG, OUTLINE_PX = 4.0, 2.0, 0.5
"""Errors of a direction by shading, by a mirror, and of an outline, coarse px: that turns what a small mirror shows."""
FEWEST = 2  # frames in which both show a light


class Rays(NamedTuple):
    """Where a circle would see each frame's light if it were a ball whose distance is the camera's focal length."""

    center: Array  # (3,)
    directions: Array  # (F, K, 3) unit, K places where the light may be
    shown: NDArray[np.bool_]  # (F, K)
    sigma_deg: float


def _seen_by(camera: Camera) -> Camera:
    """Return the camera, or a usual one in place of an orthographic one that stands for an unknown one."""
    if not camera.is_orthographic or camera.source != "assumed":
        return camera
    focal = USUAL_FOCAL * camera.width
    return Camera(camera.width, camera.height, focal, focal, (camera.width - 1) / 2, (camera.height - 1) / 2)


def mirror_rays(coarse: Coarse, changes: list[Change], sphere: Sphere) -> Rays:
    """Return where a mirror, coarse pixels, would see the lights."""
    camera = _seen_by(coarse.camera)
    pixels, shown = brightest(changes, sphere)
    _, directions = mirrored_rays(camera, _ball(sphere), pixels)
    shown &= np.isfinite(directions[..., 0])
    sigma = float(np.hypot(MIRROR_DEG, np.rad2deg(2 * OUTLINE_PX / sphere.radius_px)))
    return Rays(_center(camera, sphere), np.nan_to_num(directions), shown, sigma)


def matte_rays(coarse: Coarse, sphere: Sphere, seen: Shaded) -> Rays:
    """Return where a matte ball, coarse pixels, sees the lights by its shading."""
    center = _center(_seen_by(coarse.camera), sphere)
    return Rays(center, seen.directions[:, None], seen.lit[:, None], MATTE_DEG)


def _ball(sphere: Sphere) -> Sphere:
    return Sphere(sphere.kind, sphere.center_px, sphere.radius_px, diameter_mm=2 * sphere.radius_px)


def _center(camera: Camera, sphere: Sphere) -> Array:
    """Return where the ball is; an orthographic camera is so far away that all are at one place."""
    return np.zeros(3) if camera.is_orthographic else _ball(sphere).center_mm(camera)


def agreement(a: Rays, b: Rays) -> Array:
    """Return (2,), how far two balls see the same lights, and how far they do not.

    Notes
    -----
    With e = exp(-(miss / sigma)^2 / 2) a frame, these are sqrt(n) mean(e) and sqrt(n) mean(1 - e) over the n frames
    in which both show a light: frames err alike, so n frames count as sqrt(n). 0 where n is less than two.
    """
    both = a.shown.any(1) & b.shown.any(1)
    if both.sum() < FEWEST:
        return np.zeros(2)
    nearest = NEAREST * np.linalg.norm(a.center) or 1.0
    near = unit(a.center + nearest * a.directions - b.center)[:, :, None]
    miss = np.rad2deg(_from_arc(b.directions[:, None], near, a.directions[:, :, None]))
    miss = np.where(a.shown[:, :, None] & b.shown[:, None], miss, np.inf).min((1, 2))[both]
    agree = float(np.mean(np.exp(-0.5 * (miss / np.hypot(a.sigma_deg, b.sigma_deg)) ** 2)))
    return np.sqrt(len(miss)) * np.array([agree, 1 - agree])


def _from_arc(directions: Array, start: Array, end: Array) -> Array:
    """Return the angle (...) between directions (..., 3) and the great circle's arc from start to end."""
    normal = np.cross(start, end)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.maximum(length, 1e-9)
    off = np.sum(directions * normal, -1)
    on = directions - off[..., None] * normal
    beside = np.sum(np.cross(start, on) * normal, -1) > 0
    beside &= (np.sum(np.cross(on, end) * normal, -1) > 0) & (length[..., 0] > 1e-6)
    ends = np.maximum(np.sum(directions * start, -1), np.sum(directions * end, -1))
    return np.where(beside, np.arcsin(np.clip(np.abs(off), 0, 1)), np.arccos(np.clip(ends, -1, 1)))
