"""Meshes as binary glTF, which browsers and standard viewers show [Khronos2021].

The camera's frame is glTF's own: x right, y up, z toward the viewer.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_whole

METRES_PER_MM = 1e-3
"""glTF counts in metres."""


def textured(
    vertices: NDArray, faces: NDArray, normals: NDArray | None, texcoords: NDArray, surface: Mapping[str, Any]
) -> Any:
    """Return a `trimesh.Trimesh` with a material, for `write_glb`.

    Parameters
    ----------
    vertices, normals : (V, 3)
        Millimetres; unit, or None.
    faces : (T, 3) int
    texcoords : (V, 2)
        Of its picture, 0 to 1: right, and down from the upper edge.
    surface : mapping
        What a `trimesh.visual.material.PBRMaterial` takes; a picture, sRGB, as an array (h, w, 3) uint8. Unless
        another is said it is no metal, of roughness 1.
    """
    import trimesh
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    named: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0, **surface}
    pictures = {name: Image.fromarray(value) for name, value in named.items() if isinstance(value, np.ndarray)}
    material = PBRMaterial(**{**named, **pictures})
    mesh = trimesh.Trimesh(METRES_PER_MM * vertices, faces, vertex_normals=normals, process=False)
    # trimesh counts t upward and turns it over as it writes.
    mesh.visual = TextureVisuals(texcoords * [1, -1] + [0, 1], material=material)
    return mesh


def write_glb(path: Path, made: Any) -> None:
    """Write a `trimesh.Trimesh`, in metres."""
    data = made.export(file_type="glb")
    assert isinstance(data, bytes)
    with write_whole(path) as file:
        file.write(data)
