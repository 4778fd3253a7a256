"""A scene description's file, TOML: read with every fault told at once. docs/reference/scene-toml.md is its manual."""

import difflib
import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from formats.document_faults import Location, fault_line
from formats.pictures import read_picture
from scene.camera import Camera
from scene.errors import RenderError, SceneError
from scene.pose import rotation_from_vector
from scene.reading import json_of, numbers, reading, shortened, text_of
from twin.camera.virtual_camera import Sensor
from twin.description import description_tables
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.description_check import faults_of, scene_faults
from twin.description.description_tables import CameraTable, DescriptionTable, ObjectTable, TextureTable
from twin.description.light_groups import expand
from twin.description.materials import KINDS, Subsurface, Texture
from twin.description.mesh_files import read_mesh
from twin.description.object_mesh import ObjectMesh, built_in

Array = NDArray[np.float64]
MOST_TRIANGLES = 10_000_000
"""Of all objects: some 100 bytes each, in several copies. A built-in sphere has 65,000."""
TAGS = {*KINDS, "distant", "point", "area", "ring", "hemisphere", "session"}


def read_scene(path: Path) -> TwinScene:
    """Read a scene description with all that it names.

    Parameters
    ----------
    path : Path
        A .toml; relative paths in it start from its folder.

    Raises
    ------
    RenderError
        Whatever is at fault, one line each, with the key.
    """
    if not path.is_file():
        raise RenderError(f"{path}: not found.")
    with reading(path, "not TOML", RenderError, do="Correct that line."):
        data = tomllib.loads(text_of(path, error=RenderError))
    with reading(path, "cannot be followed", RenderError, do="Correct it, or the files that it names."):
        return _scene(path, data)


def _scene(path: Path, data: dict[str, Any]) -> TwinScene:
    materials = data.get("materials")
    try:
        named = _Named(path.parent, tuple(materials) if isinstance(materials, dict) else ())
        table = DescriptionTable.model_validate(data, context=named)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        raise _told(path, [fault_line(fault, _meant, hidden=TAGS) for fault in faults]) from None
    objects = tuple(_object(index, one) for index, one in enumerate(table.objects))
    triangles = sum(len(one.mesh.faces) for one in objects)
    if triangles > MOST_TRIANGLES:
        raise _told(
            path, [f"objects: {triangles} triangles in all; expected {MOST_TRIANGLES} at most, or coarser meshes."]
        )
    reference = table.reference_point_mm
    points = np.concatenate([one.placed.vertices for one in objects])
    middle = (points.min(0) + points.max(0)) / 2 if reference is None else np.array(reference, float)
    try:
        lights, radii = expand(table.lights, path.parent, middle)
    except SceneError as error:
        raise _told(path, [str(error)]) from None
    scene = TwinScene(
        _camera(table.camera),
        objects,
        table.materials,
        lights,
        radii,
        table.environment,
        table.sampling,
        table.name or path.stem,
        table.camera.sensor,
        table.camera.files,
    )
    faults = scene_faults(scene)
    if faults:
        raise _told(path, faults)
    return scene


class _Named:
    """Reads what tables name, while they are checked: every fault is told at once, that of a file too."""

    def __init__(self, folder: Path, materials: tuple[str, ...]) -> None:
        self._folder, self.materials = folder, materials
        self._pictures: dict[tuple, NDArray[np.float32]] = {}
        self._meshes: dict[str, ObjectMesh] = {}

    def path(self, name: str) -> Path:
        return self._folder / name

    def picture(self, name: str) -> NDArray[np.float32]:
        return read_picture(self._folder / name)

    def mesh(self, name: str) -> ObjectMesh:
        if name not in self._meshes:
            self._meshes[name] = read_mesh(self._folder / name)
        return self._meshes[name]

    def texture(self, table: dict[str, Any]) -> Texture:
        given = TextureTable.model_validate(table)
        name = given.file, given.encoding
        if name not in self._pictures:
            self._pictures[name] = read_picture(self._folder / given.file, given.encoding)
        return Texture(self._pictures[name], given.wrap)

    def pose(self, name: str) -> Array:
        path = self._folder / name
        with reading(path, "not a pose.json that rgbn wrote", RenderError):
            data = json_of(path, error=RenderError)
            scale = float(data.get("mm_per_unit", 1.0))
            return numbers(data["camera_from_scan"], 4, 4) @ np.diag([scale, scale, scale, 1.0])


def _object(index: int, table: ObjectTable) -> TwinObject:
    """Return an object where its table puts it: scaled, turned about x, y and z, moved; then its matrix, then its pose.

    The axes stand still.
    """
    mesh = built_in(table.shape) if table.mesh is None else table.mesh  # type: ignore[arg-type]
    x, y, z = (rotation_from_vector(np.radians(angle) * np.eye(3)[i]) for i, angle in enumerate(table.rotate_deg))
    matrix = np.eye(4)
    matrix[:3, :3] = z @ y @ x @ np.diag(table.scale)
    matrix[:3, 3] = table.translate_mm
    for outer in (table.matrix, table.pose):
        matrix = matrix if outer is None else np.array(outer, float) @ matrix
    mesh = mesh if table.smooth else replace(mesh, normals=None)
    return TwinObject(table.name or f"object_{index}", mesh, table.material, matrix)


def _camera(table: CameraTable) -> Camera:
    return Camera(
        table.width,
        table.height,
        table.fx,
        table.fy or table.fx,
        (table.width - 1) / 2 if table.cx is None else table.cx,
        (table.height - 1) / 2 if table.cy is None else table.cy,
        table.distortion,
        table.projection,
        "scene description",
    )


_KEYS = sorted(
    {key for table in vars(description_tables).values() for key in getattr(table, "model_fields", {})}
    | {field.name for table in (*KINDS.values(), Subsurface, Sensor, Sampling, Environment) for field in fields(table)}
    | {"map"}
)


def _told(path: Path, faults: list[str]) -> RenderError:
    return faults_of(str(path), [shortened(fault, 600) for fault in faults])


def _meant(location: Location) -> str:
    """Say which key may be meant by one that is unknown."""
    own = str(location[-1])
    close = difflib.get_close_matches(own, [key for key in _KEYS if key != own], n=1)
    return f"Did you mean {close[0]}?" if close else "docs/reference/scene-toml.md lists them."
