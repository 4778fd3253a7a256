"""A scene description as a folder: scene.toml, meshes as PLY, textures as arrays. Reading it gives the same scene."""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.toml_text import toml_text
from scene.files import write_npy, write_text
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import KINDS, Material, Measured, Texture
from twin.description.mesh_files import write_mesh

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
    keep, around = _Keeper(folder), scene.environment
    keys = ("width", "height", "fx", "fy", "cx", "cy", "distortion", "projection")
    camera = {key: getattr(scene.camera, key) for key in keys}
    environment: dict[str, Any] = {"ambient": around.ambient}
    if around.radiance is not None:
        file = keep.picture(around.radiance)
        environment |= {"map": file, "scale": around.scale, "rotate_deg": around.rotate_deg}
    description = {
        "version": 1,
        "name": scene.name,
        "reference_point_mm": scene.lights.reference_point_mm,
        "camera": {**camera, "files": scene.files, "sensor": scene.sensor},
        "objects": [_object(one, f"meshes/{number:02d}.ply", folder) for number, one in enumerate(scene.objects)],
        "materials": {name: keep.material(material) for name, material in scene.materials.items()},
        "environment": environment,
        "lights": [_light(scene, index) for index in range(len(scene.lights))],
        "sampling": scene.sampling,
    }
    path = folder / "scene.toml"
    write_text(path, toml_text(description))
    return path


def _object(one: TwinObject, file: str, folder: Path) -> dict[str, Any]:
    write_mesh(folder / file, one.mesh)
    matrix = None if np.array_equal(one.matrix, np.eye(4)) else one.matrix
    smooth = one.mesh.normals is not None
    return {"name": one.name, "mesh": file, "smooth": smooth, "material": one.material, "matrix": matrix}


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
            else:
                table[key] = value
        return table
