"""A scene description as Mitsuba's scene.

`parts` says it in plain dictionaries and arrays; `mitsuba_scene` makes objects of them in memory, and
`twin.engines.mitsuba_files` the files of Mitsuba's own command line.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.mesh import Mesh
from twin.description.description import TwinScene
from twin.engines.mitsuba_materials import VERTEX_COLOUR, bsdf, medium
from twin.engines.variant import load

Array = NDArray[np.float64]
SUBSURFACE_DEPTH = 256
"""Scatterings that a path may have where there is a medium."""
SUBSURFACE_ROULETTE = 16
"""... and after how many it may end by chance: the least noise for the time, of 5, 16, 32 and never."""
ENVIRONMENT_WEIGHT = 0.25
"""Share of the light samples that go to an environment, relative to the flash: it is dim, and costs no less."""


@dataclass(frozen=True)
class Parts:
    """Mitsuba's description of a scene without flash and sensor.

    materials, media: By the material's name.
    """

    integrator: dict[str, Any]
    materials: dict[str, dict[str, Any]]
    media: dict[str, dict[str, Any]]
    shapes: list[tuple[str, Mesh, str]]
    environment: dict[str, Any] | None


def parts(scene: TwinScene) -> Parts:
    """Return what a scene is made of, in Mitsuba's words."""
    used = {one.material: scene.materials[one.material] for one in scene.objects}
    media = {name: found for name, material in used.items() if (found := medium(material)) is not None}
    # Behind the objects the picture is black, as in frames from which the ambient light was subtracted.
    integrator = {"type": "path", "max_depth": scene.sampling.max_depth, "hide_emitters": True}
    if media:
        depth = max(scene.sampling.max_depth, SUBSURFACE_DEPTH)
        integrator |= {"type": "volpath", "max_depth": depth, "rr_depth": SUBSURFACE_ROULETTE}
    materials = {name: bsdf(material) for name, material in used.items()}
    shapes = [(one.name, one.placed, one.material) for one in scene.objects]
    return Parts(integrator, materials, media, shapes, _environment(scene))


def _environment(scene: TwinScene) -> dict[str, Any] | None:
    """Return the environment: Mitsuba takes only one, so the ambient light is added to the map."""
    given = scene.environment
    if given.is_dark:
        return None
    ambient = np.asarray(given.ambient, np.float32)
    if given.map is None:
        radiance = {"type": "rgb", "value": ambient.tolist()}
        return {"type": "constant", "radiance": radiance, "sampling_weight": ENVIRONMENT_WEIGHT}
    angle = np.radians(given.rotate_deg)
    turn = np.eye(4)
    turn[0, [0, 2]] = np.cos(angle), np.sin(angle)
    turn[2, [0, 2]] = -np.sin(angle), np.cos(angle)
    return {
        "type": "envmap",
        "data": given.scale * np.broadcast_to(given.map.values, (*given.map.values.shape[:2], 3)) + ambient,
        "to_world": turn,
        "sampling_weight": ENVIRONMENT_WEIGHT,
    }


def flash(scene: TwinScene, index: int) -> dict[str, Any]:
    """Return Mitsuba's description of one light.

    Irradiance E on what faces the light at the reference point, at distance d: a point has the radiant intensity E d^2,
    a disc of radius r, which faces it too, the radiance E (d^2 + r^2) / (pi r^2).
    """
    lights, irradiance = scene.lights, scene.irradiance[index]
    if lights.positions_mm is None:
        toward = (-lights.directions[index]).tolist()
        return {"type": "directional", "direction": toward, "irradiance": _rgb(irradiance)}
    position, radius = lights.positions_mm[index], float(scene.radii_mm[index])
    offset = lights.reference_point_mm - position
    square = float(offset @ offset)
    if radius == 0:
        return {"type": "point", "position": position.tolist(), "intensity": _rgb(irradiance * square)}
    return {
        "type": "disk",
        "to_world": disc_frame(position, offset / np.sqrt(square), radius),
        "bsdf": {"type": "diffuse", "reflectance": _rgb(np.zeros(3))},
        "emitter": {"type": "area", "radiance": _rgb(irradiance * (square + radius**2) / (np.pi * radius**2))},
    }


def disc_frame(position: Array, axis: Array, radius: float) -> Array:
    """Return (4, 4) that takes Mitsuba's unit disc, which faces z, to a disc that faces a unit axis."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    frame = np.eye(4)
    frame[:3] = np.stack([radius * side, radius * np.cross(axis, side), axis, position], 1)
    return frame


def _rgb(value: Array) -> dict[str, Any]:
    return {"type": "rgb", "value": np.asarray(value, float).tolist()}


def mitsuba_scene(scene: TwinScene, *, light: int | None = None) -> Any:
    """Return the scene as a `mitsuba.Scene`, in the variant that is set.

    Parameters
    ----------
    light : int or None
        The flash that is in it, under the name `flash`; None: none, only shapes and environment.

    Notes
    -----
    Without sensor: `twin.engines.film.sensor_description` makes one. The integrator is that of the `mitsuba` engine.
    Every material is two-sided. Units: `TwinScene`'s notes.
    """
    import mitsuba as mi

    made = parts(scene)
    materials = {name: load(loadable(mi, one)) for name, one in made.materials.items()}
    media = {name: load(loadable(mi, one)) for name, one in made.media.items()}
    description: dict[str, Any] = {"type": "scene", "integrator": made.integrator}
    for number, (_, mesh, material) in enumerate(made.shapes):
        description[f"object_{number}"] = _mesh(mi, mesh, materials[material], media.get(material))
    if made.environment is not None:
        description["environment"] = loadable(mi, made.environment)
    if light is not None:
        description["flash"] = loadable(mi, flash(scene, light))
    return load(description)


def loadable(mi: Any, node: Any) -> Any:
    """Return a description whose arrays are Mitsuba's objects."""
    if not isinstance(node, dict):
        if isinstance(node, np.ndarray):
            return mi.ScalarTransform4f(node)
        return str(node) if hasattr(node, "__fspath__") else node
    ready = {key: loadable(mi, value) for key, value in node.items() if key != "data"}
    if "data" in node:
        ready["bitmap"] = mi.Bitmap(np.ascontiguousarray(node["data"], np.float32))
    return ready


def _mesh(mi: Any, mesh: Mesh, material: Any, within: Any) -> Any:
    properties = mi.Properties()
    properties["material"] = material
    if within is not None:
        properties["interior"] = within
    if mesh.normals is None:
        properties["face_normals"] = True
    made = mi.Mesh(
        "object",
        len(mesh.vertices),
        len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=mesh.texcoords is not None,
        props=properties,
    )
    if mesh.colours is not None:
        made.add_attribute(VERTEX_COLOUR, 3, mesh.colours.astype(np.float32).ravel())
    arrays = {"vertex_positions": mesh.vertices, "vertex_normals": mesh.normals, "vertex_texcoords": mesh.texcoords}
    parameters = mi.traverse(made)
    for name, values in arrays.items():
        if values is not None:
            parameters[name] = values.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return made
