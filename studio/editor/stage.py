"""The 3-D view: objects, lights as arrows, the camera. What is selected can be dragged."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.display_mesh import display_mesh
from studio.editor import edits, light_edits
from studio.editor.desk import Desk, Edit
from studio.editor.placement import placement_of, quaternion, rotation_of
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import Diffuse, Material, Principled, RoughPlastic
from twin.description.object_mesh import ObjectMesh

Array = NDArray[np.float64]
UNITS_PER_MM = 0.01
"""The browser's view has clipping planes and gizmos for things a few units large."""
PICKED, PLAIN = (255, 140, 0), (250, 210, 60)


class Stage:
    """Objects, lights and camera in the browser's 3-D view."""

    def __init__(self, desk: Desk) -> None:
        self._desk, self._view = desk, desk.client.scene
        self._shown: dict[str, tuple[Any, list[Any]]] = {}
        self._meshes: dict[int, tuple[ObjectMesh, Any]] = {}
        self._looked_at = np.full(3, np.nan)

    def _look(self) -> None:
        """Look at the objects from beside the camera."""
        scene = self._desk.scene
        self._looked_at = scene.lights.reference_point_mm
        middle = edits.middle_of(scene) * UNITS_PER_MM
        away = 1.6 * self._spread(scene) * UNITS_PER_MM
        camera = self._desk.client.camera
        camera.position = middle + away * np.array([0.75, 0.5, 0.95])
        camera.look_at = middle
        camera.up_direction = (0.0, 1.0, 0.0)

    def refresh(self) -> None:
        """Show the desk's scene; only what changed is sent."""
        scene, wanted = self._desk.scene, {}
        if not np.array_equal(scene.lights.reference_point_mm, self._looked_at):
            self._look()
        for index, one in enumerate(scene.objects):
            is_picked = self._desk.picked == "object" and self._desk.object == index
            colour = _colour(scene.materials[one.material])
            key = (id(one.mesh), one.matrix.tobytes(), is_picked, colour)
            wanted[f"object {index}"] = (key, lambda i=index, p=is_picked, c=colour: self._add_object(i, p, c))
        lights = scene.lights
        spread = self._spread(scene)
        for index in range(len(lights)):
            is_picked = self._desk.picked == "light" and self._desk.light == index
            is_lit = self._desk.light == index
            place = _place(scene, index, spread)
            key = (place.tobytes(), lights.reference_point_mm.tobytes(), is_picked, is_lit, spread)
            wanted[f"light {index}"] = (
                key,
                lambda i=index, p=is_picked, lit=is_lit: self._add_light(i, p, lit, spread),
            )
        wanted["camera"] = (scene.camera, self._add_camera)
        for name in [name for name in self._shown if name not in wanted or wanted[name][0] != self._shown[name][0]]:
            for handle in self._shown.pop(name)[1]:
                handle.remove()
        for name, (key, add) in wanted.items():
            if name not in self._shown:
                self._shown[name] = (key, add())
        self._meshes = {
            id(one.mesh): self._meshes[id(one.mesh)] for one in scene.objects if id(one.mesh) in self._meshes
        }

    def _add_object(self, index: int, is_picked: bool, colour: tuple[int, int, int]) -> list[Any]:
        one = self._desk.scene.objects[index]
        placement = placement_of(one)
        place = {"wxyz": quaternion(placement.rotation), "position": placement.middle_mm * UNITS_PER_MM}
        vertices, faces, size = self._own(one, placement.rotation, placement.middle_mm)
        root = f"/object_{index}"
        if is_picked:
            gizmo = self._view.add_transform_controls(root, scale=1.5 * size, depth_test=False, line_width=3.0, **place)
            self._follow(gizmo, f"object {index}", lambda at, turn: lambda scene: edits.turned(scene, index, at, turn))
        else:
            gizmo = self._view.add_frame(root, show_axes=False, **place)
        mesh = self._view.add_mesh_simple(
            f"{root}/mesh", vertices, faces, color=colour, flat_shading=one.mesh.normals is None, side="double"
        )
        mesh.on_click(self._picking("object", index))
        if is_picked:
            self._add_scaler(root, index, size)
        return [gizmo]

    def _own(self, one: TwinObject, rotation: Array, middle: Array) -> tuple[Any, Any, float]:
        """Return the display mesh in the gizmo's frame, and half its longest side, in the view's units."""
        if id(one.mesh) not in self._meshes:
            self._meshes[id(one.mesh)] = (one.mesh, display_mesh(one.mesh))
        vertices, faces = self._meshes[id(one.mesh)][1]
        linear = one.matrix[:3, :3]
        placed = vertices @ linear.T + one.matrix[:3, 3]
        own = ((placed - middle) @ rotation * UNITS_PER_MM).astype(np.float32)
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        return own, faces, max(float(np.ptp(own, axis=0).max()) / 2, 1e-4)

    def _add_scaler(self, root: str, index: int, size: float) -> None:
        """Add the knob that is drawn out and in to scale."""
        at = 1.15 * size * np.ones(3)
        knob = self._view.add_box(f"{root}/scale", color=PICKED, dimensions=(0.12 * size,) * 3, position=at)

        async def _(event: Any) -> None:
            start, end = np.array(event.start_position), np.array(event.end_position)

            def edit(scene: TwinScene) -> TwinScene:
                middle = placement_of(scene.objects[index]).middle_mm * UNITS_PER_MM
                away = max(float(np.linalg.norm(start - middle)), 1e-9)
                return edits.scaled(scene, index, float(np.linalg.norm(end - middle)) / away)

            self._drag(event.phase, "scale", edit)

        knob.on_drag("left")(_)

    def _add_light(self, index: int, is_picked: bool, is_lit: bool, spread: float) -> list[Any]:
        scene, u = self._desk.scene, UNITS_PER_MM
        place, reference = _place(scene, index, spread), scene.lights.reference_point_mm
        colour = PICKED if is_lit else PLAIN
        toward = (reference - place) / max(float(np.linalg.norm(reference - place)), 1e-9)
        tip = place + toward * 0.22 * spread
        root = f"/light_{index}"
        arrow = self._view.add_arrows(
            f"{root}_arrow",
            np.stack([place, tip])[None] * u,
            colour,
            shaft_radius=0.006 * spread * u,
            head_radius=0.018 * spread * u,
            head_length=0.05 * spread * u,
        )
        knob = self._view.add_icosphere(
            root, radius=0.028 * spread * u, color=colour, position=place * u, cast_shadow=False, receive_shadow=False
        )
        knob.on_click(self._picking("light", index))

        async def _(event: Any) -> None:
            place = np.array(event.end_position) / UNITS_PER_MM
            self._drag(event.phase, f"light {index}", lambda scene: light_edits.moved_light(scene, index, place))

        knob.on_drag("left")(_)
        handles = [arrow, knob]
        if is_picked:
            gizmo = self._view.add_transform_controls(
                f"{root}_gizmo", scale=0.2 * spread * u, disable_rotations=True, depth_test=False, position=place * u
            )
            self._follow(
                gizmo,
                f"light {index}",
                lambda at, turn: lambda scene: light_edits.moved_light(scene, index, at),
            )
            handles.append(gizmo)
        return handles

    def _add_camera(self) -> list[Any]:
        camera = self._desk.scene.camera
        fov = 0.02 if camera.is_orthographic else 2 * float(np.arctan(camera.height / (2 * camera.fy)))
        # viser's cameras are OpenCV's: z forward, y down.
        frustum = self._view.add_camera_frustum(
            "/camera", fov, camera.width / camera.height, scale=0.7, color=(90, 90, 90), wxyz=(0.0, 1.0, 0.0, 0.0)
        )
        return [frustum]

    def _spread(self, scene: TwinScene) -> float:
        """Return how far from the reference point arrows of distant lights stand, mm."""
        size = float(np.linalg.norm(np.ptp(scene.points, axis=0))) or 1.0
        return float(f"{1.1 * size:.2g}")

    def _picking(self, what: str, index: int) -> Any:
        async def _(event: Any) -> None:
            self._desk.post(lambda: self._desk.select(what, index))

        return _

    def _follow(self, gizmo: Any, name: str, edit_to: Callable[[Array, Array], Edit]) -> None:
        """Follow a gizmo: `edit_to` makes the edit to a place, mm, and a rotation (3, 3)."""

        async def _(event: Any) -> None:
            at, turn = np.array(gizmo.position) / UNITS_PER_MM, rotation_of(gizmo.wxyz)
            self._drag(event.phase, name, edit_to(at, turn))

        gizmo.on_update(_)

    def _drag(self, phase: str, name: str, edit: Edit) -> None:
        """Preview a drag while it lasts; at its end it is one change."""
        if phase == "update":
            self._desk.post(lambda: self._desk.drag(edit))
        elif phase == "end":
            self._desk.post(lambda: self._desk.change(f"drag {name}", edit))


def _place(scene: TwinScene, index: int, spread: float) -> Array:
    """Return where a light's arrow starts: a near light's place, or `spread` toward a distant one."""
    lights = scene.lights
    if lights.positions_mm is not None:
        return lights.positions_mm[index]
    return lights.reference_point_mm + spread * lights.directions[index]


def _colour(material: Material) -> tuple[int, int, int]:
    """Return an 8-bit colour that a material looks like from afar."""
    value = material.reflectance if isinstance(material, Diffuse | RoughPlastic | Principled) else (0.6, 0.6, 0.62)
    if not isinstance(value, tuple):
        value = (0.6, 0.6, 0.6)
    r, g, b = (round(255 * min(max(part, 0.0), 1.0) ** (1 / 2.2)) for part in value)
    return r, g, b
