"""The panel of the camera, and of how its pictures are rendered."""

from typing import Any

from pydantic import TypeAdapter

from studio.editor import edits
from studio.editor.desk import Desk
from twin.description.description import Sampling


class CameraPanel:
    """Size, focal length, projection; engine, samples, depth, error."""

    def __init__(self, desk: Desk) -> None:
        self._desk, gui = desk, desk.client.gui
        with gui.add_folder("Camera"):
            self._width = gui.add_number("width, px", 640, min=8, max=8192, step=1)
            self._height = gui.add_number("height, px", 480, min=8, max=8192, step=1)
            self._focal = gui.add_number("focal length, px", 1600.0, min=0.001, step=10.0)
            self._parallel = gui.add_checkbox("orthographic", False, hint="The focal length is then pixels per mm")
        with gui.add_folder("Rendering"):
            self._engine = gui.add_dropdown("engine", ("auto", "direct", "many", "mitsuba"))
            self._samples = gui.add_number("samples a pixel", 0, min=0, max=65536, step=1, hint="0: what it takes")
            self._depth = gui.add_number("depth", 3, min=2, max=64, step=1, hint="2: direct light only")
            self._error = gui.add_number("error, %", 1.0, min=0.01, max=50.0, step=0.1, hint="That is aimed at")
        desk.on_input(self._width, lambda value: self._change_camera(width=int(value)))
        desk.on_input(self._height, lambda value: self._change_camera(height=int(value)))
        desk.on_input(self._focal, lambda value: self._change_camera(focal_px=float(value)))
        desk.on_input(self._parallel, lambda value: self._change_camera(orthographic=bool(value)))
        desk.on_input(self._engine, lambda value: self._change_sampling(engine=value))
        desk.on_input(self._samples, lambda value: self._change_sampling(samples=int(value) or None))
        desk.on_input(self._depth, lambda value: self._change_sampling(max_depth=int(value)))
        desk.on_input(self._error, lambda value: self._change_sampling(error=float(value) / 100))

    def refresh(self) -> None:
        """Show the scene's camera and sampling."""
        camera, sampling = self._desk.scene.camera, self._desk.scene.sampling
        self._width.value, self._height.value = camera.width, camera.height
        self._focal.value = round(float(camera.fx), 6)
        self._parallel.value = camera.is_orthographic
        self._engine.value, self._samples.value = sampling.engine, sampling.samples or 0
        self._depth.value, self._error.value = sampling.max_depth, round(100 * sampling.error, 6)

    def _change_camera(self, **said: Any) -> None:
        def edit(scene: edits.TwinScene) -> edits.TwinScene:
            was = scene.camera
            now: dict[str, Any] = {"width": was.width, "height": was.height, "focal_px": float(was.fx)}
            return edits.with_camera(scene, **(now | {"orthographic": was.is_orthographic} | said))

        self._desk.change("camera", edit)

    def _change_sampling(self, **said: Any) -> None:
        def edit(scene: edits.TwinScene) -> edits.TwinScene:
            # The table knows what is allowed.
            return edits.with_sampling(scene, TypeAdapter(Sampling).validate_python(vars(scene.sampling) | said))

        self._desk.change("sampling", edit)
