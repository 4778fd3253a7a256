"""Inputs made from a table's declaration: what a key is, its range, unit and choices stand in the scene's document."""

from collections.abc import Callable
from functools import cache
from typing import Any

from formats.picture_files import linear_from_srgb, srgb_from_linear
from studio.editor.editor_window import EditorWindow
from studio.editor.edits import GRAY, Place, value_at, with_value
from studio.widgets import Inputs
from twin.description.description_file import keys_of
from twin.description.materials import VERTEX, Texture, read_texture

METALS = ("Al", "Ag", "Au", "Cu", "Cr", "W", "none")
NONE, COLOUR, VERTICES = "(none)", "(the colour)", "(the mesh's own colours)"
FINE, COARSE = 0.01, 0.1
"""Steps of inputs: of what goes up to 1, and of other numbers."""


@cache
def inputs_of(table: type) -> dict[str, dict[str, Any]]:
    """Return the keys of a table that have an input, each with its schema and `input`, its kind.

    may_be_absent: It says with what it begins where a box is ticked; other keys are shown where they are there.
    """
    found = {}
    for name, field in keys_of(table).items():
        choices = [one for one in field.get("anyOf", [field]) if one.get("type") != "null"]
        field = field | choices[0] | {"may_be_absent": "start" in field}
        kind = field.get("input") or _kind(field)
        if kind:
            found[name] = field | {"input": kind}
    return found


def _kind(field: dict[str, Any]) -> str:
    if "enum" in field or "$ref" in field:
        return "dropdown" if "enum" in field else "table"
    if field.get("type") in ("integer", "number"):
        return "slider" if field.get("maximum") == 1 else "number"
    if len(field.get("prefixItems", ())) == 3:
        return "channels" if field["prefixItems"][0].get("minimum") == 0 else "vector3"
    return "checkbox" if field.get("type") == "boolean" else ""


class Fields:
    """The keys of one table of the document, each with what viser has for its kind.

    at: Returns where the table stands. skip: Keys that have inputs elsewhere.
    A key that may be absent has a box to tick, and its input while it is there. Three channels have one number, unless
    they are asked for one by one: a number typed shall not give a colour.
    """

    def __init__(self, window: EditorWindow, at: Callable[[], Place], skip: tuple[str, ...] = ()) -> None:
        self._window, self._at, self._skip = window, at, skip
        self._folder = window.client.gui.add_folder(None)
        self._kind: type | None = None
        self._inputs = Inputs(window, self._said)
        self._below: dict[str, Fields] = {}
        self._apart: set[Place] = set()

    def refresh(self) -> None:
        """Show the table as it is; its inputs are made anew for a table of another kind."""
        table = value_at(self._window.document, self._at())
        self._folder.visible = table is not None
        if table is None:
            return
        if type(table) is not self._kind:
            self._make(type(table))
        shown = set()
        for name, field in self._fields().items():
            value = vars(table)[name]
            if field["may_be_absent"]:
                self._inputs[f"{name} on"].value = value is not None
                shown.add(f"{name} on")
            if name in self._below:
                self._below[name].refresh()
            elif value is not None or field["input"] in ("picture", "session"):
                shown |= getattr(self, f"_show_{field['input']}", self._show_value)(name, value)
        self._inputs.show_only(shown)

    def _fields(self) -> dict[str, dict[str, Any]]:
        assert self._kind is not None
        return {name: field for name, field in inputs_of(self._kind).items() if name not in self._skip}

    def _make(self, kind: type) -> None:
        for handle in (*self._inputs.values(), *(one._folder for one in self._below.values())):
            handle.remove()
        self._inputs.clear()
        self._below.clear()
        self._kind = kind
        with self._folder:
            for name, field in self._fields().items():
                self._add(name, field)

    def _add(self, name: str, field: dict[str, Any]) -> None:
        unit = field.get("unit") and f", {field['unit']}"
        label = field.get("label") or name.removesuffix(f"_{field.get('unit')}").replace("_", " ") + (unit or "")
        add, look, kind = self._inputs.add, {"hint": field.get("description")}, field["input"]
        low, high = field.get("minimum", field.get("exclusiveMinimum")), field.get("maximum")
        if field["may_be_absent"]:
            add(f"{name} on", "checkbox", label, False, **look)
        if kind == "table":
            self._below[name] = Fields(self._window, lambda: (*self._at(), name))
        elif kind == "number":
            start = int if field["type"] == "integer" else float
            add(name, "number", label, start(max(low or 0, 1)), min=low, max=high, step=start(1) or COARSE, **look)
        elif kind in ("slider", "share"):
            add(name, "slider", label, min=FINE if low else 0.0, max=1.0, step=FINE, initial_value=1.0, **look)
        elif kind in ("dropdown", "metal", "picture", "session"):
            add(name, "dropdown", label, tuple(field.get("enum", METALS if kind == "metal" else (NONE,))), **look)
        elif kind in ("channels", "colour"):
            high = field["prefixItems"][0]["maximum"] if kind == "channels" else 1.0
            add(f"{name} all", "number", label, 0.0, min=0.0, max=float(high), step=FINE, **look)
            add(f"{name} apart", "checkbox", f"{label} by channel", False)
            add(name, "vector3", f"{label} R, G, B", (0.0,) * 3, min=(0.0,) * 3, max=(float(high),) * 3, step=FINE)
            if kind == "colour":
                add(f"{name} rgb", "rgb", "colour", (188, 188, 188))
                add(f"{name} picture", "dropdown", "picture", (COLOUR,), hint="From the workspace")
        else:
            add(name, kind, label, *([(0.0,) * 3] if kind == "vector3" else [False]), **look)
        if kind in ("picture", "colour"):
            upload = self._window.client.gui.add_upload_button(
                f"Send a {field.get('of', 'texture')} from here", color="gray"
            )
            self._inputs[f"{name} upload"] = self._window.on_upload(
                upload, lambda file: self._said(**{f"{name} picture" if kind == "colour" else name: file})
            )

    def _show_value(self, name: str, value: Any) -> set[str]:
        # A picture has no number.
        if isinstance(value, Texture):
            return set()
        handle = self._inputs[name]
        if hasattr(handle, "options") and value not in handle.options:
            handle.options = (*handle.options, value)
        like = handle.value
        handle.value = tuple(float(part) for part in value) if isinstance(value, tuple) else type(like)(value)
        return {name}

    def _show_channels(self, name: str, value: Any) -> set[str]:
        is_apart = len(set(value)) > 1 or (*self._at(), name) in self._apart
        self._inputs[f"{name} all"].value = float(value[0])
        self._inputs[f"{name} apart"].value = is_apart
        return self._show_value(name, value) | {f"{name} apart"} if is_apart else {f"{name} all", f"{name} apart"}

    def _show_colour(self, name: str, value: Any) -> set[str]:
        shown = {f"{name} picture", f"{name} upload"}
        if isinstance(value, tuple):
            self._inputs[f"{name} rgb"].value = tuple(round(255 * float(srgb_from_linear(part))) for part in value)
            shown |= self._show_channels(name, value) | {f"{name} rgb"}
        first = COLOUR if isinstance(value, tuple) else VERTICES if value == VERTEX else value
        self._choose(f"{name} picture", first, (COLOUR, VERTICES, *self._window.listing.pictures))
        return shown

    def _show_picture(self, name: str, value: Any) -> set[str]:
        self._choose(name, value, (NONE, *self._window.listing.pictures))
        return {name, f"{name} upload"}

    def _show_session(self, name: str, value: Any) -> set[str]:
        self._choose(name, value.parent, self._window.listing.sessions)
        return {name}

    def _choose(self, name: str, value: Any, options: tuple[str, ...]) -> None:
        """Show a file among those that there are."""
        path = value.file if isinstance(value, Texture) else value
        shown = NONE if path is None else path if isinstance(path, str) else self._window.name_of(path)
        self._inputs[name].options = tuple(dict.fromkeys((shown, *options)))
        self._inputs[name].value = shown

    def _said(self, **said: Any) -> None:
        """Change what a person has said."""
        ((name, value),) = said.items()
        key, _, part = name.partition(" ")
        place = (*self._at(), key)
        if part == "apart":
            (self._apart.add if value else self._apart.discard)(place)
        # Each choice is a change of its own; digits that are typed are one.
        chosen = (value,) if isinstance(value, str) else ()
        self._window.change(
            " ".join(map(str, (*place, *chosen))).replace("_", " "),
            lambda document: with_value(document, place, self._value(key, part, value, value_at(document, place))),
        )

    def _value(self, key: str, part: str, said: Any, was: Any) -> Any:
        """Return what a key is to be; part: of its inputs, the one by which it was said."""
        field = self._fields()[key]
        file = self._window.workspace.path
        match part or field["input"]:
            case "apart":
                return was if said else (float(was[0]),) * 3
            case "on":
                return field["start"] if said else None
            case "all":
                return (said,) * 3
            case "rgb":
                return tuple(float(linear_from_srgb(one / 255)) for one in said)
            case "session":
                return str(file(f"{said}/lights.json"))
            case "picture":
                known = {COLOUR: GRAY, VERTICES: VERTEX, NONE: None}
                return known[said] if said in known else read_texture(file(said))
        return said
