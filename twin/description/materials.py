"""What the twin's objects are made of: plain numbers and textures, without a renderer."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator, Strict, ValidationInfo

from twin.description.checked_values import AboveNone, Positive, Rgb, Share, Shares, as_fault, checked, named, three

VERTEX = "vertex"
"""A reflectance that is the mesh's own colour, vertex by vertex."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface.

    Parameters
    ----------
    values : (h, w, 3) or (h, w, 1) float32
        Linear. The first row lies at texture coordinate t = 0 and t points down: t = (row + 0.5) / h.
    wrap : {"repeat", "clamp"}
        Beyond 0 to 1.
    """

    values: NDArray[np.float32]
    wrap: Literal["repeat", "clamp"] = "repeat"

    def at(self, texcoords: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the values (P, channels) at texture coordinates (P, 2), bilinear between the centres of the texels."""
        from scipy.ndimage import map_coordinates

        place = (texcoords * self.values.shape[1::-1] - 0.5).T[::-1]
        mode = "grid-wrap" if self.wrap == "repeat" else "nearest"
        channels = np.moveaxis(self.values, -1, 0)
        found = [map_coordinates(one, place, np.float32, 1, mode) for one in channels]
        return np.stack(found, -1).astype(np.float32)


def _reflectance(value: Any, info: ValidationInfo[Any]) -> Any:
    """Return one of the four forms of a table's reflectance; `info.context.texture` reads a picture's table."""
    if isinstance(value, dict):
        return as_fault(value, info.context.texture)
    value = three(value)
    if isinstance(value, list) and len(value) == 3 and all(type(part) in (int, float) for part in value):
        return tuple(float(part) for part in value)
    if value == VERTEX:
        return value
    raise ValueError('expected a number, [r, g, b], "vertex" or { file = "...", encoding = "srgb" }')


def _specularity(value: Any, info: ValidationInfo[Any]) -> Any:
    if isinstance(value, dict):
        return as_fault(value, info.context.texture)
    if type(value) in (int, float):
        return float(value)
    raise ValueError('expected a number or { file = "...", encoding = "linear" }')


Reflectance = Annotated[Rgb | Texture | Literal["vertex"], PlainValidator(_reflectance)]
"""Of each channel, 0 to 1, linear."""
Distribution = Literal["ggx", "beckmann"]
"""Of the slopes of a rough surface's facets."""


@checked
@dataclass(frozen=True)
class Subsurface:
    """What lies below a surface that is partly open: a cloudy medium that light wanders through.

    Parameters
    ----------
    mean_free_path_mm : float
        How far light goes between two scatterings, on average (the transport mean free path of a real material: the
        scattering here is even in all directions).
    albedo : tuple of 3 float
        Share of the light that goes on at a scattering, 0 to 1.
    share : float
        How much of the surface is open to the medium, 0 to 1. The rest reflects as if there were none.

    Notes
    -----
    The boundary is a mixture: (1 - share) of the material's reflection, share of nothing at all, so that light passes
    straight into a medium of the same refractive index. Energy is kept exactly. What it leaves out of a real boundary:
    the refraction, and the gloss of the share that is open.
    """

    mean_free_path_mm: Positive
    albedo: Shares = (0.9, 0.9, 0.9)
    share: Share = 0.5


@checked
@dataclass(frozen=True)
class Diffuse:
    """A matte surface: radiance = reflectance / pi * irradiance."""

    reflectance: Reflectance
    subsurface: Subsurface | None = None


@checked
@dataclass(frozen=True)
class RoughPlastic:
    """A matte body under a clear rough coat [Walter2007].

    Parameters
    ----------
    reflectance : Reflectance
        Of the body.
    roughness : float
        alpha of the coat's facets, above 0; everywhere in a scene description alpha as Mitsuba has it.
    specularity : float or Texture
        Factor on the coat's reflectance; 1: what its index of refraction gives, 0: only the body.
    index : float
        Of refraction, of the coat.
    covered : float
        Share of the body's light that the coat dims on its way in and out, most where seen or lit aslant; the rest
        leaves as from a matte surface. The specularity itself: a full coat over so much of the surface, the rest bare.
        0: a lobe upon a matte body, as many renderers have it, which may give back more light than it gets.
    distribution : {"ggx", "beckmann"}
        Of the facets' slopes: GGX has the longer tail, so that highlights have a halo [Walter2007]; Beckmann's is a
        Gaussian [Beckmann1963].
    body_roughness : float or None
        Of what of the body lies bare, by the law of [Burley2012]: at 1 it gives back more light toward where it comes
        from, as plaster does, at 0 less where seen or lit aslant. None: the same everywhere (Lambert).
    second : float
        Share of the facets that are of another roughness: a second lobe, such as a sharp peak within a wide gloss.
    second_roughness : float
        Theirs.
    """

    reflectance: Reflectance
    roughness: AboveNone = 0.1
    specularity: Annotated[float | Texture, PlainValidator(_specularity)] = 1.0
    index: Annotated[float, Strict(), Field(gt=1, le=5)] = 1.49
    subsurface: Subsurface | None = None
    covered: Share = 1.0
    distribution: Distribution = "ggx"
    body_roughness: Share | None = None
    second: Share = 0.0
    second_roughness: AboveNone = 0.5


@checked
@dataclass(frozen=True)
class Conductor:
    """A metal by name: Au, Cu, Al, Cr, Ag ... or "none", a perfect mirror; roughness 0 is polished."""

    metal: Annotated[str, Strict()]
    roughness: Share = 0.1
    distribution: Distribution = "ggx"


@checked
@dataclass(frozen=True)
class Principled:
    """Disney's material [Burley2012], of whose numbers these are kept.

    Parameters
    ----------
    reflectance : Reflectance
        Its base colour.
    roughness : float
        alpha as everywhere here: the square of Disney's own roughness.
    metallic : float
        0 to 1.
    specularity : float
        Disney's specular, 0 to 1; 0.5 is an index of refraction of 1.5.
    """

    reflectance: Reflectance
    roughness: AboveNone = 0.25
    metallic: Share = 0.0
    specularity: Share = 0.5


@checked
@dataclass(frozen=True)
class Measured:
    """A measured reflectance, a .bsdf file of the RGL database [Dupuy2018]."""

    file: Annotated[Path, named("path")]


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
