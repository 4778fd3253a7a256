"""What can be done to a scene: functions from one description to the next. None changes what it is given."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from studio.editor.placement import Placement, matrix_of, placement_of
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.light_groups import direction
from twin.description.materials import Diffuse, Material
from twin.description.object_mesh import ObjectMesh, built_in

Array = NDArray[np.float64]
FILLED = 0.8
"""Share of the picture's width or height that a new object fills."""
START_MATERIAL = "matte"


@cache
def start_scene() -> TwinScene:
    """Return what a new scene is: a matte sphere in 24 distant lights.

    The first object loaded takes the sphere's place. The lights are three rings of eight, 20 to 60 degrees from the
    camera's axis.
    """
    camera = Camera(640, 480, 1600.0, 1600.0, 319.5, 239.5, source="scene description")
    elevation = np.repeat([70.0, 50.0, 30.0], 8)
    azimuth = np.tile(45.0 * np.arange(8), 3) + np.repeat([0.0, 22.5, 0.0], 8)
    middle = np.array([0.0, 0.0, -600.0])
    names = tuple(f"light_{number:03d}" for number in range(24))
    lights = Lights(names, direction(azimuth, elevation), np.ones((24, 3)), None, middle)
    matrix = np.diag([60.0, 60.0, 60.0, 1.0])
    matrix[:3, 3] = middle
    sphere = TwinObject("sphere", built_in("sphere"), START_MATERIAL, matrix)
    return TwinScene(camera, (sphere,), {START_MATERIAL: Diffuse((0.5, 0.5, 0.5))}, lights, name="scene")


def added(scene: TwinScene, name: str, mesh: ObjectMesh) -> TwinScene:
    """Return the scene with one object more, before the camera so that it fills most of the picture.

    It is taken in millimetres as it is, its axes are the camera's. The first one takes the place of the sphere that a
    new scene has; the lights' reference point goes to its middle.
    """
    is_first = scene.objects is start_scene().objects
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    middle = (low + high) / 2
    matrix = np.eye(4)
    matrix[:3, 3] = _before_the_camera(scene.camera, high - low) - middle
    others = () if is_first else scene.objects
    names = {one.name for one in others}
    unique = name if name not in names else next(f"{name} {i}" for i in range(2, 10**6) if f"{name} {i}" not in names)
    one = TwinObject(unique, mesh, next(iter(scene.materials)), matrix)
    scene = replace(scene, objects=(*others, one))
    return centred(scene) if is_first else scene


def _before_the_camera(camera: Camera, size: Array) -> Array:
    """Return where the middle of a box (3,) stands, that its front fills `FILLED` of the picture in one direction."""
    if camera.is_orthographic:
        return np.array([0.0, 0.0, -2 * float(size.max())])
    away = max(size[0] * camera.fx / camera.width, size[1] * camera.fy / camera.height) / FILLED
    return np.array([0.0, 0.0, -float(away + size[2] / 2)])


def middle_of(scene: TwinScene) -> Array:
    """Return the middle (3,) of the box about all objects, mm."""
    return (scene.points.min(0) + scene.points.max(0)) / 2


def centred(scene: TwinScene) -> TwinScene:
    """Return the scene with the lights about the objects' middle: the reference point goes there, and they with it."""
    lights, middle = scene.lights, middle_of(scene)
    positions = None if lights.positions_mm is None else lights.positions_mm + middle - lights.reference_point_mm
    return replace(scene, lights=replace(lights, positions_mm=positions, reference_point_mm=middle))


def removed(scene: TwinScene, index: int) -> TwinScene:
    """Return the scene without an object.

    Raises RenderError: it is the only one.
    """
    if len(scene.objects) == 1:
        raise RenderError(f"objects: {scene.objects[0].name!r} is the only one; a scene has at least one.")
    return replace(scene, objects=_without(scene.objects, index))


def placed(scene: TwinScene, index: int, placement: Placement) -> TwinScene:
    """Return the scene with an object where numbers say.

    Raises RenderError: a factor is 0, or a number is not finite.
    """
    numbers = np.concatenate([placement.middle_mm, placement.rotate_deg, placement.scale])
    if not np.isfinite(numbers).all() or not placement.scale.all():
        raise RenderError(
            f"objects[{index}]: place {placement.middle_mm} mm, scale {placement.scale}; expected finite numbers and "
            "a scale that is not 0."
        )
    one = scene.objects[index]
    return _with_object(scene, index, replace(one, matrix=matrix_of(one, placement)))


def turned(scene: TwinScene, index: int, middle_mm: Array, rotation: Array) -> TwinScene:
    """Return the scene with an object moved rigidly, so that its middle and its rotation (3, 3) are these."""
    one, was = scene.objects[index], placement_of(scene.objects[index])
    move = np.eye(4)
    move[:3, :3] = rotation @ was.rotation.T
    move[:3, 3] = middle_mm - move[:3, :3] @ was.middle_mm
    return _with_object(scene, index, replace(one, matrix=move @ one.matrix))


def scaled(scene: TwinScene, index: int, factor: float) -> TwinScene:
    """Return the scene with an object `factor` times as large, its middle where it is."""
    one, was = scene.objects[index], placement_of(scene.objects[index])
    if not (math.isfinite(factor) and factor > 0):
        raise RenderError(f"objects[{index}]: scaled by {factor:g}; expected a factor above 0.")
    matrix = one.matrix.copy()
    matrix[:3, :3] *= factor
    matrix[:3, 3] = was.middle_mm + factor * (one.matrix[:3, 3] - was.middle_mm)
    return _with_object(scene, index, replace(one, matrix=matrix))


def assigned(scene: TwinScene, index: int, material: str) -> TwinScene:
    """Return the scene with an object made of one of the scene's materials."""
    return _with_object(scene, index, replace(scene.objects[index], material=material))


def with_material(scene: TwinScene, name: str, material: Material) -> TwinScene:
    """Return the scene with a material, new or in the place of the one of this name.

    Raises RenderError: the name is empty.
    """
    if not name.strip():
        raise RenderError("materials: expected a name that is not empty.")
    return replace(scene, materials={**scene.materials, name: material})


def without_material(scene: TwinScene, name: str) -> TwinScene:
    """Return the scene without a material.

    Raises RenderError: an object is made of it.
    """
    users = [one.name for one in scene.objects if one.material == name]
    if users:
        raise RenderError(f"materials.{name}: {', '.join(users)} is made of it. Give that another material first.")
    return replace(scene, materials={key: value for key, value in scene.materials.items() if key != name})


def with_environment(scene: TwinScene, **changes: object) -> TwinScene:
    """Return the scene with fields of its environment changed: radiance, scale, rotate_deg, ambient."""
    return replace(scene, environment=replace(scene.environment, **changes))  # type: ignore[arg-type]


def without_map(scene: TwinScene) -> TwinScene:
    """Return the scene without environment map; the ambient light stays."""
    return replace(scene, environment=Environment(ambient=scene.environment.ambient))


def with_camera(
    scene: TwinScene,
    *,
    width: int | None = None,
    height: int | None = None,
    focal_px: float | None = None,
    orthographic: bool | None = None,
) -> TwinScene:
    """Return the scene before another camera; a change of size scales the principal point and keeps the distortion.

    None: as it was. Raises RenderError: no pixel is left.
    """
    was = scene.camera
    width, height = was.width if width is None else width, was.height if height is None else height
    if width < 1 or height < 1:
        raise RenderError(f"camera: size {width} x {height} px; expected at least 1 x 1.")
    focal = float(was.fx) if focal_px is None else focal_px
    is_parallel = was.is_orthographic if orthographic is None else orthographic
    projection = "orthographic" if is_parallel else "perspective"
    sized = was.scaled(width, height, width / was.width, height / was.height)
    return replace(scene, camera=replace(sized, fx=focal, fy=focal * was.fy / was.fx, projection=projection))


def with_sampling(scene: TwinScene, sampling: Sampling) -> TwinScene:
    """Return the scene rendered otherwise."""
    return replace(scene, sampling=sampling)


def _with_object(scene: TwinScene, index: int, one: TwinObject) -> TwinScene:
    return replace(scene, objects=(*scene.objects[:index], one, *scene.objects[index + 1 :]))


def _without(items: Sequence, index: int) -> tuple:
    return (*items[:index], *items[index + 1 :])
