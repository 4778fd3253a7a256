"""What will be photographed, by what camera, how bright and how noisy."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.rays import RayCaster
from scene.spheres import WHITE_BALL_ALBEDO
from shoot.plan.plan_options import AS_USUAL, View
from twin.camera.virtual_camera import Sensor

Array = NDArray[np.float64]
GLOSSES: dict[str, tuple[float, float] | None] = {
    "matte": None,
    "satin": (0.4, 0.5),
    "semi-gloss": (0.3, 1.0),
    "gloss": (0.1, 1.0),
}
"""Roughness and specularity of `RoughPlastic`: chalk and plaster; wax and skin; painted wood, eggshell; glazed ware."""
FILLS = 0.4
"""Share of the picture's height that the object fills: the balls stand beside it."""
EXPOSURE = 0.7
"""Pixel value of the white ball where it faces the mean flash: the nearest flash may be a third brighter."""


@dataclass(frozen=True, eq=False)
class SetUp:
    """Object, camera, exposure, noise.

    Parameters
    ----------
    camera : Camera
    mesh : Mesh
        The object in the camera frame, mm.
    sensor : Sensor
        Whose photon and read noise the photographs have.
    gloss : str
        A key of `GLOSSES`.
    albedo : float
        Reflectance of the object; a white ball has 0.8.
    white_value : float
        Pixel value of a surface of reflectance 1 that faces the mean flash.
    is_mosaic : bool
        Two of three colours are interpolated, which averages noise.
    said : tuple of str
        Where each of these comes from.
    """

    camera: Camera
    mesh: Mesh
    sensor: Sensor = field(default_factory=Sensor)
    gloss: str = AS_USUAL.gloss
    albedo: float = AS_USUAL.albedo
    white_value: float = EXPOSURE / WHITE_BALL_ALBEDO
    is_mosaic: bool = True
    said: tuple[str, ...] = ()

    @cached_property
    def caster(self) -> RayCaster:
        """The object, ready for rays."""
        return RayCaster(self.mesh)

    @property
    def middle_mm(self) -> Array:
        """(3,) the object's middle, where directions are wanted."""
        return self.mesh.center_mm

    @property
    def table_mm(self) -> float:
        """Z of the table: the object's farthest point; the table is taken to face the camera."""
        return float(self.mesh.vertices[:, 2].min())

    @property
    def size_mm(self) -> float:
        """The object's largest extent across the view."""
        return float(np.ptp(self.mesh.vertices[:, :2], axis=0).max())


def lens_camera(focal_mm: float, sensor_mm: float, pixels: tuple[int, int]) -> Camera:
    """Return the camera of a lens on a sensor of this width; the principal point in the middle."""
    width, height = pixels
    focal = focal_mm / sensor_mm * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, source="options")


def before_camera(mesh: Mesh, camera: Camera, distance_mm: float | None, seen_from: View = "+z") -> tuple[Mesh, str]:
    """Return an object put before the camera, in its frame, and how far away, in words.

    `distance_mm`: from the camera to the object's middle; None: so that it fills `FILLS` of the picture's height.
    `seen_from`: the axis of the scan that points to the camera; up in the picture is z, or y if z points there.
    """
    axis = np.eye(3)["xyz".index(seen_from[1])]
    toward, up = (-axis if seen_from[0] == "-" else axis), np.eye(3)[1 if seen_from[1] == "z" else 2]
    vertices = (mesh.vertices - mesh.center_mm) @ np.stack([np.cross(up, toward), up, toward]).T
    high = max(float(np.ptp(vertices[:, 1])), float(np.ptp(vertices[:, 0])) * camera.height / camera.width)
    told = "as told"
    if distance_mm is None:
        distance_mm = camera.fy * high / (FILLS * camera.height) + float(vertices[:, 2].max())
        told = f"so that the object fills {FILLS:.0%} of the picture"
    vertices = vertices - [0, 0, distance_mm]
    return replace(mesh, vertices=vertices), f"camera {distance_mm:.0f} mm from the object's middle, {told}"


def simple_shape(kind: Literal["sphere", "relief"], size_mm: float) -> Mesh:
    """Return a stand-in for an object of this size: a ball, or a plate with waves of a slope of up to 35 degrees."""
    if kind == "sphere":
        from twin.description.object_mesh import built_in

        ball = built_in("sphere")
        return Mesh(ball.vertices * size_mm / 2, ball.faces)
    side, turns = 161, 3 * 2 * np.pi
    y, x = np.mgrid[0.5 : -0.5 : side * 1j, -0.5 : 0.5 : side * 1j]
    z = np.tan(np.radians(35)) / turns * np.sin(turns * x) * np.sin(turns * y)
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(size_mm * np.stack([x, y, z], -1).reshape(-1, 3), faces)
