"""Rows of tabs that the studio itself follows: which tab is open is known here, and the view goes with it.

viser keeps the open tab of its own groups to itself. A tab here is a line of HTML that presses a hidden button of
viser's (`page/studio.js`): the press comes in as every other input does, and is checked as one. The header above all
panels has the areas, undo and redo, and what the page is to know of the window.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Any
from uuid import uuid4

from studio.browser_window import BrowserWindow
from studio.desk import AREAS


def press(handle: Any, label: str, more: str = "") -> str:
    """Return an HTML button that presses one of viser's, which is not shown itself."""
    uuid = escape(handle._impl.uuid)
    return (
        f'<style>div:has(> [id="{uuid}"]) {{ display: none !important }}</style>'
        f'<button type="button" data-press="{uuid}" {more}>{label}</button>'
    )


class Tabs:
    """A row of tabs. use: Called with the name of the tab that is pressed."""

    def __init__(self, window: BrowserWindow, names: Sequence[str], use: Callable[[str], Any], label: str) -> None:
        self._label = label
        self._buttons = {name: window.button(f"to {name}", partial(use, name)) for name in names}
        self.row = window.client.gui.add_html("")

    def show(self, chosen: str, marks: Mapping[str, str] | None = None) -> None:
        """Mark the tab that is open, and put a sign behind the names in `marks`."""
        parts = []
        for name, handle in self._buttons.items():
            mark = escape((marks or {}).get(name, ""))
            state = f'role="tab" aria-label="{escape(name)}" aria-selected="{str(name == chosen).lower()}"'
            parts.append(press(handle, f"{escape(name)} <small>{mark}</small>" if mark else escape(name), state))
        content = f'<div class="studio-tabs" role="tablist" aria-label="{escape(self._label)}">{"".join(parts)}</div>'
        if self.row.content != content:
            self.row.content = content


class TabbedPanels:
    """Panels of which one is shown, by the words on their tabs; each is made when its tab is first opened.

    marks: Returns signs to be put behind the names. when: Returns whether there is anything to be shown.
    """

    def __init__(
        self, window: BrowserWindow, panels: Mapping[str, Callable[[Any], Any]], label: str,
        marks: Callable[[], Mapping[str, str]] = dict, when: Callable[[], bool] = lambda: True,
    ) -> None:  # fmt: skip
        self._window, self._panels, self._marks, self._when = window, panels, marks, when
        self._tabs = Tabs(window, tuple(panels), window.open_tab, label)
        self._folders = {name: window.client.gui.add_folder(name, visible=False) for name in panels}
        self.made: dict[str, Any] = {}
        if window.tab not in panels:
            window.tab = next(iter(panels))

    def refresh(self) -> None:
        """Show the panel of the tab that is open; those that were open before follow the window too."""
        chosen, is_shown = self._window.tab, self._when()
        self._tabs.row.visible = is_shown
        for name, folder in self._folders.items():
            folder.visible = is_shown and name == chosen
        if not is_shown:
            return
        self._tabs.show(chosen, self._marks())
        if chosen not in self.made:
            with self._folders[chosen]:
                self.made[chosen] = self._panels[chosen](self._window)
        for panel in self.made.values():
            self._window.attempt(panel.refresh)


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
