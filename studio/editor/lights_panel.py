"""The panel of the lights: rings, hemispheres, single ones, a session's own; the environment."""

from typing import Any

import numpy as np

from formats.pictures import read_picture
from scene.light_text import number_rows
from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.widgets import Inputs, plain
from twin.description.description_tables import GridTable, LightTable, RingTable, SessionLightsTable
from twin.description.light_groups import LightGroup, direction

NONE, OTHER = "(none)", "(of the scene)"
POLAR = {"kind", "polar", "near"}
SHOWN = {
    "hemisphere": {*POLAR, "count", "rings"},
    "ring": {*POLAR, "count", "azimuth"},
    "single": {*POLAR, "azimuth"},
    "session": {"kind", "session"},
}
"""The inputs that each kind of lights has; near ones have a distance and a radius too."""
AROUND = {"ambient": "ambient", "scale": "map scale", "rotate_deg": "map turn"}
"""What changes of the environment's fields are called in the past."""


class LightsPanel:
    """Groups to be made, the light that is selected, and what shines all the time."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._group, self._around = Inputs(window), Inputs(window, self._surround)
        self._names: dict[int, tuple[str, Any]] = {}
        with gui.add_folder("Make lights"):
            add = self._group.add
            add("kind", "dropdown", "kind", tuple(SHOWN))
            add("count", "number", "lights in a ring", 8, min=1, max=360, step=1)
            add("rings", "number", "rings", 3, min=1, max=30, step=1)
            add("polar", "slider", "angle from the axis, deg", min=1, max=90, step=1, initial_value=60)
            add("azimuth", "number", "azimuth, deg", 0.0, step=5.0)
            add("near", "checkbox", "near", False, hint="At a distance; else infinitely far")
            add("distance", "number", "distance, mm", 800.0, min=1.0, step=10.0)
            add("radius", "number", "radius, mm", 0.0, min=0.0, step=1.0, hint="0: a point")
            add("session", "dropdown", "session", (NONE,))
            window.button("Replace the lights", lambda: self._make(edits.with_lights), kind="main")
            window.button("Add to the lights", lambda: self._make(edits.with_more_lights))
            for name in ("kind", "near"):
                window.on_input(self._group[name], lambda value: self._show_inputs())
        with gui.add_folder("Light"):
            self._text = gui.add_markdown("")
            self._place = gui.add_vector3("place, mm", (0.0, 0.0, 1.0), step=0.001)
            self._intensity = gui.add_vector3("intensity", (1.0, 1.0, 1.0), min=(0.0, 0.0, 0.0), step=0.05)
            window.on_input(self._place, self._move)
            window.on_input(self._intensity, lambda value: self._edit("intensity", edits.with_intensity, value))
            window.button("Remove light", lambda: self._edit("remove", edits.without_light), kind="danger")
        with gui.add_folder("Environment"):
            self._around.add("ambient", "vector3", "ambient", (0.0, 0.0, 0.0), min=(0.0, 0.0, 0.0), step=0.01)
            self._map = gui.add_dropdown("map", (NONE,), hint="Latitude and longitude, from the workspace")
            window.on_upload(gui.add_upload_button("Send a map from here", color="gray"), self._choose_map)
            self._around.add("scale", "number", "times", 1.0, min=0.0, step=0.1)
            self._around.add("rotate_deg", "slider", "turned, deg", min=-180, max=180, step=1, initial_value=0)
            window.on_input(self._map, self._choose_map)
        self._show_inputs()

    def refresh(self) -> None:
        """Show the light that is selected, and the environment."""
        scene, index = self._window.scene, self._window.light
        lights, around = scene.lights, scene.environment
        toward = number_rows(lights.directions[index : index + 1]).strip()
        name = plain(lights.names[index])
        self._text.content = f"**{name}**, {index + 1} of {len(lights)}, {lights.model}; toward {toward}"
        self._place.label = "direction" if lights.positions_mm is None else "place, mm"
        rows = lights.directions if lights.positions_mm is None else lights.positions_mm
        self._place.value = tuple(np.round(rows[index], 4).tolist())
        self._intensity.value = tuple(np.round(lights.intensities[index], 5).tolist())
        name = NONE if around.radiance is None else self._names.get(id(around.radiance), (OTHER,))[0]
        self._map.options = tuple(dict.fromkeys((NONE, name, *self._window.listing.pictures)))
        self._map.value = name
        ambient = tuple(map(float, around.ambient))
        self._around.show(ambient=ambient, scale=float(around.scale), rotate_deg=round(around.rotate_deg))
        self._group["session"].options = self._window.listing.sessions or (NONE,)

    def _show_inputs(self) -> None:
        names = SHOWN[self._group["kind"].value]
        is_near = self._group["near"].value and "near" in names
        self._group.show_only(names | ({"distance", "radius"} if is_near else set()))

    def _make(self, edit: Any) -> None:
        group, folder = self._table(), self._window.workspace.root
        self._window.change(f"{self._group['kind'].value} lights", lambda scene: edit(scene, [group], folder))

    def _table(self) -> LightGroup:
        """Return the lights to be made as a description's [[lights]] has them."""
        said, number = {name: handle.value for name, handle in self._group.items()}, self._group.number
        if said["kind"] == "session":
            name = "" if said["session"] == NONE else f"{said['session']}/lights.json"
            return SessionLightsTable(kind="session", file=str(self._window.workspace.path(name)))
        distance = number("distance") if said["near"] else None
        radius = number("radius") or None if said["near"] else None
        polar, azimuth, count = number("polar"), number("azimuth"), int(said["count"])
        far: dict[str, Any] = {"distance_mm": distance, "radius_mm": radius}
        if said["kind"] == "ring":
            return RingTable(kind="ring", count=count, polar_deg=polar, start_deg=azimuth, **far)
        if said["kind"] == "hemisphere":
            return GridTable(kind="hemisphere", rings=int(said["rings"]), around=count, max_polar_deg=polar, **far)
        elevation = 90.0 - polar
        if distance is None:
            return LightTable(kind="distant", azimuth_deg=azimuth, elevation_deg=elevation)
        middle = self._window.scene.lights.reference_point_mm
        place = tuple(middle + distance * direction(azimuth, elevation))
        return LightTable(kind="point" if radius is None else "area", position_mm=place, radius_mm=radius)

    def _move(self, value: tuple[float, float, float]) -> None:
        """Move the light to a place; of a distant light the numbers are a direction."""
        lights = self._window.scene.lights
        place = np.array(value) + (lights.reference_point_mm if lights.positions_mm is None else 0)
        self._edit("place", edits.moved_light, place)

    def _edit(self, label: str, edit, *values: object) -> None:
        index = self._window.light
        self._window.change(f"{label} of light {index}", lambda scene: edit(scene, index, *values))

    def _surround(self, **said: Any) -> None:
        ((key, value),) = said.items()
        value = value if key == "ambient" else float(value)
        self._window.change(AROUND[key], lambda scene: edits.with_environment(scene, **{key: value}))

    def _choose_map(self, name: str) -> None:
        if name == NONE:
            # The ambient light stays.
            bare: dict[str, Any] = {"radiance": None, "scale": 1.0, "rotate_deg": 0.0}
            self._window.change("no map", lambda scene: edits.with_environment(scene, **bare))
        elif not name.startswith("("):
            radiance = read_picture(self._window.workspace.path(name))
            # Kept with the picture itself: its identity is given to no other while it is here.
            self._names[id(radiance)] = name, radiance
            self._window.change(f"map {name}", lambda scene: edits.with_environment(scene, radiance=radiance))
