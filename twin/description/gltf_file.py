"""A scene's objects as one binary glTF file, which standard viewers open: meshes, base colours, roughness."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from formats.meshes.glb_files import textured, write_glb
from formats.picture_files import srgb_from_linear
from scene.errors import RenderError
from scene.normals import unit
from twin.description.description import TwinScene
from twin.description.materials import Diffuse, RoughPlastic, Texture
from twin.description.object_mesh import ObjectMesh


def write_gltf(scene: TwinScene, path: Path, told: dict[str, Any]) -> list[str]:
    """Write a scene's objects as .glb; return what the file cannot say.

    Parameters
    ----------
    scene : TwinScene
        Its objects of matte or rough plastic surfaces. The camera's frame is glTF's own: x right, y up, z toward the
        viewer; millimetres become metres.
    path : Path
    told : dict
        What is said of the material, how far it misses the photographs: kept as the scene's `extras`.

    Raises
    ------
    RenderError
        An object is of metal, or of a material that was measured or put together: glTF's differs too much.

    Notes
    -----
    glTF's material is a Lambertian body under a GGX coat of index 1.5 whose alpha is the square of `roughnessFactor`
    [Khronos2021]. Base colours are sRGB, 8 bits.
    """
    import trimesh

    made, notes = trimesh.Scene(metadata=told), set[str]()
    for one in scene.objects:
        material = scene.materials[one.material]
        if not isinstance(material, Diffuse | RoughPlastic):
            raise RenderError(
                f"{one.name}: its material is {type(material).__name__.lower()}; glTF takes diffuse and rough_plastic. "
                "Export the scene for Mitsuba instead."
            )
        made.add_geometry(_geometry(one.placed, material), node_name=one.name, geom_name=one.name)
        notes.update(_lost(material))
    write_glb(path, made)
    return [f"{path.name}: {note}" for note in sorted(notes)]


def _geometry(mesh: ObjectMesh, material: Diffuse | RoughPlastic) -> Any:
    reflectance = material.reflectance
    # A matte surface is the roughest one, its coat still there: glTF has no other.
    alpha = min(getattr(material, "roughness", 1.0), 1.0)
    surface: dict[str, Any] = {"roughnessFactor": float(np.sqrt(alpha))}
    if isinstance(reflectance, Texture):
        codes = np.round(255 * srgb_from_linear(reflectance.values)).astype(np.uint8)
        surface["baseColorTexture"] = np.broadcast_to(codes, (*codes.shape[:2], 3)).copy()
    elif reflectance != "vertex":
        # The factor is linear in the file, and trimesh takes it as it is.
        surface["baseColorFactor"] = [*(float(value) for value in reflectance), 1.0]
    normals = None if mesh.normals is None else np.nan_to_num(unit(mesh.normals))
    texcoords = np.zeros((len(mesh.vertices), 2)) if mesh.texcoords is None else mesh.texcoords
    shape = textured(mesh.vertices, mesh.faces, normals, texcoords, surface)
    if reflectance == "vertex" and mesh.colours is not None:
        linear = np.c_[np.clip(mesh.colours, 0, 1), np.ones(len(mesh.colours))]
        shape.visual.vertex_attributes["color"] = np.round(255 * linear).astype(np.uint8)
    return shape


def _lost(material: Diffuse | RoughPlastic) -> Iterator[str]:
    """Yield what glTF has no word for."""
    if isinstance(material, Diffuse):
        yield "a matte surface has glTF's coat of roughness 1"
        return
    if not isinstance(material.specularity, Texture) and material.specularity != 1:
        yield f"glTF's coat is a full one; this has {material.specularity:.2f} of it"
    if material.distribution != "ggx":
        yield "glTF's facets are GGX's, these are Beckmann's"
