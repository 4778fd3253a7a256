"""The calibration balls as the session's camera would see them: what a calibration can be tried on with known truth.

What is physical: mirrors and matte spheres before a plain matte wall, flashes as glowing balls of 25 mm, the fall-off,
shadows, mirrors that show each other, the wall and the flash. What is not: the object, the table, dust, and the light
that a mirror throws on what stands beside it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from scene.spheres import Sphere
from twin.description.description import white_of
from twin.engines.film import Film, film_for
from twin.engines.path_tracing import traced
from twin.engines.variant import import_mitsuba, load

Array = NDArray[np.float64]
FLASH_RADIUS_MM = 25.0
FLASH_ANGLE = 0.025
"""Radius over distance of a distant light: a mirror shows it as large as such a flash a metre away."""
FAR = 1e4
"""Distance of a distant light, in distances from the origin to the balls: a ball's radius must not count beside it."""
WHITE, WALL, MIRROR = 0.8, 0.08, 0.7
"""What they reflect."""
UNKNOWN_DISTANCE_MM = 1000.0
"""Where balls of unknown diameter are put, if no ball's is known."""
MARGIN = 1.25
"""Of a ball's box, in radii."""
BEHIND_PIXELS = 1 << 18
"""Of the wall behind the balls' boxes: it is smooth, so it is rendered coarsely."""
SAMPLES_PER_FRAME = 1 << 24
DEPTH = 3
"""Mitsuba's max_depth: one bounce between wall, matte balls and mirrors; in a mirror, what is lit directly."""


@dataclass(frozen=True)
class PlacedBall:
    """A ball in space, mm, camera frame."""

    kind: str
    center: Array
    radius: float


def place_balls(spheres: Sequence[Sphere], camera: Camera) -> list[PlacedBall]:
    """Return the balls in space; those of unknown diameter as far away as the others, or a metre.

    Orthographic: in the camera's own unit, side by side on the wall.
    """
    if camera.is_orthographic:
        radii = [sphere.radius_px / camera.fx for sphere in spheres]
        deepest = max(radii)
        return [
            PlacedBall(s.kind, camera.points_at_depth(s.center_px, r - 2 * deepest), r)
            for s, r in zip(spheres, radii, strict=True)
        ]
    depths = [camera.fx * s.radius_mm / s.radius_px for s in spheres if s.diameter_mm]
    usual = float(np.median(depths)) if depths else UNKNOWN_DISTANCE_MM
    known = [s if s.diameter_mm else replace(s, diameter_mm=2 * usual * s.radius_px / camera.fx) for s in spheres]
    return [PlacedBall(s.kind, s.center_mm(camera), s.radius_mm) for s in known]


def render_balls(
    spheres: Sequence[Sphere],
    camera: Camera,
    lights: Lights,
    *,
    peak: float = 0.6,
    samples_per_pixel: int | None = None,
) -> Iterator[NDArray[np.float32]]:
    """Yield linear images (H, W, 3) of the balls under one light after the other.

    Parameters
    ----------
    lights : Lights
        Near ones as balls of 25 mm radius at `positions_mm`; distant ones as far balls.
    peak : float
        Pixel value of a white ball that faces the brightest light, in its brightest channel.
    samples_per_pixel : int or None
        None: 64, fewer where the balls fill more than a quarter of a megapixel, down to 4.

    Raises
    ------
    RenderError
        No ball, or none inside the picture.
    """
    if not spheres:
        raise RenderError("no ball to render. Calibrate with balls first.")
    import cv2

    mi = import_mitsuba(slow=True)
    balls = place_balls(spheres, camera)
    wall = min(ball.center[2] - ball.radius for ball in balls)
    boxes = [film_for(camera, _around(ball)) for ball in balls]
    insides = [_inside(sphere, camera, box) for sphere, box in zip(spheres, boxes, strict=True)]
    pixels = sum(box.window[2] * box.window[3] for box in boxes)
    if samples_per_pixel is None:
        samples_per_pixel = int(np.clip(np.sqrt(SAMPLES_PER_FRAME / pixels), 2, 8)) ** 2
    coarse = _coarse(camera)
    corners = coarse.points_at_depth([[0, 0], [coarse.width - 1, coarse.height - 1]], wall)
    behind = film_for(coarse, corners)
    scale = peak / (lights.intensities * white_of(lights)).max()
    for index in range(len(lights)):
        flash = _flash(lights, balls, index, scale)
        matte = load({**_stage(mi, balls, wall, mirrors=False), "flash": flash})
        mirrored = load({**_stage(mi, balls, wall, mirrors=True), "flash": flash})
        wall_image = behind.place(traced(matte, behind, corners, 16, (index,)))
        image: Any = cv2.resize(wall_image, (camera.width, camera.height), interpolation=cv2.INTER_LINEAR)
        for number, (ball, box) in enumerate(zip(balls, boxes, strict=True)):
            seed, around = 1000 * index + 2 * number + 1, _around(ball)
            part = box.place(traced(matte, box, around, samples_per_pixel, (seed,)))
            if ball.kind == "chrome":
                # To the rest of the scene mirrors are black: a path from matte to mirror to flash is a caustic, which
                # is found one time in a million, and then as a white speck. No highlight lies in a ball's rim.
                shown = box.place(traced(mirrored, box, around, samples_per_pixel, (seed + 1,)))
                inside, rim = insides[number]
                part[rim] = np.minimum(shown[rim], 2 * WALL / WHITE * peak)
                part[inside] = shown[inside]
            image[box.rows, box.columns] = part
        yield image


def _inside(sphere: Sphere, camera: Camera, box: Film) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which pixels of a ball's box lie well inside it, and which on its rim."""
    width = max(2.0, 0.03 * sphere.radius_px)
    inner, outer = (sphere.mask(camera, grow_px=grow)[box.rows, box.columns] for grow in (-width, width))
    return inner, outer & ~inner


def _around(ball: PlacedBall) -> Array:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return ball.center + MARGIN * ball.radius * corners


def _coarse(camera: Camera) -> Camera:
    """Return the camera of a small picture of the same view."""
    step = max(1.0, np.sqrt(camera.width * camera.height / BEHIND_PIXELS))
    width, height = max(2, round(camera.width / step)), max(2, round(camera.height / step))
    return camera.scaled(width, height, width / camera.width, height / camera.height)


def _stage(mi, balls: list[PlacedBall], wall: float, *, mirrors: bool) -> dict:
    """Return Mitsuba's description of balls and wall, without light."""
    span = 30 * max(abs(wall), *(np.linalg.norm(ball.center) for ball in balls))
    scene: dict = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "wall": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, 0, wall]).scale([span, span, 1]),
            "bsdf": _diffuse(WALL),
        },
    }
    for number, ball in enumerate(balls):
        chrome = {"type": "conductor", "specular_reflectance": {"type": "rgb", "value": MIRROR}, "material": "none"}
        matte = _diffuse(WHITE if ball.kind == "white" else 0.0)
        scene[f"ball_{number}"] = {
            "type": "sphere",
            "center": ball.center.tolist(),
            "radius": float(ball.radius),
            "bsdf": chrome if ball.kind == "chrome" and mirrors else matte,
        }
    return scene


def _diffuse(reflectance: float) -> dict:
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": reflectance}}


def _flash(lights: Lights, balls: list[PlacedBall], index: int, scale: float) -> dict:
    """Return Mitsuba's description of a light.

    A ball of radius r and radiance L gives the irradiance pi L (r / d)^2 at distance d, exactly, and a white surface
    that faces it the radiance 0.8 / pi times that.
    """
    if lights.positions_mm is None:
        center = np.mean([ball.center for ball in balls], axis=0)
        distance = FAR * max(np.linalg.norm(ball.center) + ball.radius for ball in balls)
        position, radius = center + distance * lights.directions[index], FLASH_ANGLE * distance
    else:
        position, radius = lights.positions_mm[index], FLASH_RADIUS_MM
        distance = np.linalg.norm(position - lights.reference_point_mm)
    radiance = scale * lights.intensities[index] * white_of(lights) / WHITE * (distance / radius) ** 2
    return {
        "type": "sphere",
        "center": np.asarray(position, float).tolist(),
        "radius": float(radius),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": np.asarray(radiance, float).tolist()}},
    }
