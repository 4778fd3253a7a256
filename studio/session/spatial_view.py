"""Lights and object in space; and the scan alone, to be picked on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.picture_strip import CHOSEN
from studio.session.corrections import met
from studio.session.plane import add_numbered
from studio.session.session_window import SessionWindow
from studio.widgets import LIGHT, NO_SHADOW, UNITS_PER_MM, Layers, add_light, display_mesh, light_places

Array = NDArray[np.float64]
LIGHTS, SCAN = "/lights", "/scan"
PARTS = {"Lights in 3-D": {"object", "lights", "look"}, "Scan": {"scan", "marks", "look"}}
CLAY = (205, 190, 170)
FAR_MM = 1000.0
"""So far toward distant lights they are drawn."""
SCAN_SIZE = 6.0
"""Of the scan when it is shown alone, in the view's units."""


class SpatialView:
    """The two views that are not of the photograph: the lights in 3-D, and the scan."""

    def __init__(self, window: SessionWindow) -> None:
        self._window, self._view, self._layers = window, window.client.scene, Layers()

    def refresh(self) -> None:
        """Show the window's lights around its object, or its scan with the points that were picked."""
        window, draw, reading = self._window, self._layers.draw, self._window.reading
        self._layers.keep_only(PARTS.get(window.view, set()))
        if window.view == "Lights in 3-D":
            draw("object", reading, self._add_object)
            draw("lights", (reading, window.frame), self._add_lights)
        elif window.view == "Scan":
            draw("scan", reading, self._add_scan)
            places = [tuple(self._on_scan(np.array(point))) for point in window.picks.points]
            draw("marks", window.picks.points, lambda: add_numbered(self._view, f"{SCAN}/mark", places, 0.05, CHOSEN))
        draw("look", (window.view, window.looks), self._look)

    def _look(self) -> None:
        """Look at the whole of what is shown."""
        window, lights = self._window, self._window.review.lights
        if window.view == "Scan":
            window.look(np.zeros(3), [0.0, 0.0, 1.9 * SCAN_SIZE])
        elif window.view == "Lights in 3-D" and lights is not None:
            places, middle = light_places(lights, FAR_MM), lights.reference_point_mm
            reach = float(np.linalg.norm(places - middle, axis=1).max()) * UNITS_PER_MM
            window.look(middle * UNITS_PER_MM, reach * np.array([1.3, 0.75, 1.5]))

    def _add_object(self) -> list[Any]:
        if (placed := self._window.review.placed_scan) is None:
            return []
        mesh, pose = placed
        vertices, faces = display_mesh(mesh.vertices, mesh.faces)
        return [self._add_mesh(f"{LIGHTS}/object", pose.apply(vertices) * UNITS_PER_MM, faces)]

    def _add_mesh(self, name: str, places: Array, faces: Any) -> Any:
        return self._view.add_mesh_simple(name, places.astype(np.float32), faces, color=CLAY, **NO_SHADOW)

    def _add_lights(self) -> list[Any]:
        window, lights, view, handles = self._window, self._window.review.lights, self._view, []
        if lights is None:
            return handles
        places, reference = light_places(lights, FAR_MM), lights.reference_point_mm
        reach = float(np.median(np.linalg.norm(places - reference, axis=1)))
        for index, place in enumerate(places):
            colour, at = CHOSEN if index == window.frame else LIGHT, tuple(place * UNITS_PER_MM)
            added = add_light(view, f"{LIGHTS}/light_{index}", (place, reference), reach, colour, 0.02)
            window.on(added[0].on_click, lambda frame=index: window.choose(frame=frame))
            handles += [*added, view.add_label(f"{LIGHTS}/number_{index}", str(index + 1), position=at)]
        return handles

    def _on_scan(self, points_mm: Array) -> Array:
        """Return where points (..., 3) of the scan stand in the view."""
        mesh = self._window.review.scan_mesh
        return (points_mm - mesh.center_mm) * SCAN_SIZE / (2 * mesh.radius_mm)

    def _add_scan(self) -> list[Any]:
        from scene.rays import RayCaster

        window, mesh = self._window, self._window.review.scan_mesh
        caster = RayCaster(mesh)
        vertices, faces = display_mesh(mesh.vertices, mesh.faces)
        handle = self._add_mesh(f"{SCAN}/mesh", self._on_scan(vertices), faces)

        def clicked(origin: Array, direction: Array) -> None:
            point = met(caster, origin * 2 * mesh.radius_mm / SCAN_SIZE + mesh.center_mm, direction)
            if point is not None:
                window.take_point(point)

        window.on_ray(handle, clicked)
        return [handle]
