"""Rows that every page has: areas, undo and redo; tabs that the studio itself follows; the work that is under way.

viser keeps the open tab of its own groups to itself; here the view goes with it. A tab is a button of viser's in a
colour by which `page/studio.css` knows it.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

from studio.studio_state import AREAS
from studio.widgets import Row, button, plain, text

Rows = Sequence[Row] | Callable[[Any], Sequence[Row]]
TAB = {False: "tab", True: "open tab"}


def tab_rows(tabs: Mapping[str, Rows], mark: Callable[[Any, str], str] = lambda window, name: "") -> tuple[Row, ...]:
    """Return a row of tabs, and the folder of each, of which one is shown; `mark` returns a sign behind a name."""

    def tab(name: str) -> Row:
        def show(window: Any) -> dict[str, Any]:
            return {"label": f"{name} {mark(window, name)}".strip(), "kind": TAB[window.tab == name]}

        return button(name, lambda window: window.open_tab(name), show, kind="tab")

    def folder(name: str, rows: Rows) -> Row:
        shown = lambda window: {"visible": window.tab == name}  # noqa: E731
        return Row("folder", name, shown, start={"visible": False}, rows=rows)

    return *map(tab, tabs), *(folder(name, rows) for name, rows in tabs.items())


def _past(label: str, use: Callable[[Any], Any], part: str) -> Row:
    def show(window: Any) -> dict[str, Any]:
        changes = getattr(window.history, part) if window.history else ()
        last = changes[-1 if part == "past" else 0][0] if changes else ""
        return {"visible": bool(changes), "label": f"{label}: {last}" if last else label}

    return button(label, use, show, visible=False)


def _view(window: Any) -> str:
    is_flat, report = str(window.is_flat).lower(), escape(window.report)
    return f'<div id="studio-state" data-flat="{is_flat}" data-report="{report}"></div>'


HEADER = (
    *(button(area, lambda window, area=area: window.go(area),
             lambda window, area=area: {"kind": TAB[window.area == area]}, kind="tab") for area in AREAS),
    _past("Undo", lambda window: window.undo(), "past"),
    _past("Redo", lambda window: window.redo(), "future"),
    Row("html", show=_view),
)  # fmt: skip
"""The areas; undo and redo; what the page's own script is to know of the view."""


def _work(window: Any) -> str:
    """Return how far the work is, or what came of it, as Markdown."""
    work = window.work
    if work is None:
        return window.work_told
    if not work.is_over:
        said = "\n".join(f"- {plain(text)}" for text in work.said)
        return f"**{plain(work.label)}**, {time.monotonic() - work.begun_s:.0f} s so far\n\n{said}"
    if work.is_stopped:
        return f"Stopped. What is done is kept; **{plain(work.label)}** goes on from there."
    return f"**Stopped by a fault.** {plain(work.fault)}" if work.fault else ""


WORK_ROWS = (
    button("Run", lambda window: window.begin_work(), lambda window: {
        "label": window.job().label, "kind": "main" if window.job().is_main else "other",
        "disabled": window.is_busy or not window.job().is_possible}, kind="main"),
    button("Stop", lambda window: window.work.stop(), lambda window: {"visible": window.is_busy},
           kind="danger", visible=False),
    Row("progress_bar", start={"value": 0, "visible": False, "animated": True}, show=lambda window: {
        "visible": window.is_busy, "value": 100 * window.work.share if window.is_busy else 0.0}),
    text(_work),
)  # fmt: skip
"""The button that begins the window's work on a folder, the one that stops it, and how far it is."""
