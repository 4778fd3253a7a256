"""Materials as Mitsuba's BSDFs: plain dictionaries, with arrays where a file or an object will stand."""

from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from twin.description.materials import (
    VERTEX,
    Conductor,
    Diffuse,
    Material,
    Measured,
    Principled,
    Reflectance,
    RoughPlastic,
    Subsurface,
    Texture,
)

VERTEX_COLOUR = "vertex_color"
"""Mitsuba's name of a mesh's r, g, b."""


LEAST_SPECULAR = 1e-3
"""Disney's specular beside a metal: it reflects 8e-5 of what meets it head on."""
COAT_WEIGHT = 0.2
"""Of a coat over a bare body, of all that is sampled: below it a highlight would rarely be."""


def bsdf(material: Material) -> dict[str, Any]:
    """Return Mitsuba's description of a material, both sides alike.

    A texture is {"type": "bitmap", "data": array, ...}. Subsurface scattering is Mitsuba's `mask` over a null boundary:
    see `twin.description.materials.Subsurface`; `medium` gives what lies within.
    """
    solid = {"type": "twosided", "side": _one_side(material)}
    below = getattr(material, "subsurface", None)
    return solid if below is None else {"type": "mask", "opacity": 1.0 - below.share, "solid": solid}


def medium(material: Material) -> dict[str, Any] | None:
    """Return Mitsuba's description of the medium below a material's surface, if there is one."""
    below: Subsurface | None = getattr(material, "subsurface", None)
    if below is None:
        return None
    return {
        "type": "homogeneous",
        "albedo": _value(below.albedo),
        "sigma_t": 1.0 / below.mean_free_path_mm,
        "phase": {"type": "isotropic"},
    }


def _one_side(material: Material) -> dict[str, Any]:
    match material:
        case Diffuse():
            return {"type": "diffuse", "reflectance": _value(material.reflectance)}
        case RoughPlastic(body_roughness=None):
            return _coated(material, material.reflectance, material.specularity)
        case RoughPlastic() if np.max(_numbers(material.specularity)) == 0:
            # Of a coat that sends nothing back Mitsuba draws no direction, and no light goes on from it.
            return _bare(material.reflectance, material.body_roughness)
        case RoughPlastic():
            coated = _coated(material, (0.0, 0.0, 0.0), _times(material.specularity, 1 / COAT_WEIGHT))
            bare = _bare(_times(material.reflectance, 1 / (1 - COAT_WEIGHT)), material.body_roughness)
            # The weight is the second one's, in the order of the names too.
            return {"type": "blendbsdf", "weight": COAT_WEIGHT, "bare": bare, "coated": coated}
        case Conductor(roughness=0):
            return {"type": "conductor", "material": material.metal}
        case Conductor():
            kind, alpha = material.distribution, float(material.roughness)
            return {"type": "roughconductor", "distribution": kind, "material": material.metal, "alpha": alpha}
        case Principled():
            return {
                "type": "principled",
                "base_color": _value(material.reflectance),
                "roughness": float(np.sqrt(material.roughness)),
                "metallic": float(material.metallic),
                # At none Mitsuba leaves out the metal's reflection, too.
                "specular": max(float(material.specularity), LEAST_SPECULAR if material.metallic else 0.0),
            }
        case Measured():
            return {"type": "measured", "filename": material.file}


def _coated(material: RoughPlastic, reflectance: Reflectance, specularity: float | Texture) -> dict[str, Any]:
    return {
        "type": "roughplastic",
        "distribution": material.distribution,
        "alpha": float(material.roughness),
        "int_ior": float(material.index),
        "ext_ior": 1.0,
        "diffuse_reflectance": _value(reflectance),
        "specular_reflectance": _value(specularity),
    }


def _bare(reflectance: Any, roughness: float | None) -> dict[str, Any]:
    assert roughness is not None
    return {"type": "principled", "base_color": _value(reflectance), "roughness": float(roughness), "specular": 0.0}


def _numbers(value: Any) -> Any:
    return value.values if isinstance(value, Texture) else np.zeros(0) if value in (None, VERTEX) else value


def _times(value: Any, factor: float) -> Any:
    """Return a number or a texture times a factor; three numbers as a texture: colours above 1 are refused."""
    if factor == 1:
        return value
    if isinstance(value, Texture):
        return replace(value, values=value.values * np.float32(factor))
    if isinstance(value, tuple):
        return Texture(np.full((1, 1, 3), factor * np.array(value), np.float32))
    return factor * value


def _value(value: Reflectance | float) -> Any:
    if isinstance(value, Texture):
        return {"type": "bitmap", "data": value.values, "raw": True, "filter_type": "bilinear", "wrap_mode": value.wrap}
    if isinstance(value, str):
        return {"type": "mesh_attribute", "name": VERTEX_COLOUR}
    return {"type": "rgb", "value": [float(part) for part in value]} if isinstance(value, tuple) else float(value)


def material_faults(materials: Mapping[str, Material]) -> list[str]:
    """Return what Mitsuba cannot make of materials, one line each."""
    faults = []
    for name, material in materials.items():
        for field in ("reflectance", "specularity"):
            numbers = _numbers(getattr(material, field, None))
            if np.size(numbers) and not (np.min(numbers) >= 0 and np.max(numbers) <= 1):
                faults.append(
                    f"materials.{name}.{field}: found {np.min(numbers):.3g} to {np.max(numbers):.3g}; expected 0 to 1: "
                    "no surface gives back more light than it gets."
                )
        if isinstance(material, RoughPlastic) and material.reflectance == VERTEX:
            faults.append(
                f"materials.{name}.reflectance: rough_plastic takes no colours of the vertices (a limit of Mitsuba); "
                "use principled, or a texture."
            )
        if isinstance(material, Measured):
            if not material.file.is_file():
                faults.append(f"materials.{name}.file: {material.file} not found.")
        elif isinstance(material, Conductor) and not _is_known(material.metal):
            faults.append(
                f"materials.{name}.metal: found {material.metal!r}; expected Au, Ag, Al, Cr, Cu, W or another name of "
                'Mitsuba\'s metals, or "none" for a perfect mirror.'
            )
    return faults


def _is_known(metal: str) -> bool:
    # Mitsuba itself would take half a second to import.
    folder = Path(find_spec("mitsuba").origin).parent  # type: ignore[union-attr,arg-type]
    return metal == "none" or (folder / "data" / "ior" / f"{metal}.eta.spd").is_file()
