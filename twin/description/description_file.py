"""A scene's document as a file, TOML: read with every fault told at once, written with all that it names."""

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from formats.meshes.scan_files import write_mesh
from formats.toml_documents import Location, TomlTable, fault_line, toml_text
from scene.errors import RenderError, SceneError
from scene.files import write_json, write_npy, write_text
from scene.mesh import Mesh
from scene.reading import reading, text_of, told
from twin.camera.virtual_camera import Sensor
from twin.description.description import Environment, Sampling, TwinScene
from twin.description.description_check import scene_faults
from twin.description.kept_files import KeptFiles
from twin.description.light_groups import LIGHTS
from twin.description.materials import KINDS, Subsurface, Texture, TextureTable
from twin.description.scene_toml import CameraTable, ObjectTable, SceneDocument
from twin.description.value_kinds import Around

TABLES: dict[str, type] = {
    "": SceneDocument,
    "[camera]": CameraTable,
    "[camera.sensor]": Sensor,
    "[[objects]]": ObjectTable,
    **{f'[materials.NAME] kind = "{kind}"': one for kind, one in KINDS.items()},
    "subsurface of a material": Subsurface,
    "picture of a material": TextureTable,
    "[environment]": Environment,
    **{f'[[lights]] kind = "{kind}"': one for kind, one in LIGHTS.items()},
    "[sampling]": Sampling,
}
"""What declares the keys, by where they stand."""


def read_document(path: Path) -> SceneDocument:
    """Read a scene's document with all that it names.

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
        materials = data.get("materials")
        around = Around(path.parent, tuple(materials) if isinstance(materials, dict) else ())
        try:
            document = SceneDocument.model_validate({"name": path.stem} | data, context=around)
        except ValidationError as error:
            raise RenderError(told(path, faults_in(error))) from None
        try:
            faults = scene_faults(document.scene())
        except SceneError as error:
            faults = [str(error)]
        if faults:
            raise RenderError(told(path, faults))
        return document


def read_scene(path: Path) -> TwinScene:
    """Read the scene that a document says; see `read_document`."""
    return read_document(path).scene()


def faults_in(error: ValidationError, at: Location = ()) -> list[str]:
    """Return what pydantic found, one line each, with the key; `at`: that of a fault of the whole table."""
    lists = {name: f"expected tables, each below a line [[{name}]]" for name in ("objects", "lights")}
    return [
        fault_line(fault | {"loc": _as_written(fault["loc"]) or at}, _meant, expected=lists)
        for fault in error.errors(include_url=False)
    ]


def _as_written(location: Location) -> Location:
    """Return a location without the kind of a table, which pydantic puts into the path, and no file holds."""
    own = list(location)
    if len(own) > 2 and own[0] in ("materials", "lights"):
        del own[2]
    return own


def _meant(location: Location) -> str:
    """Say which key may be meant by one that is unknown."""
    own, known = str(location[-1]), {key for table in TABLES.values() for key in keys_of(table)}
    close = difflib.get_close_matches(own, sorted(known - {own}), n=1)
    return f"Did you mean {close[0]}?" if close else "docs/reference/scene-toml.md lists them."


def keys_of(table: type) -> dict[str, Any]:
    """Return a table's keys, each with its JSON schema: description, unit, range, default."""
    schema = TypeAdapter(table).json_schema()
    required = schema.get("required", [])
    return {name: field | {"required": name in required} for name, field in schema["properties"].items()}


def write_document(document: SceneDocument, folder: Path) -> Path:
    """Write a document with copies of all that it names into a folder: scene.toml, meshes/, textures/, poses/.

    Reading it gives the same scene. Returns the path of scene.toml, which is written last.
    """
    path = folder / "scene.toml"
    write_text(path, toml_text(_written(document, KeptFiles(folder))))
    return path


def _written(value: Any, keep: KeptFiles) -> Any:
    """Return a value of a document as TOML has it: without what is as when absent."""
    # From memory: what its file holds by now is not what was seen.
    if isinstance(value, Texture):
        return {"file": keep.made("textures", ".npy", value.values, write_npy), "wrap": value.wrap}
    if isinstance(value, Mesh):
        return keep.made("meshes", ".ply", value, write_mesh)
    if isinstance(value, np.ndarray):
        return keep.made("poses", ".json", {"camera_from_scan": value}, write_json)
    if isinstance(value, Path):
        return keep.copy("files", value)
    if isinstance(value, Mapping):
        return {name: _written(part, keep) for name, part in value.items()}
    if isinstance(value, tuple):
        return [_written(part, keep) for part in value]
    if not (isinstance(value, TomlTable) or is_dataclass(value)):
        return value
    kind = next((kind for kind, one in KINDS.items() if type(value) is one), None)
    table: dict[str, Any] = {"kind": kind} | {name: _written(part, keep) for name, part in vars(value).items()}
    if isinstance(value, Environment) and value.map is not None:
        # A name alone.
        table["map"] = table["map"]["file"]
    return table
