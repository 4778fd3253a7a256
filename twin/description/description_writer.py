"""A scene description as a folder: scene.toml, meshes as PLY, textures as arrays. Reading it gives the same scene."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_npy, write_text
from twin.description.description import TwinScene
from twin.description.materials import KINDS, Material, Measured, Subsurface, Texture
from twin.description.mesh_files import write_ply

NAMES = {material: kind for kind, material in KINDS.items()}


def write_scene(scene: TwinScene, folder: Path) -> Path:
    """Write a scene with everything that it needs into a folder.

    Parameters
    ----------
    folder : Path
        Gets scene.toml, meshes/, textures/, and copies of measured materials.

    Returns
    -------
    path : Path
        The scene.toml, which is written last.

    Notes
    -----
    Lights are written one by one, with what the white ball's value makes of their intensities.
    """
    keep = _Keeper(folder)
    camera = scene.camera
    lines = ["version = 1", f"name = {json.dumps(scene.name)}"]
    lines.append(f"reference_point_mm = {_toml(scene.lights.reference_point_mm)}")
    keys = ("width", "height", "fx", "fy", "cx", "cy", "distortion", "projection")
    files = {} if scene.files is None else {"files": scene.files}
    lines += _table("[camera]", {**{key: getattr(camera, key) for key in keys}, **files})
    if scene.sensor is not None:
        lines += _table("[camera.sensor]", vars(scene.sensor))
    for number, one in enumerate(scene.objects):
        file = f"meshes/{number:02d}.ply"
        write_ply(folder / file, one.mesh)
        place = {} if np.array_equal(one.matrix, np.eye(4)) else {"matrix": one.matrix}
        table = {"name": one.name, "mesh": file, "smooth": one.mesh.normals is not None, "material": one.material}
        lines += _table("[[objects]]", {**table, **place})
    for name, material in scene.materials.items():
        lines += _table(f"[materials.{json.dumps(name)}]", keep.material(material))
    around = scene.environment
    environment: dict[str, Any] = {"ambient": around.ambient}
    if around.radiance is not None:
        file = keep.picture(around.radiance)
        environment |= {"map": file, "scale": around.scale, "rotate_deg": around.rotate_deg}
    lines += _table("[environment]", environment)
    for index in range(len(scene.lights)):
        lines += _table("[[lights]]", _light(scene, index))
    sampling = {key: value for key, value in vars(scene.sampling).items() if value is not None}
    lines += _table("[sampling]", sampling)
    path = folder / "scene.toml"
    write_text(path, "\n".join(lines) + "\n")
    return path


def _light(scene: TwinScene, index: int) -> dict[str, Any]:
    lights = scene.lights
    table = {"name": lights.names[index], "intensity": scene.irradiance[index] / np.pi}
    if lights.positions_mm is None:
        return {"kind": "distant", **table, "direction": lights.directions[index]}
    table["position_mm"] = lights.positions_mm[index]
    radius = float(scene.radii_mm[index])
    return {"kind": "area", **table, "radius_mm": radius} if radius else {"kind": "point", **table}


class _Keeper:
    """Writes textures, each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._pictures: dict[int, str] = {}

    def picture(self, values: NDArray[np.float32]) -> str:
        if id(values) not in self._pictures:
            self._pictures[id(values)] = f"textures/{len(self._pictures):02d}.npy"
            write_npy(self._folder / self._pictures[id(values)], np.asarray(values, np.float32))
        return self._pictures[id(values)]

    def material(self, material: Material) -> dict[str, Any]:
        if isinstance(material, Measured):
            file = f"textures/{material.file.name}"
            (self._folder / "textures").mkdir(parents=True, exist_ok=True)
            if os.path.realpath(material.file) != os.path.realpath(self._folder / file):
                shutil.copyfile(material.file, self._folder / file)
            return {"kind": "measured", "file": file}
        table: dict[str, Any] = {"kind": NAMES[type(material)]}
        for key, value in vars(material).items():
            if isinstance(value, Texture):
                table[key] = {"file": self.picture(value.values), "encoding": "linear", "wrap": value.wrap}
            elif isinstance(value, Subsurface):
                table[key] = vars(value)
            elif value is not None:
                table[key] = value
        return table


def _table(head: str, table: dict[str, Any]) -> list[str]:
    return ["", head, *(f"{key} = {_toml(value)}" for key, value in table.items())]


def _toml(value: Any) -> str:
    """Return a value as TOML: numbers so that they come back the same."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(part) for part in value) + "]"
    if isinstance(value, str | bool):
        return json.dumps(value)
    return repr(value if isinstance(value, int) else float(value))
