"""What panels and views are made of: rows of widgets, inputs by name, layers drawn again on change, Markdown."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

UNITS_PER_MM = 0.01
"""The browser's view has clipping planes and gizmos for things a few units large."""
NO_SHADOW = {"cast_shadow": False, "receive_shadow": False}
"""Shadows of the view's own lamps would be taken for the flashes'."""


@dataclass(frozen=True)
class Row:
    """One widget of a panel, or with `rows` a folder of them.

    kind: Of viser's `add_<kind>`; "button" of the window's own; "more": what `use` adds, given the window.
    start: What viser is given for it in the beginning.
    show: Given the window, the value or the text that it shows now; or several of its properties by their names.
    use: Given the window and, unless it is a button, what a person has said.
    """

    kind: str
    label: str = ""
    show: Callable[[Any], Any] = lambda window: {}
    use: Callable[..., Any] | None = None
    start: dict[str, Any] | None = None
    rows: "tuple[Row, ...]" = ()


def text(show: Callable[[Any], Any]) -> Row:
    """Return a row of Markdown."""
    return Row("markdown", show=show)


class Panel:
    """Widgets that are made from rows, and follow the window."""

    def __init__(self, window: Any, rows: Sequence[Row]) -> None:
        self._window = window
        self._made: list[tuple[Any, Row]] = []
        self._add(rows)

    def _add(self, rows: Sequence[Row]) -> None:
        window, gui = self._window, self._window.client.gui
        for row in rows:
            if row.kind == "folder":
                with gui.add_folder(row.label):
                    self._add(row.rows)
                continue
            if row.kind == "more":
                assert row.use is not None
                row.use(window)
                continue
            if row.kind == "button":
                assert row.use is not None
                handle = window.button(row.label, partial(row.use, window), **row.start or {})
            else:
                words = "" if row.kind in ("markdown", "html") else row.label
                handle = getattr(gui, f"add_{row.kind}")(words, **row.start or {})
                if row.use is not None:
                    window.on_input(handle, partial(row.use, window))
            self._made.append((handle, row))

    def refresh(self) -> None:
        """Show what is now; only what changed is sent."""
        for handle, row in self._made:
            found = row.show(self._window)
            name = "content" if row.kind in ("markdown", "html") else "value"
            for key, value in (found if isinstance(found, dict) else {name: found}).items():
                if getattr(handle, key) != value:
                    setattr(handle, key, value)


class Inputs(dict[str, Any]):
    """The inputs of a panel by name.

    change: given name=value of an input that a person has changed, in the window's thread; None: nothing is done.
    """

    def __init__(self, window: Any, change: Callable[..., Any] | None = None) -> None:
        super().__init__()
        self._window, self._change = window, change

    def add(self, name: str, kind: str, label: str, *start: Any, **look: Any) -> None:
        """Add what viser's `add_<kind>` makes; its values are given on as the kind of number that it starts with."""
        handle = self[name] = getattr(self._window.client.gui, f"add_{kind}")(label, *start, **look)
        change, like = self._change, handle.value
        if change is not None:
            self._window.on_input(handle, lambda value: change(**{name: _as(like, value)}))

    def show(self, **values: Any) -> None:
        """Give inputs these values."""
        for name, value in values.items():
            self[name].value = value

    def show_only(self, names: set[str]) -> None:
        """Hide all inputs but these."""
        for name, handle in self.items():
            handle.visible = name in names

    def number(self, name: str) -> float:
        """Return the value of an input as a float."""
        return float(self[name].value)


def _as(like: Any, value: Any) -> Any:
    return tuple(map(type(like[0]), value)) if isinstance(like, tuple) else type(like)(value)


class Layers:
    """What stands in a view or a folder: named parts, each drawn again only when what it shows has changed."""

    def __init__(self) -> None:
        self._keys: dict[str, Any] = {}
        self._handles: dict[str, list[Any]] = {}

    def draw(self, name: str, key: Any, add: Callable[[], list[Any] | None]) -> None:
        """Put a part, whose handles, if any, `add` returns, in place of what it was, unless it has this key already."""
        if name in self._keys and self._keys[name] == key:
            return
        self.remove(name)
        # Kept first: what fails once would fail again at each refresh.
        self._keys[name] = key
        self._handles[name] = add() or []

    def remove(self, name: str) -> None:
        """Take a part away."""
        self._keys.pop(name, None)
        for handle in self._handles.pop(name, []):
            handle.remove()

    def keep_only(self, names: set[str]) -> None:
        """Take all other parts away."""
        for name in [name for name in self._keys if name not in names]:
            self.remove(name)


def add_light_arrow(view: Any, name: str, ends_mm: ArrayLike, spread_mm: float, colour: tuple[int, int, int]) -> Any:
    """Add an arrow from a light toward the reference point, `ends_mm` (2, 3), as long as 0.22 of `spread_mm`."""
    place, reference = np.asarray(ends_mm, np.float64)
    toward = (reference - place) / max(float(np.linalg.norm(reference - place)), 1e-9)
    size = spread_mm * UNITS_PER_MM
    return view.add_arrows(
        name,
        (np.stack([place, place + toward * 0.22 * spread_mm])[None] * UNITS_PER_MM).astype(np.float32),
        colour,
        shaft_radius=0.006 * size,
        head_radius=0.018 * size,
        head_length=0.05 * size,
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows of Markdown as a table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) if rows else ""


def plain(text: str) -> str:
    """Return a text for Markdown: every sign that it, its links or HTML could take for its own is escaped."""
    return re.sub(r"([\\`*_{}\[\]()<>#+\-.!|~&:/@=$^])", r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """Return a text as a code span of Markdown, in more backticks than it holds in a row."""
    inside = " ".join(text.split())
    padded = f" {inside} " if "`" in inside else inside
    return f"{_fence(inside)}{padded}{_fence(inside)}"


def fenced(text: str, kind: str) -> str:
    """Return lines of text as a block of code of Markdown."""
    fence = max(_fence(text), "```", key=len)
    return f"{fence}{kind}\n{text}\n{fence}"


def _fence(text: str) -> str:
    """Return more backticks than a text holds in a row."""
    return "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
