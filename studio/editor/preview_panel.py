"""The panel of the preview: the picture beside the 3-D view, which light shines in it, how bright it is shown."""

import numpy as np

from compare.report.pictures import Exposure
from studio.editor.editor_window import EditorWindow
from studio.editor.preview import HEIGHT, WIDTH, Drawn
from studio.widgets import Panel, Row, plain, text

PANEL_PX = 380
"""Width."""


def _light(window: EditorWindow) -> dict[str, object]:
    count = len(window.scene.lights)
    return {"max": max(count, 2), "disabled": count == 1, "value": window.light + 1}


def _status(window: EditorWindow) -> str:
    drawn = window.drawn
    if drawn is None:
        return "drawing ..."
    if drawn.picture is None:
        return f"**No preview.** {plain(drawn.fault)}"
    return f"{plain(drawn.light)}: {drawn.stage}, {drawn.seconds:.2f} s after the change"


ROWS = (
    text(_status),
    Row("slider", "light", _light, lambda window, value: window.select("light", int(value) - 1),
        {"min": 1, "max": 2, "step": 1, "initial_value": 1, "hint": "Which light shines"}),
    Row("slider", "brightness", lambda window: window.gain, lambda window, value: window.brighten(value),
        {"min": 0.1, "max": 8.0, "step": 0.1, "initial_value": 1.0}),
)  # fmt: skip


class PreviewPanel:
    """The picture beside the 3-D view, with its rows."""

    def __init__(self, window: EditorWindow) -> None:
        import cv2

        self._window, self._shown, gui = window, None, window.client.gui
        panel = gui.add_panel()
        with panel.add_tab("Preview"):
            self._picture = gui.add_image(np.full((HEIGHT, WIDTH, 3), 40, np.uint8), format="png")
            self._panel = Panel(window, ROWS)
        panel.dock_left()
        panel.set_width(PANEL_PX)
        self._resize = lambda image: cv2.resize(image, (WIDTH, round(WIDTH * image.shape[0] / image.shape[1])))
        window.show_preview = self.show

    def show(self, drawn: Drawn) -> None:
        """Show a picture, or what is at fault."""
        self._window.drawn = drawn
        self.refresh()

    def refresh(self) -> None:
        """Follow the number of lights, which one is looked at, and what was drawn."""
        drawn, window = self._window.drawn, self._window
        if drawn is not None and drawn.picture is not None and self._shown != (id(drawn), window.gain):
            self._shown = id(drawn), window.gain
            self._picture.image = self._resize(Exposure(1 / window.gain, np.ones(3)).develop(drawn.picture))
        self._panel.refresh()
