"""The panel of the lights: rings, hemispheres, single ones, a session's own; the environment."""

from typing import Any

import numpy as np

from scene.light_text import number_rows
from studio.editor import edits, light_edits
from studio.editor.desk import Desk
from studio.markdown import plain
from twin.description.description_tables import GridTable, LightTable, RingTable, SessionLightsTable
from twin.description.light_groups import LightGroup, direction
from twin.description.picture_files import read_picture

NONE, OTHER = "(none)", "(of the scene)"


class LightsPanel:
    """Groups to be made, the light that is selected, and what shines all the time."""

    def __init__(self, desk: Desk) -> None:
        self._desk, gui = desk, desk.client.gui
        with gui.add_folder("Make lights"):
            self._kind = gui.add_dropdown("kind", ("hemisphere", "ring", "single", "session"))
            self._count = gui.add_number("lights in a ring", 8, min=1, max=360, step=1)
            self._rings = gui.add_number("rings", 3, min=1, max=30, step=1)
            self._polar = gui.add_slider("angle from the axis, deg", min=1, max=90, step=1, initial_value=60)
            self._azimuth = gui.add_number("azimuth, deg", 0.0, step=5.0)
            self._near = gui.add_checkbox("near", False, hint="At a distance; else infinitely far")
            self._distance = gui.add_number("distance, mm", 800.0, min=1.0, step=10.0, visible=False)
            self._radius = gui.add_number("radius, mm", 0.0, min=0.0, step=1.0, visible=False, hint="0: a point")
            self._session = gui.add_dropdown("session", (NONE,), visible=False)
            desk.on_click(gui.add_button("Replace the lights"), lambda: self._make(more=False))
            desk.on_click(gui.add_button("Add to the lights"), lambda: self._make(more=True))
            for handle in (self._kind, self._near):
                desk.on_input(handle, lambda value: self._show_inputs())
        with gui.add_folder("Light"):
            self._text = gui.add_markdown("")
            self._place = gui.add_vector3("place, mm", (0.0, 0.0, 1.0), step=0.001)
            self._intensity = gui.add_vector3("intensity", (1.0, 1.0, 1.0), min=(0.0, 0.0, 0.0), step=0.05)
            desk.on_input(self._place, self._move)
            desk.on_input(self._intensity, lambda value: self._edit("intensity", light_edits.with_intensity, value))
            desk.on_click(gui.add_button("Remove light"), lambda: self._edit("remove", light_edits.without_light))
        with gui.add_folder("Environment"):
            self._ambient = gui.add_vector3("ambient", (0.0, 0.0, 0.0), min=(0.0, 0.0, 0.0), step=0.01)
            self._map = gui.add_dropdown("map", (NONE,), hint="Latitude and longitude, from the workspace")
            desk.on_upload(gui.add_upload_button("Send a map from here"), self._choose_map)
            self._map_scale = gui.add_number("times", 1.0, min=0.0, step=0.1)
            self._map_turn = gui.add_slider("turned, deg", min=-180, max=180, step=1, initial_value=0)
            desk.on_input(self._ambient, lambda value: self._surround("ambient", ambient=tuple(map(float, value))))
            desk.on_input(self._map, self._choose_map)
            desk.on_input(self._map_scale, lambda value: self._surround("map scale", scale=float(value)))
            desk.on_input(self._map_turn, lambda value: self._surround("map turn", rotate_deg=float(value)))
        self._names: dict[int, tuple[str, Any]] = {}
        self._show_inputs()

    def refresh(self) -> None:
        """Show the light that is selected, and the environment."""
        scene, index = self._desk.scene, self._desk.light
        lights, around = scene.lights, scene.environment
        toward = number_rows(lights.directions[index : index + 1]).strip()
        name = plain(lights.names[index])
        self._text.content = f"**{name}**, {index + 1} of {len(lights)}, {lights.model}; toward {toward}"
        if lights.positions_mm is None:
            self._place.label, shown = "direction", lights.directions[index]
        else:
            self._place.label, shown = "place, mm", lights.positions_mm[index]
        self._place.value = tuple(np.round(shown, 4).tolist())
        self._intensity.value = tuple(np.round(lights.intensities[index], 5).tolist())
        self._ambient.value = tuple(map(float, around.ambient))
        name = NONE if around.radiance is None else self._names.get(id(around.radiance), (OTHER,))[0]
        self._map.options = tuple(dict.fromkeys((NONE, name, *self._desk.listing.pictures)))
        self._map.value = name
        self._map_scale.value, self._map_turn.value = float(around.scale), round(around.rotate_deg)
        self._session.options = self._desk.listing.sessions or (NONE,)

    def _show_inputs(self) -> None:
        kind, near = self._kind.value, self._near.value
        is_group = kind in ("hemisphere", "ring")
        self._count.visible, self._rings.visible = is_group, kind == "hemisphere"
        self._polar.visible = self._near.visible = kind != "session"
        self._azimuth.visible = kind in ("ring", "single")
        self._distance.visible = self._radius.visible = near and kind != "session"
        self._session.visible = kind == "session"

    def _make(self, *, more: bool) -> None:
        group, folder = self._group(), self._desk.workspace.root
        edit = light_edits.with_more_lights if more else light_edits.with_lights
        self._desk.change(f"{self._kind.value} lights", lambda scene: edit(scene, [group], folder))

    def _group(self) -> LightGroup:
        kind, near = self._kind.value, self._near.value
        distance = float(self._distance.value) if near else None
        radius = float(self._radius.value) or None if near else None
        polar, count = float(self._polar.value), int(self._count.value)
        if kind == "session":
            name = "" if self._session.value == NONE else f"{self._session.value}/lights.json"
            return SessionLightsTable(kind="session", file=str(self._desk.workspace.path(name)))
        if kind == "ring":
            start = float(self._azimuth.value)
            return RingTable(
                kind="ring", count=count, polar_deg=polar, start_deg=start, distance_mm=distance, radius_mm=radius
            )
        if kind == "hemisphere":
            rings = int(self._rings.value)
            return GridTable(
                kind="hemisphere",
                rings=rings,
                around=count,
                max_polar_deg=polar,
                distance_mm=distance,
                radius_mm=radius,
            )
        azimuth, elevation = float(self._azimuth.value), 90.0 - polar
        if distance is None:
            return LightTable(kind="distant", azimuth_deg=azimuth, elevation_deg=elevation)
        middle = self._desk.scene.lights.reference_point_mm
        place = (middle + distance * direction(azimuth, elevation)).tolist()
        if radius is None:
            return LightTable(kind="point", position_mm=place)
        return LightTable(kind="area", position_mm=place, radius_mm=radius)

    def _move(self, value: tuple[float, float, float]) -> None:
        """Move the light to a place; of a distant light the numbers are a direction."""
        lights = self._desk.scene.lights
        place = np.array(value) + (lights.reference_point_mm if lights.positions_mm is None else 0)
        self._edit("place", light_edits.moved_light, place)

    def _edit(self, label: str, edit, *values: object) -> None:
        index = self._desk.light
        self._desk.change(f"{label} of light {index}", lambda scene: edit(scene, index, *values))

    def _surround(self, label: str, **changes: object) -> None:
        self._desk.change(label, lambda scene: edits.with_environment(scene, **changes))

    def _choose_map(self, name: str) -> None:
        if name == NONE:
            self._desk.change("no map", edits.without_map)
        elif not name.startswith("("):
            radiance = read_picture(self._desk.workspace.path(name))
            # Kept with the picture itself: its identity is given to no other while it is here.
            self._names[id(radiance)] = name, radiance
            self._surround(f"map {name}", radiance=radiance)
