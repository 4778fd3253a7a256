"""What the twin's objects are made of: plain numbers and textures, without a renderer."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator, Strict, ValidationInfo

from formats.picture_files import read_picture
from formats.toml_documents import TomlTable
from scene.current import look_of
from twin.description.value_kinds import (
    AboveNone,
    Around,
    Positive,
    Rgb,
    Share,
    Shares,
    as_fault,
    checked,
    file_of,
    key,
    three,
)

VERTEX = "vertex"
"""A reflectance that is the mesh's own colour, vertex by vertex."""
Encoding = Literal["linear", "srgb"]
Wrap = Literal["repeat", "clamp"]
PICTURES_KEPT = 16
"""In memory, of files that were read: the same file is not read again, and is the same picture."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface.

    Parameters
    ----------
    values : (h, w, 3) or (h, w, 1) float32
        Linear. The first row lies at texture coordinate t = 0 and t points down: t = (row + 0.5) / h.
    wrap : {"repeat", "clamp"}
        Beyond 0 to 1.
    file : Path or None
        That it was read from.
    """

    values: NDArray[np.float32]
    wrap: Wrap = "repeat"
    file: Path | None = None

    def at(self, texcoords: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the values (P, channels) at texture coordinates (P, 2), bilinear between the centres of the texels."""
        from scipy.ndimage import map_coordinates

        place = (texcoords * self.values.shape[1::-1] - 0.5).T[::-1]
        mode = "grid-wrap" if self.wrap == "repeat" else "nearest"
        channels = np.moveaxis(self.values, -1, 0)
        found = [map_coordinates(one, place, np.float32, 1, mode) for one in channels]
        return np.stack(found, -1).astype(np.float32)


class TextureTable(TomlTable):
    """A picture: a file, and how its values are coded."""

    file: Annotated[str, key("png, jpg, tif, bmp, exr, hdr or npy. The first row is the top of the texture.")]
    encoding: Annotated[Encoding | None, key("Coding of the values. Absent: whole numbers are sRGB.")] = None
    wrap: Annotated[Wrap, key("What lies beyond the picture's sides.")] = "repeat"


def read_texture(path: Path, encoding: Encoding | None = None, wrap: Wrap = "repeat") -> Texture:
    """Return a picture's file; the same one where it was read before. Raises RenderError: it cannot be read."""
    return _read_texture(path, encoding, wrap, look_of(path))


@lru_cache(PICTURES_KEPT)
def _read_texture(path: Path, encoding: Encoding | None, wrap: Wrap, _state: object) -> Texture:
    return Texture(read_picture(path, encoding), wrap, path)


def _picture(value: Any, info: ValidationInfo[Any]) -> Texture | None:
    """Return a picture or its table as a picture; None: it is neither."""
    if isinstance(value, dict):
        given = TextureTable.model_validate(value)
        place = (info.context or Around()).folder / given.file
        return as_fault(place, lambda path: read_texture(path, given.encoding, given.wrap))
    return value if isinstance(value, Texture) else None


def _reflectance(value: Any, info: ValidationInfo[Any]) -> Any:
    picture, value = _picture(value, info), three(value)
    if picture is not None or value == VERTEX:
        return picture or value
    if isinstance(value, list | tuple) and len(value) == 3 and all(type(part) in (int, float) for part in value):
        return tuple(float(part) for part in value)
    raise ValueError('expected a number, [r, g, b], "vertex" or { file = "...", encoding = "srgb" }')


def _specularity(value: Any, info: ValidationInfo[Any]) -> Any:
    picture = _picture(value, info)
    if picture is not None:
        return picture
    if type(value) in (int, float):
        return float(value)
    raise ValueError('expected a number or { file = "...", encoding = "linear" }')


Reflectance = Annotated[
    Rgb | Texture | Literal["vertex"],
    PlainValidator(_reflectance),
    key('Linear, 0 to 1. `"vertex"` takes the mesh\'s own colours.', input="colour"),
]
Distribution = Literal["ggx", "beckmann"]
Facets = Annotated[Distribution, key("Law of the facets' slopes. GGX has a halo [Walter2007], Beckmann's is a "
                                     "Gaussian [Beckmann1963].")]  # fmt: skip
Alpha = Annotated[AboveNone, key("Roughness of the facets, Mitsuba's alpha.")]


@checked
@dataclass(frozen=True)
class Subsurface:
    """A cloudy medium below a surface that is partly open. Only the engine `mitsuba` renders it.

    Notes
    -----
    The boundary is a mixture: (1 - share) of the material's reflection, share of nothing at all, so that light passes
    straight into a medium of the same refractive index. Energy is kept exactly. What it leaves out of a real boundary:
    the refraction, and the gloss of the share that is open.
    """

    mean_free_path_mm: Annotated[
        Positive,
        key("Mean way of light between two scatterings, even in all directions: the transport mean free path.", "mm"),
    ]  # fmt: skip
    albedo: Annotated[Shares, key("Share of the light that goes on after a scattering.")] = (0.9, 0.9, 0.9)
    share: Annotated[Share, key("Share of the surface that is open to the medium.")] = 0.5


Below = Annotated[
    Subsurface | None,
    key("Light that scatters below the surface of a closed mesh, as in wax.", start={"mean_free_path_mm": 2.0}),
]


@checked
@dataclass(frozen=True)
class Diffuse:
    """A matte surface: radiance = reflectance / pi * irradiance."""

    reflectance: Reflectance
    subsurface: Below = None


@checked
@dataclass(frozen=True)
class RoughPlastic:
    """A matte body under a clear rough coat [Walter2007]."""

    reflectance: Reflectance
    roughness: Alpha = 0.1
    specularity: Annotated[
        float | Texture,
        PlainValidator(_specularity),
        key("Factor on the coat's reflectance. 1: what its index gives; 0: no coat.",
            input="share"),
    ] = 1.0  # fmt: skip
    index: Annotated[float, Strict(), Field(gt=1, le=5), key("Index of refraction of the coat.")] = 1.49
    subsurface: Below = None
    distribution: Facets = "ggx"
    body_roughness: Annotated[
        Share | None,
        key("Roughness of a body that the coat does not dim [Burley2012]. 1: more light goes back to where it comes "
            "from, as from plaster; 0: less light aslant. Absent: Lambert's law, below the coat.",
            start=0.5),
    ] = None  # fmt: skip


@checked
@dataclass(frozen=True)
class Conductor:
    """A metal. With roughness 0 it is polished, and shows no points and no distant lights."""

    metal: Annotated[str, Strict(), key('Au, Ag, Al, Cr, Cu, W ... or "none", a perfect mirror.', input="metal")]
    roughness: Annotated[Share, key("Roughness of the facets; 0 is polished.")] = 0.1
    distribution: Facets = "ggx"


@checked
@dataclass(frozen=True)
class Principled:
    """Disney's material [Burley2012] in part. Disney's roughness is the root of this one."""

    reflectance: Reflectance
    roughness: Alpha = 0.25
    metallic: Annotated[Share, key("Share of metal.")] = 0.0
    specularity: Annotated[Share, key("Disney's specular. 0.5 is an index of refraction of 1.5.")] = 0.5


@checked
@dataclass(frozen=True)
class Measured:
    """A measured reflectance of the RGL database [Dupuy2018]."""

    file: Annotated[Path, file_of(Path, lambda path: path), key("A .bsdf file.")]


Material = Diffuse | RoughPlastic | Conductor | Principled | Measured
KINDS: dict[str, type[Material]] = {
    "diffuse": Diffuse,
    "rough_plastic": RoughPlastic,
    "conductor": Conductor,
    "principled": Principled,
    "measured": Measured,
}
"""What a description's file calls them."""


def seed_materials(
    texture: Reflectance, *, reflectance: Rgb = (0.5, 0.5, 0.5), roughness: float = 0.1, mean_free_path_mm: float = 2.0
) -> dict[str, Material]:
    """Return the eight materials that the benchmark compares, in its order.

    Matte or glossy, plain or textured, solid or with scattering below the surface. The benchmark says eight and lists
    seven; the one that makes the eight complete, `diffuse_texture_subsurface`, stands last. "Specular" is its rough
    plastic.

    Parameters
    ----------
    texture : Reflectance
        Of the textured ones.
    reflectance : tuple of 3 float
        Of the plain ones.
    roughness : float
        Of the glossy ones.
    mean_free_path_mm : float
        Of those with scattering; a fiftieth of the object's size is a fair wax.
    """
    wax = Subsurface(mean_free_path_mm)
    return {
        "diffuse": Diffuse(reflectance),
        "specular": RoughPlastic(reflectance, roughness),
        "diffuse_subsurface": Diffuse(reflectance, wax),
        "specular_subsurface": RoughPlastic(reflectance, roughness, subsurface=wax),
        "specular_texture_subsurface": RoughPlastic(texture, roughness, subsurface=wax),
        "diffuse_texture": Diffuse(texture),
        "specular_texture": RoughPlastic(texture, roughness),
        "diffuse_texture_subsurface": Diffuse(texture, wax),
    }
