"""Rows of tabs that the studio itself follows, and the header of the page: areas, undo and redo.

viser keeps the open tab of its own groups to itself; here the view goes with it. A tab is a button of viser's in a
colour by which `page/studio.css` knows it.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Any

from studio.browser_window import BrowserWindow
from studio.desk import AREAS
from studio.widgets import Panel, Row

OPEN, OTHER = "indigo", "dark"


class Tabs:
    """A row of tabs. use: Called with the name of the tab that is pressed."""

    def __init__(self, window: BrowserWindow, names: Sequence[str], use: Callable[[str], Any]) -> None:
        self._buttons = {name: window.button(name, partial(use, name), color=OTHER) for name in names}

    def show(self, chosen: str, marks: Mapping[str, str] | None = None, *, visible: bool = True) -> None:
        """Mark the tab that is open, and put a sign behind the names in `marks`."""
        for name, button in self._buttons.items():
            button.label = f"{name} {(marks or {}).get(name, '')}".strip()
            button.color, button.visible = OPEN if name == chosen else OTHER, visible


class TabbedPanels:
    """Panels of which one is shown, by the words on their tabs; each is made when its tab is first opened.

    panels: What makes each, given the window; or its rows. marks: Returns signs to be put behind the names.
    when: Returns whether there is anything to be shown.
    """

    def __init__(
        self, window: BrowserWindow, panels: Mapping[str, Callable[[Any], Any] | Sequence[Row]],
        marks: Callable[[], Mapping[str, str]] = dict, when: Callable[[], bool] = lambda: True,
    ) -> None:  # fmt: skip
        self._window, self._panels, self._marks, self._when = window, panels, marks, when
        self._tabs = Tabs(window, tuple(panels), window.open_tab)
        self._folders = {name: window.client.gui.add_folder(name, visible=False) for name in panels}
        self._made: dict[str, Any] = {}
        if window.tab not in panels:
            window.tab = next(iter(panels))

    def refresh(self) -> None:
        """Show the panel of the tab that is open; those that were open before follow the window too."""
        chosen, is_shown = self._window.tab, self._when()
        self._tabs.show(chosen, self._marks() if is_shown else None, visible=is_shown)
        for name, folder in self._folders.items():
            folder.visible = is_shown and name == chosen
        if is_shown and chosen not in self._made:
            make = self._panels[chosen]
            with self._folders[chosen]:
                self._made[chosen] = make(self._window) if callable(make) else Panel(self._window, make)
        for panel in self._made.values() if is_shown else ():
            self._window.attempt(panel.refresh)


class Header:
    """The areas; undo and redo; what the page's own script is to know of the view."""

    def __init__(self, window: BrowserWindow) -> None:
        self._window = window
        self._areas = Tabs(window, AREAS, window.go)  # type: ignore[arg-type]
        self._undo = window.button("Undo", window.undo, visible=False)
        self._redo = window.button("Redo", window.redo, visible=False)
        self._state = window.client.gui.add_html("")

    def refresh(self) -> None:
        """Follow the window."""
        window, history = self._window, self._window.history
        self._areas.show(window.area)
        past, future = (history.past, history.future) if history else ((), ())
        self._undo.visible, self._redo.visible = bool(past), bool(future)
        self._undo.label = f"Undo: {past[-1][0]}" if past else "Undo"
        self._redo.label = f"Redo: {future[0][0]}" if future else "Redo"
        is_flat, report = str(window.is_flat).lower(), escape(window.report)
        content = f'<div id="studio-state" data-flat="{is_flat}" data-report="{report}"></div>'
        if self._state.content != content:
            self._state.content = content
