"""What panels and views are made of: rows of widgets, parts of a view drawn again on change, words as Markdown."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.lights import Lights
from scene.rays import import_open3d

UNITS_PER_MM = 0.01
"""The browser's view has clipping planes and gizmos for things a few units large."""
NO_SHADOW = {"cast_shadow": False, "receive_shadow": False}
"""Shadows of the view's own lamps would be taken for the flashes'."""
LIGHT, HELD = (250, 210, 60), (255, 150, 0)
"""Of a lamp; of what a hand moves, or has moved, and of what is selected."""
KINDS = {"main": "blue", "other": "gray", "danger": "red", "open tab": "indigo", "tab": "dark"}
"""Colours of buttons by their roles; `page/studio.css` knows them by these, and makes them plain."""

WITHOUT_LABEL = {"markdown": "content", "html": "content", "image": "image", "progress_bar": "value"}
"""Kinds of widgets, and what each shows."""


def no_use(*said: Any) -> None:
    """Of a widget that nobody changes."""


@dataclass(frozen=True)
class Row:
    """One widget of a panel.

    kind: Of viser's `add_<kind>`; "button" of the window's own; "upload": a button that sends a file.
    show: Given the window, the value or text that it shows now; or several of its properties by their names.
    use: Given the window and, unless it is a button, what a person has said; of "upload" the file's name in the
        workspace.
    start: What viser is given for it in the beginning.
    rows: Of a folder, which is made when it is first visible. Where they are a function, it is given the window, and
        called again when `key`, given the window, is another.
    """

    kind: str
    label: str = ""
    show: Callable[[Any], Any] = lambda window: {}
    use: Callable[..., Any] = no_use
    start: Mapping[str, Any] = field(default_factory=dict)
    rows: "Sequence[Row] | Callable[[Any], Sequence[Row]]" = ()
    key: Callable[[Any], Any] = lambda window: None


def text(show: Callable[[Any], Any] | str) -> Row:
    """Return a row of Markdown."""
    return Row("markdown", show=(lambda window: show) if isinstance(show, str) else show)


def button(label: str, use: Callable[[Any], Any], show: Callable[[Any], Any] = lambda window: {}, **start: Any) -> Row:
    """Return a row of a button; `start`: `kind`, one of `KINDS`, and what viser takes."""
    return Row("button", label, show, use, start)


class Panel:
    """Widgets that are made from rows, and follow the window."""

    def __init__(self, window: Any, rows: Sequence[Row]) -> None:
        self._window = window
        self._made = [(row, self._add(row)) for row in rows]
        self._inside: dict[int, tuple[Any, Panel]] = {}
        """Of folders, by their row's number: the key that it was made for, and what is in it."""

    def _add(self, row: Row) -> Any:
        window, gui, start = self._window, self._window.client.gui, dict(row.start)
        if row.kind in ("button", "upload"):
            start["color"] = KINDS[start.pop("kind", "other")]
        if row.kind == "upload":
            return window.on_upload(gui.add_upload_button(row.label, **start), partial(row.use, window))
        first = start.pop(WITHOUT_LABEL[row.kind], "") if row.kind in WITHOUT_LABEL else row.label or None
        value = [start.pop("value")] if "value" in start else []
        handle = getattr(gui, f"add_{row.kind}")(first, *value, **start)
        if row.kind == "button":
            window.on(handle.on_click, partial(row.use, window))
        elif row.use is not no_use:
            window.on_input(handle, partial(row.use, window))
        return handle

    def refresh(self) -> None:
        """Show what is now; only what changed is sent."""
        for number, (row, handle) in enumerate(self._made):
            # What is at fault in one row breaks no other.
            self._window.attempt(partial(self._refresh, number, row, handle))

    def _refresh(self, number: int, row: Row, handle: Any) -> None:
        found = row.show(self._window)
        if not isinstance(found, dict):
            found = {WITHOUT_LABEL.get(row.kind, "value"): found}
        for name, value in found.items():
            name, value = ("color", KINDS[value]) if name == "kind" else (name, value)
            if getattr(handle, name) != value:
                setattr(handle, name, value)
        if row.kind != "folder" or not (found.get("visible", True) or number in self._inside):
            return
        key, made = row.key(self._window), self._inside.get(number)
        if made is None or made[0] != key:
            if made is not None:
                made[1].remove()
            with handle:
                rows = row.rows(self._window) if callable(row.rows) else row.rows
                made = self._inside[number] = key, Panel(self._window, rows)
        made[1].refresh()

    def remove(self) -> None:
        """Take all of it away."""
        for _, handle in self._made:
            handle.remove()


class Layers:
    """What stands in a view: named parts, each drawn again only when what it shows has changed."""

    def __init__(self) -> None:
        self._keys: dict[str, Any] = {}
        self._handles: dict[str, list[Any]] = {}

    def draw(self, name: str, key: Any, add: Callable[[], list[Any] | None]) -> None:
        """Put a part, whose handles, if any, `add` returns, in place of what it was, unless it has this key already."""
        if name in self._keys and self._keys[name] == key:
            return
        self._remove(name)
        # Kept first: what fails once would fail again at each refresh.
        self._keys[name] = key
        self._handles[name] = add() or []

    def _remove(self, name: str) -> None:
        self._keys.pop(name, None)
        for handle in self._handles.pop(name, []):
            handle.remove()

    def keep_only(self, names: set[str]) -> None:
        """Take all other parts away."""
        for name in [name for name in self._keys if name not in names]:
            self._remove(name)


def light_places(lights: Lights, away_mm: float) -> NDArray[np.float64]:
    """Return (N, 3), mm, where lights are drawn: near ones where they are, distant ones so far toward them."""
    places = lights.positions_mm
    return lights.reference_point_mm + away_mm * lights.directions if places is None else places


def add_light(view: Any, name: str, ends_mm: ArrayLike, spread_mm: float, colour: Any, radius: float) -> list[Any]:
    """Add a light, a ball of a radius in `spread_mm`, with an arrow of 0.22 of that toward the reference point.

    ends_mm (2, 3): The light's place and that point. Returns the handles: the ball, the arrow.
    """
    place, reference = np.asarray(ends_mm, np.float64)
    toward = (reference - place) / max(float(np.linalg.norm(reference - place)), 1e-9)
    line = np.stack([place, place + toward * 0.22 * spread_mm])[None] * UNITS_PER_MM
    size = spread_mm * UNITS_PER_MM
    look = {"shaft_radius": 0.006 * size, "head_radius": 0.018 * size, "head_length": 0.05 * size}
    arrow = view.add_arrows(f"{name}_arrow", line.astype(np.float32), colour, **look)
    at = tuple(place * UNITS_PER_MM)
    return [view.add_icosphere(name, radius=radius * size, color=colour, position=at, **NO_SHADOW), arrow]


def plain(text: str) -> str:
    """Return a text for Markdown: every sign that it, its links or HTML could take for its own is escaped."""
    return re.sub(r"([\\`*_{}\[\]()<>#+\-.!|~&:/@=$^])", r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """Return a text as a code span of Markdown, in more backticks than it holds in a row."""
    inside = " ".join(text.split())
    padded = f" {inside} " if "`" in inside else inside
    fence = "`" * (1 + max(map(len, re.findall("`+", inside)), default=0))
    return f"{fence}{padded}{fence}"


MOST_FACES = 70_000
"""That are sent to a browser; a software renderer still turns them. The built-in shapes have fewer."""


def display_mesh(vertices: NDArray[np.float64], faces: NDArray) -> tuple[NDArray[np.float64], NDArray]:
    """Return vertices (V, 3) and faces (F, 3) of a mesh, or of one that looks like it from afar.

    Of one with more than `MOST_FACES` the vertices in a cell of a cubic grid become one [Rossignac1993]. The grid is
    made coarser until few enough are left. An outline moves by less than a cell.
    """
    if len(faces) <= MOST_FACES:
        return vertices, faces
    o3d = import_open3d()
    whole = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    # A surface of area a few extents squared has about this many cells.
    mesh, cell = whole, (float(np.ptp(vertices, axis=0).max()) or 1.0) / np.sqrt(MOST_FACES / 2)
    while len(mesh.triangles) > MOST_FACES:
        mesh, cell = whole.simplify_vertex_clustering(cell), 1.25 * cell
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
