"""Lights, balls and object in space, where each light may be as an ellipsoid; and the scan alone, to be picked on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.spheres import Sphere
from studio.display_mesh import MOST_FACES, display_mesh
from studio.editor.placement import quaternion
from studio.editor.stage import UNITS_PER_MM
from studio.review.hemisphere import Ellipsoid, distant_ellipsoid, ellipsoid_of
from studio.review.review_desk import ReviewDesk
from studio.review.scan_picks import load_scan, met
from studio.review.shown import Shown
from twin.description.object_mesh import ObjectMesh

Array = NDArray[np.float64]
LIGHTS, SCAN = "/lights", "/scan"
CHOSEN, PLAIN, CLAY, STEEL, CHALK = (26, 115, 232), (250, 210, 60), (205, 190, 170), (150, 155, 165), (240, 240, 240)
FLAT = {"cast_shadow": False, "receive_shadow": False}
"""Shadows of the view's own lamps would be taken for the flashes'."""
CONTEXT_FACES = 20_000
"""Of the object when it only shows where the lights shine."""
SCAN_SIZE = 6.0
"""Of the scan when it is shown alone, in the view's units."""


class LightStage:
    """The two views that are not of the photograph: the lights in 3-D, and the scan."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, self._view, self._shown = desk, desk.client.scene, Shown()
        self._roots = {
            "Lights in 3-D": self._view.add_frame(LIGHTS, show_axes=False, visible=False),
            "Scan": self._view.add_frame(SCAN, show_axes=False, visible=False),
        }
        self._looked: Any = None
        self._mesh: tuple[int, Mesh | None] = (-1, None)
        self._caster: Any = None

    def refresh(self) -> None:
        """Show the desk's lights around its object."""
        desk = self._desk
        for view, root in self._roots.items():
            root.visible = desk.view == view
        wanted = (desk.view, desk.reading, desk.looks)
        is_new, self._looked = wanted != self._looked, wanted
        if desk.view == "Lights in 3-D":
            self._shown.once("object", desk.reading, self._add_object)
            self._shown.once("balls", desk.reading, self._add_balls)
            self._shown.once("lights", (desk.reading, desk.frame, desk.factor), self._add_lights)
            if is_new:
                self._look_at_lights()
        elif desk.view == "Scan":
            self._shown.once("scan", desk.reading, self._add_scan)
            if is_new:
                self._look(np.zeros(3), np.array([0.0, 0.0, 1.9 * SCAN_SIZE]))

    def _scan(self) -> Mesh | None:
        """Return the session's scan; None where there is none, which is told once."""
        if self._mesh[0] != self._desk.reading:
            self._mesh = (self._desk.reading, None)
            self._mesh = (self._desk.reading, load_scan(self._desk.review))
        return self._mesh[1]

    def _look(self, middle: Array, away: Array) -> None:
        camera = self._desk.client.camera
        camera.position, camera.look_at, camera.up_direction = middle + away, middle, (0.0, 1.0, 0.0)

    def _look_at_lights(self) -> None:
        lights = self._desk.review.lights
        if lights is None:
            return
        places, middle = light_places(lights), lights.reference_point_mm
        reach = float(np.linalg.norm(places - middle, axis=1).max()) * UNITS_PER_MM
        self._look(middle * UNITS_PER_MM, reach * np.array([1.3, 0.75, 1.5]))

    def _add_object(self) -> list[Any]:
        review = self._desk.review
        if review.session is None or review.session.scan is None or not review.store.path("pose.json").exists():
            return []
        mesh = self._scan()
        if mesh is None:
            return []
        scale = review.store.load_scan_scale()
        vertices, faces = _display(mesh, CONTEXT_FACES)
        placed = review.store.load_pose().apply(scale * vertices) * UNITS_PER_MM
        return [self._view.add_mesh_simple(f"{LIGHTS}/object", placed.astype(np.float32), faces, color=CLAY, **FLAT)]

    def _add_balls(self) -> list[Any]:
        review = self._desk.review
        camera = review.material.camera
        if camera is None or camera.is_orthographic:
            return []
        known: list[tuple[int, Sphere]] = [
            (index, sphere) for index, sphere in enumerate(review.spheres) if sphere.diameter_mm and not sphere.apart
        ]
        return [
            self._view.add_icosphere(
                f"{LIGHTS}/ball_{index}",
                radius=sphere.radius_mm * UNITS_PER_MM,
                color=STEEL if sphere.kind == "chrome" else CHALK,
                position=tuple(sphere.center_mm(camera) * UNITS_PER_MM),
                **FLAT,
            )
            for index, sphere in known
        ]

    def _add_lights(self) -> list[Any]:
        desk, review = self._desk, self._desk.review
        lights, handles = review.lights, []
        if lights is None:
            return handles
        places, reference = light_places(lights), lights.reference_point_mm
        reach = float(np.median(np.linalg.norm(places - reference, axis=1)))
        for index, (place, ellipsoid) in enumerate(zip(places, self._ellipsoids(lights, reach), strict=True)):
            colour = CHOSEN if index == desk.frame else PLAIN
            tip = place + 0.22 * reach * (reference - place) / max(float(np.linalg.norm(reference - place)), 1e-9)
            size = reach * UNITS_PER_MM
            handles.append(
                self._view.add_arrows(
                    f"{LIGHTS}/arrow_{index}",
                    (np.stack([place, tip])[None] * UNITS_PER_MM).astype(np.float32),
                    colour,
                    shaft_radius=0.006 * size,
                    head_radius=0.018 * size,
                    head_length=0.05 * size,
                )
            )
            knob = self._view.add_icosphere(
                f"{LIGHTS}/light_{index}",
                radius=0.012 * size,
                subdivisions=2,
                color=colour,
                position=tuple(place * UNITS_PER_MM),
                **FLAT,
            )
            knob.on_click(self._choosing(index))
            at = tuple(place * UNITS_PER_MM)
            label = self._view.add_label(f"{LIGHTS}/number_{index}", str(index + 1), position=at)
            handles += [knob, label]
            if ellipsoid is not None:
                axes = np.maximum(desk.factor * ellipsoid.half_axes_mm * UNITS_PER_MM, 1e-4)
                body = self._view.add_icosphere(
                    f"{LIGHTS}/sigma_{index}", radius=1.0, color=colour, opacity=0.35, scale=tuple(axes),
                    wxyz=quaternion(ellipsoid.rotation), position=tuple(place * UNITS_PER_MM), subdivisions=2,
                    **FLAT,
                )  # fmt: skip
                body.on_click(self._choosing(index))
                handles.append(body)
        return handles

    def _ellipsoids(self, lights: Lights, reach: float) -> list[Ellipsoid | None]:
        covariance = self._desk.review.position_covariance_mm2
        if lights.positions_mm is not None:
            return [None] * len(lights) if covariance is None else [ellipsoid_of(one) for one in covariance]
        pairs = zip(lights.directions, lights.direction_sigma_deg, strict=True)
        return [distant_ellipsoid(direction, float(sigma), reach) for direction, sigma in pairs]

    def _choosing(self, index: int) -> Any:
        async def _(event: Any) -> None:
            self._desk.post(lambda: self._desk.choose(frame=index))

        return _

    def _add_scan(self) -> list[Any]:
        mesh = self._scan()
        if mesh is None:
            raise SceneError("object.scan: the scan could not be read.")
        scale = SCAN_SIZE / (2 * mesh.radius_mm)
        vertices, faces = _display(mesh)
        shown = ((vertices - mesh.center_mm) * scale).astype(np.float32)
        handle = self._view.add_mesh_simple(f"{SCAN}/mesh", shown, faces, color=CLAY, **FLAT)

        async def _(event: Any) -> None:
            ray = np.array(event.ray_origin) / scale + mesh.center_mm, np.array(event.ray_direction)
            self._desk.post(lambda: self._click(mesh, *ray))

        handle.on_click(_)
        self._caster = None
        return [handle]

    def _click(self, mesh: Mesh, origin: Array, direction: Array) -> None:
        from scene.rays import RayCaster

        use = self._desk.on_scan
        if use is None:
            return
        # Its tree takes a second for a large scan.
        self._caster = self._caster or RayCaster(mesh)
        point = met(self._caster, origin, direction)
        if point is not None:
            use(point)

    def mark(self, points: Array) -> None:
        """Show numbered marks at points (K, 3) of the scan, mm."""
        mesh = self._mesh[1]
        self._shown.once("marks", points.tobytes(), lambda: [] if mesh is None else self._add_marks(points, mesh))

    def _add_marks(self, points: Array, mesh: Mesh) -> list[Any]:
        handles = []
        for index, point in enumerate(points):
            place = tuple((point - mesh.center_mm) * SCAN_SIZE / (2 * mesh.radius_mm))
            handles.append(self._view.add_icosphere(f"{SCAN}/mark_{index}", radius=0.05, color=CHOSEN, position=place))
            handles.append(self._view.add_label(f"{SCAN}/mark_number_{index}", str(index + 1), position=place))
        return handles


def light_places(lights: Lights) -> Array:
    """Return (N, 3), mm, where lights are drawn: near ones where they are, distant ones a metre toward them."""
    if lights.positions_mm is not None:
        return lights.positions_mm
    return lights.reference_point_mm + 1000.0 * lights.directions


def _display(mesh: Mesh, most_faces: int = MOST_FACES) -> tuple[Array, NDArray[np.uint32]]:
    vertices, faces = display_mesh(ObjectMesh(mesh.vertices, mesh.faces), most_faces=most_faces)
    return vertices.astype(np.float64), faces
