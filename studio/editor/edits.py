"""What can be done to a scene: functions from one description to the next. None changes what it is given.

They raise RenderError where the next would be no scene.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from studio.editor.placement import Placement, matrix_of, placement_of
from twin.description.description import TwinObject, TwinScene
from twin.description.light_groups import LightGroup, direction, expand
from twin.description.materials import Diffuse, Material
from twin.description.object_mesh import ObjectMesh, built_in

Array = NDArray[np.float64]
FILLED = 0.8
"""Share of the picture's width or height that a new object fills."""
START_MATERIAL = "matte"


@cache
def start_scene() -> TwinScene:
    """Return what a new scene is: a matte sphere, whose place the first object takes, in 24 distant lights.

    The lights are three rings of eight, 20 to 60 degrees from the camera's axis.
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
    matrix = np.eye(4)
    matrix[:3, 3] = _before_the_camera(scene.camera, high - low) - (low + high) / 2
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
    """Return the scene without an object, which may not be the only one."""
    if len(scene.objects) == 1:
        raise RenderError(f"objects: {scene.objects[0].name!r} is the only one; a scene has at least one.")
    return replace(scene, objects=(*scene.objects[:index], *scene.objects[index + 1 :]))


def placed(scene: TwinScene, index: int, placement: Placement) -> TwinScene:
    """Return the scene with an object where finite numbers say, and factors that are not 0."""
    numbers = np.concatenate([placement.middle_mm, placement.rotate_deg, placement.scale])
    if not np.isfinite(numbers).all() or not placement.scale.all():
        raise RenderError(
            f"objects[{index}]: place {placement.middle_mm} mm, scale {placement.scale}; expected finite numbers and "
            "a scale that is not 0."
        )
    return _with_object(scene, index, matrix=matrix_of(scene.objects[index], placement))


def turned(scene: TwinScene, index: int, middle_mm: Array, rotation: Array) -> TwinScene:
    """Return the scene with an object moved rigidly, so that its middle and its rotation (3, 3) are these."""
    one, was = scene.objects[index], placement_of(scene.objects[index])
    move = np.eye(4)
    move[:3, :3] = rotation @ was.rotation.T
    move[:3, 3] = middle_mm - move[:3, :3] @ was.middle_mm
    return _with_object(scene, index, matrix=move @ one.matrix)


def scaled(scene: TwinScene, index: int, factor: float) -> TwinScene:
    """Return the scene with an object `factor` times as large, its middle where it is."""
    if not (math.isfinite(factor) and factor > 0):
        raise RenderError(f"objects[{index}]: scaled by {factor:g}; expected a factor above 0.")
    one, was = scene.objects[index], placement_of(scene.objects[index])
    matrix = one.matrix.copy()
    matrix[:3, :3] *= factor
    matrix[:3, 3] = was.middle_mm + factor * (one.matrix[:3, 3] - was.middle_mm)
    return _with_object(scene, index, matrix=matrix)


def assigned(scene: TwinScene, index: int, material: str) -> TwinScene:
    """Return the scene with an object made of one of the scene's materials."""
    return _with_object(scene, index, material=material)


def with_material(scene: TwinScene, name: str, material: Material) -> TwinScene:
    """Return the scene with a material, new or in the place of the one of this name, which may not be empty."""
    if not name.strip():
        raise RenderError("materials: expected a name that is not empty.")
    return replace(scene, materials={**scene.materials, name: material})


def without_material(scene: TwinScene, name: str) -> TwinScene:
    """Return the scene without a material, of which no object may be made."""
    users = [one.name for one in scene.objects if one.material == name]
    if users:
        raise RenderError(f"materials.{name}: {', '.join(users)} is made of it. Give that another material first.")
    return replace(scene, materials={key: value for key, value in scene.materials.items() if key != name})


def with_environment(scene: TwinScene, **changes: object) -> TwinScene:
    """Return the scene with fields of its environment changed: radiance, scale, rotate_deg, ambient."""
    return replace(scene, environment=replace(scene.environment, **changes))  # type: ignore[arg-type]


def with_camera(
    scene: TwinScene, *, width: int | None = None, height: int | None = None, focal_px: float | None = None,
    orthographic: bool | None = None,
) -> TwinScene:  # fmt: skip
    """Return the scene before another camera; None: as it was, at least one pixel.

    A change of size scales the principal point and keeps the distortion.
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


def _with_object(scene: TwinScene, index: int, **changes: object) -> TwinScene:
    one = replace(scene.objects[index], **changes)  # type: ignore[arg-type]
    return replace(scene, objects=(*scene.objects[:index], one, *scene.objects[index + 1 :]))


def with_lights(scene: TwinScene, groups: Sequence[LightGroup], folder: Path) -> TwinScene:
    """Return the scene in these lights alone: a description's [[lights]], a session's file relative to `folder`."""
    lights, radii = expand(groups, folder, scene.lights.reference_point_mm)
    return replace(scene, lights=lights, radii_mm=radii)


def with_more_lights(scene: TwinScene, groups: Sequence[LightGroup], folder: Path) -> TwinScene:
    """Return the scene with these lights beside its own, all near or all distant; names that are taken are numbered."""
    was = scene.lights
    more, radii = expand(groups, folder, was.reference_point_mm)
    if (more.positions_mm is None) != (was.positions_mm is None):
        raise RenderError(
            f"lights: those of the scene are {was.model}, these are {more.model}; all must be of one sort. Replace "
            "them, or give these the same."
        )
    if not np.array_equal(more.reference_point_mm, was.reference_point_mm):
        raise RenderError(
            "lights: a session's lights have their own reference point and stand alone. Replace the others."
        )
    names = list(was.names)
    for name in more.names:
        names.append(_free(name, set(names)))
    positions = None
    if was.positions_mm is not None and more.positions_mm is not None:
        positions = np.concatenate([was.positions_mm, more.positions_mm])
    lights = Lights(
        tuple(names),
        np.concatenate([was.directions, more.directions]),
        np.concatenate([was.intensities, more.intensities]),
        positions,
        was.reference_point_mm,
        white_value=was.white_value,
    )
    return replace(scene, lights=lights, radii_mm=np.concatenate([scene.radii_mm, radii]))


def moved_light(scene: TwinScene, index: int, place_mm: ArrayLike) -> TwinScene:
    """Return the scene with a light at a place (3,): a near one stands there, a distant one shines from that way.

    The place may not be the reference point, where the light's intensity is to hold.
    """
    lights, place = scene.lights, np.asarray(place_mm, float)
    away = place - lights.reference_point_mm
    distance = float(np.linalg.norm(away))
    if not np.isfinite(distance) or distance < 1e-6:
        raise RenderError(f"lights {lights.names[index]}: would stand in the reference point. Move it elsewhere.")
    positions = None if lights.positions_mm is None else _with_row(lights.positions_mm, index, place)
    directions = _with_row(lights.directions, index, away / distance)
    return replace(scene, lights=replace(lights, directions=directions, positions_mm=positions))


def with_intensity(scene: TwinScene, index: int, intensity: ArrayLike) -> TwinScene:
    """Return the scene with a light of another intensity (3,), finite and not negative."""
    value = np.asarray(intensity, float)
    if not np.isfinite(value).all() or (value < 0).any():
        raise RenderError(f"lights {scene.lights.names[index]}: intensity {value}; expected numbers of 0 or more.")
    intensities = _with_row(scene.lights.intensities, index, value)
    return replace(scene, lights=replace(scene.lights, intensities=intensities))


def without_light(scene: TwinScene, index: int) -> TwinScene:
    """Return the scene without a light, which may not be the only one."""
    if len(scene.lights) == 1:
        raise RenderError("lights: this is the only one; a scene has at least one.")
    rest = [number for number in range(len(scene.lights)) if number != index]
    return replace(scene, lights=scene.lights.only(rest), radii_mm=scene.radii_mm[rest])


def _free(name: str, taken: set[str]) -> str:
    if name not in taken:
        return name
    stem = name.rstrip("0123456789").rstrip("_") or name
    return next(f"{stem}_{i:03d}" for i in range(10**6) if f"{stem}_{i:03d}" not in taken)


def _with_row(rows: Array, index: int, value: Array) -> Array:
    changed = rows.copy()
    changed[index] = value
    return changed
