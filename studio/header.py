"""What stands above all panels: the areas, undo and redo, and what the page is to know of the window."""

from html import escape
from uuid import uuid4

from studio.browser_window import BrowserWindow
from studio.desk import AREAS
from studio.tabs import Tabs

RUN = uuid4().hex
"""Of this studio: a page that was open before it knows another one."""


class Header:
    """The areas; undo and redo, by buttons and by keys."""

    def __init__(self, window: BrowserWindow) -> None:
        self._window, gui = window, window.client.gui
        self._areas = Tabs(window, AREAS, window.go, "Areas")  # type: ignore[arg-type]
        self._undo, self._redo = window.button("Undo", window.undo), window.button("Redo", window.redo)
        self._state = gui.add_html("")

    def refresh(self) -> None:
        """Show what can be undone and redone."""
        window, history = self._window, self._window.history
        self._areas.show(window.area)
        past, future = (history.past, history.future) if history else ((), ())
        self._undo.disabled, self._redo.disabled = not past, not future
        self._undo.visible = self._redo.visible = history is not None
        self._undo.label = f"Undo: {past[-1][0]}" if past else "Undo"
        self._redo.label = f"Redo: {future[0][0]}" if future else "Redo"
        report = escape(window.report)
        keys = "".join(
            f'<a data-press="{escape(handle._impl.uuid)}" data-key="{key}"></a>'
            for key, handle in (("undo", self._undo), ("redo", self._redo))
        )
        state = f'data-run="{RUN}" data-flat="{str(window.is_flat).lower()}" data-report="{report}"'
        content = f'<div id="studio-state" {state}>{keys}</div>'
        if self._state.content != content:
            self._state.content = content
