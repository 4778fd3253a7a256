"""Stock Mitsuba: one path-traced image for each light."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.film import Film, sensor_description
from twin.surface import Surface

SAMPLES_PER_BAND = 1 << 21
"""Samples traced in one call: bounds the vectorised variant's memory to about half a gigabyte."""


class PathTracer:
    """A surface before a film, ready to be rendered under one light after the other."""

    def __init__(self, surface: Surface, film: Film, lights: Lights, *, variant: str, max_depth: int) -> None:
        import mitsuba as mi

        mi.set_variant(variant)  # type: ignore[attr-defined]
        mi.set_log_level(mi.LogLevel.Error)  # type: ignore[attr-defined]
        self._mitsuba: Any = mi
        self._film = film
        self._points = surface.vertices
        self._lights = lights
        distant, one = lights.positions_mm is None, {"type": "rgb", "value": [1.0, 1.0, 1.0]}
        description = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": max_depth},
            "object": _mesh(mi, surface),
            "flash": {"type": "directional", "irradiance": one} if distant else {"type": "point", "intensity": one},
        }
        self._scene: Any = mi.load_dict(description)
        self._sensors: dict[tuple[int, int], Any] = {}

    def image(
        self, index: int, irradiance: NDArray[np.float64], samples_per_pixel: int, *, seed: int = 0
    ) -> NDArray[np.float32]:
        """Return radiance (h, w, 3) of the film's window under one light.

        Parameters
        ----------
        index : int
            Which light.
        irradiance : (3,) float64
            On a surface that faces the light at the lights' reference point.
        seed : int
            Other samples of the same light.
        """
        mi, lights = self._mitsuba, self._lights
        parameters = mi.traverse(self._scene)
        if lights.positions_mm is None:
            direction = lights.directions[index]
            up = np.eye(3)[np.argmin(np.abs(direction))]
            parameters["flash.to_world"] = mi.Transform4f().look_at(
                origin=[0, 0, 0], target=(-direction).tolist(), up=up.tolist()
            )
            parameters["flash.irradiance.value"] = mi.Color3f(*irradiance.tolist())
        else:
            position = lights.positions_mm[index]
            square = float(np.sum((position - lights.reference_point_mm) ** 2))
            parameters["flash.position"] = mi.Point3f(*position.tolist())
            parameters["flash.intensity.value"] = mi.Color3f(*(irradiance * square).tolist())
        parameters.update()
        bands = self._film.bands(SAMPLES_PER_BAND, samples_per_pixel)
        return np.concatenate([self._band((seed, index), *band, samples_per_pixel) for band in bands])

    def _band(self, seeds: tuple[int, int], first_row: int, height: int, samples_per_pixel: int) -> NDArray[np.float32]:
        mi = self._mitsuba
        key = (first_row, height)
        if key not in self._sensors:
            self._sensors[key] = mi.load_dict(sensor_description(self._film, self._points, first_row, height))
        # Mixed, not added up: neighbouring bands and lights must not share samples.
        seed = int(np.random.SeedSequence([*seeds, first_row]).generate_state(1)[0])
        image = mi.render(self._scene, sensor=self._sensors[key], spp=samples_per_pixel, seed=seed)
        return np.asarray(image, np.float32)[..., :3]


def _mesh(mi: Any, surface: Surface) -> Any:
    """Return the surface as a Mitsuba mesh with smooth normals and a matte, textured material."""
    material = {
        "type": "diffuse",
        "reflectance": {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(surface.texture)),
            "raw": True,
            "filter_type": "bilinear",
            "wrap_mode": "clamp",
        },
    }
    properties = mi.Properties()
    properties["material"] = mi.load_dict(material)
    mesh = mi.Mesh(
        "object",
        len(surface.vertices),
        len(surface.faces),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=properties,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = surface.vertices.astype(np.float32).ravel()
    parameters["vertex_normals"] = surface.normals.astype(np.float32).ravel()
    parameters["vertex_texcoords"] = surface.texcoords.astype(np.float32).ravel()
    parameters["faces"] = surface.faces.astype(np.uint32).ravel()
    parameters.update()
    return mesh
