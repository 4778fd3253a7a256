"""What a rendering ought to be solved to: normals, depth, material and shadows, by ray casting, without noise.

The true maps of a scene description, pixel by pixel, where the pixel's centre looks.
"""

from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from scene.files import create_array, write_npy
from scene.mesh import Mesh
from scene.normals import unit
from twin.description.description import TwinScene, white_of
from twin.description.materials import Conductor, Material, Measured, Principled, Texture
from twin.visibility import Sight

Array = NDArray[np.float64]
Numbers = Annotated[NDArray[np.float32], np.float32, np.nan]
Vectors = Annotated[NDArray[np.float32], np.float32, np.nan, 3]
Bits = Annotated[NDArray[np.uint8], np.uint8, 0]
"""Maps: type, what stands where nothing is seen, and the axis beyond rows and columns; of bits, those of the lights."""


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Maps of the camera's full size; NaN (or -1, or no bit) where no object is seen.

    Parameters
    ----------
    mask : (H, W) bool
        An object is seen.
    object : (H, W) int16
        Which of the scene's objects.
    normals : (H, W, 3) float32
        Unit, camera frame: those that the materials shade with, turned to the side that is seen.
    z_mm : (H, W) float32
        In the camera frame, negative before a perspective camera.
    height_mm : (H, W) float32
        z_mm above the lowest point seen.
    albedo : (H, W, 3) float32
        Matte reflectance; 0 for metals, NaN for measured materials. As pixel value under a light of intensity 1.
    roughness, specularity : (H, W) float32
        The material's parameters; matte: 1 and 0, metals: specularity 1, measured: NaN.
    attached, cast : (H, W, ceil(N / 8)) uint8
        One bit a light, light i in byte i // 8, bit i % 8: the surface faces away from it; it faces it, but something
        stands between. Discs are taken by their middle.
    """

    mask: Annotated[NDArray[np.bool_], bool, 0]
    object: Annotated[NDArray[np.int16], np.int16, -1]
    normals: Vectors
    z_mm: Numbers
    height_mm: Numbers
    albedo: Vectors
    roughness: Numbers
    specularity: Numbers
    attached: Bits
    cast: Bits


def ground_truth(scene: TwinScene, *, folder: Path | None = None) -> GroundTruth:
    """Return the true maps of a scene.

    Parameters
    ----------
    folder : Path or None
        Gets the maps as `save_ground_truth` writes them; they are memory-mapped then. None: they are in memory.

    Raises
    ------
    RenderError
        The camera sees nothing.
    """
    maps: dict[str, Any] = {}
    with ExitStack() as files:
        for name, kind in get_type_hints(GroundTruth, include_extras=True).items():
            dtype, unknown, *depth = kind.__metadata__
            depth = [-(-len(scene.lights) // 8)] if dtype == np.uint8 else depth
            shape = (scene.camera.height, scene.camera.width, *depth)
            place = None if folder is None else create_array(_place(folder, name), shape, dtype)
            maps[name] = np.empty(shape, dtype) if place is None else files.enter_context(place)
            maps[name][:] = unknown
        _fill(scene, maps)
    if folder is not None:
        maps = {name: np.load(_place(folder, name), mmap_mode="r") for name in maps}
    return GroundTruth(**maps)


def _fill(scene: TwinScene, maps: dict[str, Any]) -> None:
    film, camera = scene.film(), scene.camera
    meshes = [one.placed for one in scene.objects]
    first_vertex = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first_face = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + first for mesh, first in zip(meshes, first_vertex, strict=False)])
    whole = Mesh(scene.points, faces)
    sight = Sight(whole, camera, scene.lights)
    for band, face, weights, points in sight.rows(film.rows, film.columns):
        rows, columns = np.nonzero(face >= 0)
        at = (band.start + rows, film.columns.start + columns)
        face, weights, points = face[rows, columns], weights[rows, columns], points[rows, columns]
        which = np.searchsorted(first_face, face, "right") - 1
        maps["object"][at] = which
        maps["z_mm"][at] = points[:, 2]
        flat = whole.face_normals[face]
        normals = np.array(flat)
        for number, mesh in enumerate(meshes):
            mine = which == number
            corners = mesh.faces[face[mine] - first_face[number]]
            if mesh.normals is not None:
                normals[mine] = unit(_mixed(mesh.normals, corners, weights[mine]))
            texcoords = None if mesh.texcoords is None else _mixed(mesh.texcoords, corners, weights[mine])
            colours = None if mesh.colours is None else _mixed(mesh.colours, corners, weights[mine])
            found = _appearance(scene.materials[scene.objects[number].material], texcoords, colours)
            where = (at[0][mine], at[1][mine])
            for name, values in zip(("albedo", "roughness", "specularity"), found, strict=True):
                maps[name][where] = values * white_of(scene.lights) if name == "albedo" else values
        _, rays = camera.rays(np.stack([at[1], at[0]], -1))
        # What is seen from behind has its back for a front, as two-sided materials have.
        side = np.where(np.sum(flat * rays, -1, keepdims=True) > 0, -1.0, 1.0)
        flat, normals = side * flat, side * normals
        maps["normals"][at] = normals
        for name, bits in zip(("attached", "cast"), sight.shadows(points, normals, flat), strict=True):
            maps[name][at] = np.packbits(bits, axis=1, bitorder="little")
    np.greater_equal(maps["object"], 0, out=maps["mask"])
    np.subtract(maps["z_mm"], np.fmin.reduce(maps["z_mm"], axis=None), out=maps["height_mm"])


def lights_of(bits: NDArray[np.uint8], count: int) -> NDArray[np.bool_]:
    """Return (N, H, W) bool of the N lights' bits (H, W, ceil(N / 8))."""
    return np.moveaxis(np.unpackbits(bits, axis=-1, count=count, bitorder="little"), -1, 0).astype(bool)


def save_ground_truth(truth: GroundTruth, folder: Path) -> None:
    """Write every map as truth_NAME.npy; `truth_normals.npy` and so on."""
    for field in fields(truth):
        write_npy(_place(folder, field.name), getattr(truth, field.name))


def _place(folder: Path, name: str) -> Path:
    return folder / f"truth_{name}.npy"


def _mixed(values: Array, corners: NDArray[np.int64], weights: Array) -> Array:
    return np.einsum("pc,pcx->px", weights, values[corners])


def _appearance(material: Material, texcoords: Array | None, colours: Array | None) -> tuple[Any, Any, Any]:
    """Return albedo, roughness and specularity: numbers, or one row a pixel."""
    if isinstance(material, Measured):
        return np.nan, np.nan, np.nan
    if isinstance(material, Conductor):
        return 0.0, material.roughness, 1.0

    def value(given: Any) -> Any:
        if isinstance(given, Texture):
            assert texcoords is not None
            return given.at(texcoords)
        return colours if isinstance(given, str) else np.asarray(given, float)

    albedo = value(material.reflectance)
    if isinstance(material, Principled):
        return albedo * (1 - material.metallic), material.roughness, material.specularity
    specularity = value(getattr(material, "specularity", 0.0))
    one_channel = specularity.mean(-1) if np.ndim(specularity) == 2 else specularity
    return albedo, getattr(material, "roughness", 1.0), one_channel
