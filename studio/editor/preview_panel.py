"""The panel of the preview: the picture beside the 3-D view, which light shines in it, how bright it is shown."""

import numpy as np

from compare.report.pictures import Exposure
from studio.editor.editor_window import EditorWindow
from studio.editor.preview import HEIGHT, WIDTH, Drawn
from studio.widgets import plain


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
