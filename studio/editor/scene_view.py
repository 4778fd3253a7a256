"""The 3-D view: objects, lights as arrows, the camera. What is selected can be dragged."""

from collections.abc import Callable
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.editor import edits
from studio.editor.editor_window import Edit, EditorWindow
from studio.editor.edits import placement_of, quaternion
from studio.widgets import HELD, LIGHT, UNITS_PER_MM, Layers, add_light, display_mesh, light_places
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import Diffuse, Material, Principled, RoughPlastic

Array = NDArray[np.float64]
KEPT = 8
"""Meshes whose display is remembered: each change of an object's place asks for it again."""


class SceneView:
    """Objects, lights and camera in the browser's 3-D view."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, self._view = window, window.client.scene
        self._layers, self._displayed = Layers(), lru_cache(KEPT)(lambda mesh: display_mesh(mesh.vertices, mesh.faces))

    def refresh(self) -> None:
        """Show the window's scene; only what changed is sent."""
        window, scene, layers = self._window, self._window.scene, self._layers
        lights, spread = scene.lights, _spread(scene)
        # At the objects, from beside the camera.
        away = 1.6 * spread * UNITS_PER_MM * np.array([0.75, 0.5, 0.95])
        look = partial(window.look, (scene.points.min(0) + scene.points.max(0)) / 2 * UNITS_PER_MM, away)
        layers.draw("look", (window.saved, scene.objects[0].mesh), look)
        objects = {f"object {index}": one for index, one in enumerate(scene.objects)}
        places = {f"light {index}": place for index, place in enumerate(light_places(lights, spread))}
        layers.keep_only({*objects, *places, "camera", "look"})
        for index, (name, one) in enumerate(objects.items()):
            is_picked = window.object == index
            colour = _colour(scene.materials[one.material])
            key = (id(one.mesh), one.matrix.tobytes(), is_picked, colour)
            layers.draw(name, key, lambda i=index, p=is_picked, c=colour: self._add_object(i, p, c))
        for index, (name, place) in enumerate(places.items()):
            is_lit = window.light == index
            key = (place.tobytes(), lights.reference_point_mm.tobytes(), is_lit, spread)
            layers.draw(name, key, lambda i=index, at=place, lit=is_lit: self._add_light(i, at, lit, spread))
        layers.draw("camera", scene.camera, self._add_camera)

    def _add_object(self, index: int, is_picked: bool, colour: tuple[int, int, int]) -> list[Any]:
        one = self._window.scene.objects[index]
        placement = placement_of(one.mesh, one.matrix)
        place = {"wxyz": quaternion(placement.rotation), "position": placement.middle_mm * UNITS_PER_MM}
        vertices, faces, size = self._own(one, placement.rotation, placement.middle_mm)
        root = f"/object_{index}"
        if is_picked:
            gizmo = self._view.add_transform_controls(root, scale=1.5 * size, depth_test=False, line_width=3.0, **place)
            self._follow(
                gizmo, f"object {index}", lambda at, turn: lambda document: edits.turned(document, index, at, turn)
            )
        else:
            gizmo = self._view.add_frame(root, show_axes=False, **place)
        mesh = self._view.add_mesh_simple(
            f"{root}/mesh", vertices, faces, color=colour, flat_shading=one.mesh.normals is None, side="double"
        )
        self._window.on(mesh.on_click, lambda: self._window.select("object", index))
        return [gizmo]

    def _own(self, one: TwinObject, rotation: Array, middle: Array) -> tuple[Any, Any, float]:
        """Return the display mesh in the gizmo's frame, and half its longest side, in the view's units."""
        vertices, faces = self._displayed(one.mesh)
        linear = one.matrix[:3, :3]
        placed = vertices @ linear.T + one.matrix[:3, 3]
        own = ((placed - middle) @ rotation * UNITS_PER_MM).astype(np.float32)
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        return own, faces, max(float(np.ptp(own, axis=0).max()) / 2, 1e-4)

    def _add_light(self, index: int, place: Array, is_lit: bool, spread: float) -> list[Any]:
        ends, colour = (place, self._window.scene.lights.reference_point_mm), HELD if is_lit else LIGHT
        handles = add_light(self._view, f"/light_{index}", ends, spread, colour, 0.028)
        self._window.on(handles[0].on_click, lambda: self._window.select("light", index))

        def to_place(start: Array, end: Array) -> Edit:
            return lambda document: edits.moved_light(document, index, end / UNITS_PER_MM)

        self._on_drag(handles[0], f"light {index}", to_place)
        return handles

    def _add_camera(self) -> list[Any]:
        camera = self._window.scene.camera
        fov = 0.02 if camera.is_orthographic else 2 * float(np.arctan(camera.height / (2 * camera.fy)))
        # viser's cameras are OpenCV's: z forward, y down.
        frustum = self._view.add_camera_frustum(
            "/camera", fov, camera.width / camera.height, scale=0.7, color=(90, 90, 90), wxyz=(0.0, 1.0, 0.0, 0.0)
        )
        return [frustum]

    def _on_drag(self, knob: Any, name: str, edit_to: Callable[[Array, Array], Edit]) -> None:
        """Follow a knob: `edit_to` makes the edit from where it was (3,) to where it is, in the view's units."""
        said = attrgetter("phase", "start_position", "end_position")
        self._window.on(knob.on_drag("left"), partial(self._drag, name, edit_to), said)

    def _follow(self, gizmo: Any, name: str, edit_to: Callable[[Array, Array], Edit]) -> None:
        """Follow a gizmo: `edit_to` makes the edit to a place, mm, and a rotation (3, 3)."""

        def placed(event: Any) -> tuple[Any, ...]:
            turned = Rotation.from_quat(gizmo.wxyz, scalar_first=True)
            return event.phase, np.array(gizmo.position) / UNITS_PER_MM, turned.as_matrix()

        self._window.on(gizmo.on_update, partial(self._drag, name, edit_to), placed)

    def _drag(self, name: str, edit_to: Callable[[Array, Array], Edit], phase: str, *places: Any) -> None:
        """Preview a drag while it lasts; at its end it is one change."""
        edit = edit_to(*map(np.array, places))
        if phase == "update":
            self._window.drag(edit)
        elif phase == "end":
            self._window.change(f"drag {name}", edit)


def _spread(scene: TwinScene) -> float:
    """Return how far from the reference point arrows of distant lights stand, mm."""
    size = float(np.linalg.norm(np.ptp(scene.points, axis=0))) or 1.0
    return float(f"{1.1 * size:.2g}")


def _colour(material: Material) -> tuple[int, int, int]:
    """Return an 8-bit colour that a material looks like from afar."""
    value = material.reflectance if isinstance(material, Diffuse | RoughPlastic | Principled) else (0.6, 0.6, 0.62)
    if not isinstance(value, tuple):
        value = (0.6, 0.6, 0.6)
    r, g, b = (round(255 * min(max(part, 0.0), 1.0) ** (1 / 2.2)) for part in value)
    return r, g, b
