"""The panels of the camera: the preview that it takes under one of the lights; its size, and how it is rendered."""

from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from compare.report.pictures import Exposure
from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.editor.preview import HEIGHT, WIDTH, Drawn
from studio.widgets import Inputs, plain
from twin.description.description import Sampling, TwinScene


class CameraPanel:
    """Size, focal length, projection; engine, samples, depth, error."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._camera, self._sampling = Inputs(window, self._change_camera), Inputs(window, self._change_sampling)
        with gui.add_folder("Camera"):
            add = self._camera.add
            add("width", "number", "width, px", 640, min=8, max=8192, step=1)
            add("height", "number", "height, px", 480, min=8, max=8192, step=1)
            add("focal_px", "number", "focal length, px", 1600.0, min=0.001, step=10.0)
            add("orthographic", "checkbox", "orthographic", False, hint="The focal length is then pixels per mm")
        with gui.add_folder("Rendering"):
            add = self._sampling.add
            add("engine", "dropdown", "engine", ("auto", "many", "mitsuba"))
            add("samples", "number", "samples a pixel", 0, min=0, max=65536, step=1, hint="0: what it takes")
            add("max_depth", "number", "depth", 3, min=2, max=64, step=1, hint="2: direct light only")
            add("percent", "number", "error, %", 1.0, min=0.01, max=50.0, step=0.1, hint="That is aimed at")

    def refresh(self) -> None:
        """Show the scene's camera and sampling."""
        camera, sampling = self._window.scene.camera, self._window.scene.sampling
        focal = round(float(camera.fx), 6)
        self._camera.show(width=camera.width, height=camera.height, focal_px=focal, orthographic=camera.is_orthographic)
        percent, samples = round(100 * sampling.error, 6), sampling.samples or 0
        self._sampling.show(engine=sampling.engine, samples=samples, max_depth=sampling.max_depth, percent=percent)

    def _change_camera(self, **said: Any) -> None:
        self._window.change("camera", lambda scene: edits.with_camera(scene, **said))

    def _change_sampling(self, **said: Any) -> None:
        if "percent" in said:
            said = {"error": said["percent"] / 100}
        elif "samples" in said:
            said = {"samples": said["samples"] or None}

        def edit(scene: TwinScene) -> TwinScene:
            # The table knows what is allowed.
            return replace(scene, sampling=TypeAdapter(Sampling).validate_python(vars(scene.sampling) | said))

        self._window.change("sampling", edit)


class PreviewPanel:
    """The picture beside the 3-D view, which light shines in it, and how bright it is shown."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._drawn: Drawn | None = None
        panel = gui.add_panel()
        with panel.add_tab("Preview"):
            self._picture = gui.add_image(np.full((HEIGHT, WIDTH, 3), 40, np.uint8), format="png")
            self._status = gui.add_markdown("drawing ...")
            self._light = gui.add_slider("light", min=1, max=2, step=1, initial_value=1, hint="Which light shines")
            self._gain = gui.add_slider("brightness", min=0.1, max=8.0, step=0.1, initial_value=1.0)
        panel.dock_left()
        panel.set_width(380)
        window.on_input(self._light, lambda value: window.select("light", int(value) - 1))
        window.on_input(self._gain, lambda value: self._show())
        window.show_preview = self.show

    def refresh(self) -> None:
        """Follow the number of lights, and which one is looked at."""
        count = len(self._window.scene.lights)
        self._light.max, self._light.disabled = max(count, 2), count == 1
        self._light.value = self._window.light + 1

    def show(self, drawn: Drawn) -> None:
        """Show a picture, or what is at fault."""
        self._drawn = drawn
        self._show()

    def _show(self) -> None:
        drawn = self._drawn
        if drawn is None:
            return
        if drawn.picture is None:
            self._status.content = f"**No preview.** {plain(drawn.fault)}"
            return
        self._picture.image = Exposure(1 / self._gain.value, np.ones(3)).develop(drawn.picture)
        self._status.content = f"{plain(drawn.light)}: {drawn.stage} after the change"
