"""A scene description's file, TOML: read with every fault told at once. docs/scenes.md is its manual."""

import difflib
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from scene.camera import Camera
from scene.errors import RenderError, SceneError
from scene.pose import rotation_from_vector
from scene.reading import json_of, numbers, reading, shortened, text_of
from twin.camera.virtual_camera import Sensor
from twin.description import description_tables
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.description_check import scene_faults
from twin.description.description_tables import (
    CameraTable,
    ConductorTable,
    DescriptionTable,
    EnvironmentTable,
    MaterialTable,
    MeasuredTable,
    ObjectTable,
    PrincipledTable,
    SensorTable,
    SubsurfaceTable,
    TextureTable,
)
from twin.description.light_groups import expand
from twin.description.materials import (
    Conductor,
    Diffuse,
    Material,
    Measured,
    Principled,
    RoughPlastic,
    Subsurface,
    Texture,
)
from twin.description.mesh_files import read_mesh
from twin.description.object_mesh import ObjectMesh, built_in
from twin.description.picture_files import read_picture

Array = NDArray[np.float64]
KINDS = ("diffuse", "rough_plastic", "conductor", "principled", "measured")
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
    try:
        table = DescriptionTable.model_validate(data)
    except ValidationError as error:
        raise _told(path, [_line(fault) for fault in error.errors(include_url=False)]) from None
    faults: list[str] = []
    reader = _Reader(path.parent, faults)
    objects = tuple(reader.object(i, one) for i, one in enumerate(table.objects))
    materials = {name: reader.material(f"materials.{name}", one) for name, one in table.materials.items()}
    environment = reader.environment(table.environment)
    for i, one in enumerate(objects):
        if one.material not in materials:
            known = ", ".join(materials) or "none"
            faults.append(f"objects[{i}].material: found {one.material!r}; the materials here are {known}.")
    if faults:
        raise _told(path, faults)
    reference = table.reference_point_mm
    points = np.concatenate([one.placed.vertices for one in objects])
    middle = (points.min(0) + points.max(0)) / 2 if reference is None else np.array(reference, float)
    found = reader.tried("", lambda: expand(table.lights, path.parent, middle))
    if found is None:
        raise _told(path, faults)
    lights, radii = found
    given = table.camera.sensor
    sensor = None if given is None else reader.tried("camera", lambda: _sensor(given))
    scene = TwinScene(
        _camera(table.camera),
        objects,
        materials,
        lights,
        radii,
        environment,
        Sampling(**table.sampling.model_dump()),
        table.name or path.stem,
        sensor,
        table.camera.files,
    )
    faults += scene_faults(scene)
    if faults:
        raise _told(path, faults)
    return scene


class _Reader:
    """Reads what the tables name; what is at fault is collected, so that one run tells all."""

    def __init__(self, folder: Path, faults: list[str]) -> None:
        self._folder, self._faults = folder, faults
        self._pictures: dict[tuple, NDArray[np.float32]] = {}

    def tried(self, key: str, read: Callable[[], Any]) -> Any:
        """Return what can be read, or None and one fault more."""
        try:
            return read()
        except SceneError as error:
            self._faults.append(f"{key}: {error}" if key else str(error))
            return None

    def object(self, index: int, table: ObjectTable) -> TwinObject:
        key = f"objects[{index}]"
        if table.shape is not None:
            mesh = built_in(table.shape)
            if not table.smooth:
                mesh = ObjectMesh(mesh.vertices, mesh.faces, None, mesh.texcoords)
        else:
            path = self._folder / str(table.mesh)
            mesh = self.tried(f"{key}.mesh", lambda: read_mesh(path, is_smooth=table.smooth))
            mesh = mesh if mesh is not None else built_in("square")
        matrix = _rotation(table.rotate_deg) @ np.diag([*table.scale, 1.0])
        matrix[:3, 3] = table.translate_mm
        if table.matrix is not None:
            given = np.array(table.matrix, float)
            if not np.array_equal(given[3], [0, 0, 0, 1]) or abs(np.linalg.det(given[:3, :3])) < 1e-12:
                self._faults.append(
                    f"{key}.matrix: expected rows [r r r t] of an affine map that can be undone, and the last row "
                    "[0, 0, 0, 1]."
                )
            matrix = given @ matrix
        if table.pose is not None:
            pose = self.tried(f"{key}.pose", lambda: _pose(self._folder / str(table.pose)))
            matrix = matrix if pose is None else pose @ matrix
        return TwinObject(table.name or f"object_{index}", mesh, table.material, matrix)

    def material(self, key: str, table: MaterialTable) -> Material:
        if isinstance(table, MeasuredTable):
            return Measured(self._folder / table.file)
        if isinstance(table, ConductorTable):
            return Conductor(table.metal, table.roughness)
        reflectance = self._value(f"{key}.reflectance", table.reflectance)
        if isinstance(table, PrincipledTable):
            return Principled(reflectance, table.roughness, table.metallic, table.specularity)
        below = _subsurface(table.subsurface)
        if table.kind == "diffuse":
            return Diffuse(reflectance, below)
        specularity = self._value(f"{key}.specularity", table.specularity)
        return RoughPlastic(reflectance, table.roughness, specularity, table.index, below, table.covered)

    def environment(self, table: EnvironmentTable) -> Environment:
        ambient = tuple(table.ambient)
        path = None if table.map is None else self._folder / table.map
        radiance = None if path is None else self.tried("environment.map", lambda: read_picture(path))
        return Environment(radiance, table.scale, table.rotate_deg, ambient)  # type: ignore[arg-type]

    def _value(self, key: str, given: Any) -> Any:
        if isinstance(given, TextureTable):
            path, name = self._folder / given.file, (given.file, given.encoding)
            if name not in self._pictures:
                found = self.tried(key, lambda: read_picture(path, given.encoding))
                self._pictures[name] = np.zeros((1, 1, 3), np.float32) if found is None else found
            return Texture(self._pictures[name], given.wrap)
        return tuple(float(part) for part in given) if isinstance(given, list) else given


def _subsurface(table: SubsurfaceTable | None) -> Subsurface | None:
    return None if table is None else Subsurface(table.mean_free_path_mm, tuple(table.albedo), table.share)  # type: ignore[arg-type]


def _camera(table: CameraTable) -> Camera:
    return Camera(
        table.width,
        table.height,
        table.fx,
        table.fy or table.fx,
        (table.width - 1) / 2 if table.cx is None else table.cx,
        (table.height - 1) / 2 if table.cy is None else table.cy,
        tuple(table.distortion),
        table.projection,
        "scene description",
    )


def _sensor(table: SensorTable) -> Sensor:
    given = table.model_dump()
    return Sensor(**{**given, "vignetting": tuple(table.vignetting), "neutral": tuple(table.neutral)})


def _rotation(angles_deg: list[float]) -> Array:
    """Return (4, 4): about x, then y, then z, the axes standing still."""
    x, y, z = (rotation_from_vector(np.radians(angle) * np.eye(3)[i]) for i, angle in enumerate(angles_deg))
    matrix = np.eye(4)
    matrix[:3, :3] = z @ y @ x
    return matrix


def _pose(path: Path) -> Array:
    with reading(path, "not a pose.json that rgbn wrote", RenderError):
        data = json_of(path, error=RenderError)
        return numbers(data["camera_from_scan"], 4, 4) @ np.diag([*[float(data.get("mm_per_unit", 1.0))] * 3, 1.0])


_KEYS = sorted({key for table in vars(description_tables).values() for key in getattr(table, "model_fields", {})})


def _told(path: Path, faults: list[str]) -> RenderError:
    faults = [shortened(fault, 600) for fault in faults]
    return RenderError(
        f"{path}: " + (faults[0] if len(faults) == 1 else "\n  ".join([f"{len(faults)} faults", *faults[:100]]))
    )


def _line(fault: Any) -> str:
    # pydantic puts the kind of a table into the path, which no file holds.
    location = [part for part in fault["loc"] if isinstance(part, int) or part not in TAGS]
    path = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")
    if fault["type"] == "extra_forbidden":
        close = difflib.get_close_matches(str(location[-1]), _KEYS, n=1)
        return f"{path}: unknown key.{f' Did you mean {close[0]}?' if close else ' docs/scenes.md lists them.'}"
    if fault["type"] == "missing":
        return f"{path}: missing."
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be ", "expected ").rstrip(".")
    if fault["type"].startswith("union_tag"):
        return f"{path}.kind: {message[0].lower()}{message[1:]}."
    found = fault["input"]
    shown = f"a table with {', '.join(found) or 'nothing'}" if isinstance(found, dict) else repr(found)
    return f"{path}: found {shown}; {message[0].lower()}{message[1:]}."
