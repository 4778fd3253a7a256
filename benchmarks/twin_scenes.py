"""What the twin's benchmark renders, and stock Mitsuba at its best on it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fixtures.mesh_shapes import blob
from scene.camera import Camera
from scene.lights import Lights
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse
from twin.description.object_mesh import built_in, smooth
from twin.engines.film import Film, sensor_description
from twin.engines.mitsuba_scene import mitsuba_scene

MIDDLE = np.array([0.0, 0.0, -300.0])


def dome(count: int) -> Lights:
    """Return distant flashes spread evenly over a cap of 40 degrees, about an axis 20 degrees up and to the right."""
    k = np.arange(count)
    z = 1 - (1 - np.cos(np.radians(40.0))) * (k + 0.5) / count
    across, azimuth = np.sqrt(1 - z**2), k * 2.39996
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
    axis = np.array([0.25, 0.25, 0.94]) / np.linalg.norm([0.25, 0.25, 0.94])
    right = np.array([axis[2], 0, -axis[0]]) / np.hypot(axis[0], axis[2])
    directions = directions @ np.stack([right, np.cross(axis, right), axis])
    return Lights(tuple(f"flash_{i:02d}" for i in k), directions, np.ones((count, 3)))


def stage(lights: Lights, side: int, max_depth: int) -> TwinScene:
    """Return a bumpy blob of 330 000 triangles in the corner of a wall, a floor and a red side wall, all matte."""
    mesh = blob()
    material = {"blob": Diffuse((0.6, 0.6, 0.6)), "wall": Diffuse((0.7, 0.7, 0.7)), "red": Diffuse((0.7, 0.25, 0.2))}
    floor = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
    beside = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]])

    def placed(name: str, shape, use: str, turn, size: float, offset) -> TwinObject:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = size * turn, MIDDLE + offset
        return TwinObject(name, shape, use, matrix)

    square = built_in("square")
    objects = (
        placed("blob", smooth(mesh.vertices, mesh.faces, None, None), "blob", np.eye(3), 0.9, np.zeros(3)),
        placed("wall", square, "wall", np.eye(3), 240.0, [0, 0, -60]),
        placed("floor", square, "wall", floor, 110.0, [0, -60, -60]),
        placed("beside", square, "red", beside, 110.0, [-75, 0, -60]),
    )
    focal = 1.76 * side
    camera = Camera(side, side, focal, focal, (side - 1) / 2, (side - 1) / 2)
    return TwinScene(camera, objects, material, lights, sampling=Sampling("mitsuba", max_depth=max_depth))


def whole_picture(camera: Camera) -> Film:
    """Return the film of the whole picture."""
    return Film.of_pinhole(camera, slice(0, camera.height), slice(0, camera.width))


class StockMitsuba:
    """One scene, loaded once, of which only the flash's direction changes from frame to frame.

    Parameters
    ----------
    scene : TwinScene
    integrator : {"path", "direct"}
    sampler : str
        One of Mitsuba's.
    """

    def __init__(self, mi: Any, scene: TwinScene, integrator: str, sampler: str) -> None:
        self._mi, self._scene = mi, scene
        mi.set_log_level(mi.LogLevel.Error)
        self._loaded = mitsuba_scene(scene, light=0)
        self._parameters = mi.traverse(self._loaded)
        depth = {"max_depth": scene.sampling.max_depth} if integrator == "path" else {}
        self._integrator = mi.load_dict({"type": integrator, **depth})
        film = whole_picture(scene.camera)
        description = sensor_description(film, scene.points, 0, scene.camera.height)
        self._sensor = mi.load_dict({**description, "sampler": {"type": sampler}})

    def image(self, index: int, samples: int, seed: int) -> NDArray[np.float32]:
        """Return (H, W, 3) under one flash."""
        mi, direction = self._mi, self._scene.lights.directions[index]
        up = np.eye(3)[np.argmin(np.abs(direction))].tolist()
        self._parameters["flash.to_world"] = mi.Transform4f().look_at(
            origin=[0, 0, 0], target=(-direction).tolist(), up=up
        )
        self._parameters.update()
        image = mi.render(
            self._loaded, sensor=self._sensor, integrator=self._integrator, spp=samples, seed=1000 * seed + index
        )
        return np.asarray(image, np.float32)[..., :3]
