"""Inputs made from a table's declaration: what a key is, its range, unit and choices stand in the scene's document."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from formats.picture_files import linear_from_srgb, srgb_from_linear
from studio.editor.editor_window import EditorWindow
from studio.editor.edits import GRAY, Place, value_at, with_value
from studio.widgets import Row
from twin.description.description_file import keys_of
from twin.description.materials import VERTEX, Texture, read_texture

METALS = ("Al", "Ag", "Au", "Cu", "Cr", "W", "none")
NONE, COLOUR, VERTICES = "(none)", "(the colour)", "(the mesh's own colours)"
FINE, COARSE = 0.01, 0.1
"""Steps of inputs: of what goes up to 1, and of other numbers."""
At = Callable[[EditorWindow], Place]
"""Where a table stands in the document."""


@cache
def inputs_of(table: type) -> dict[str, dict[str, Any]]:
    """Return the keys of a table that have an input, each with its schema, `input`, its kind, and `label`.

    may_be_absent: It says with what it begins where a box is ticked; other keys are shown where they are there.
    """
    found = {}
    for name, field in keys_of(table).items():
        choices = [one for one in field.get("anyOf", [field]) if one.get("type") != "null"]
        field = field | choices[0] | {"may_be_absent": "start" in field}
        unit = field.get("unit")
        usual = name.removesuffix(f"_{unit}").replace("_", " ") + (f", {unit}" if unit else "")
        field["label"] = field.get("label") or usual
        kind = field.get("input") or _kind(field)
        if kind and kind != "session":
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


def fields(at: At, skip: tuple[str, ...] = ()) -> Row:
    """Return the inputs of the keys of one table of the document, made anew for a table of another kind.

    skip: Keys that have inputs elsewhere. A key that may be absent has a box to tick, and its input while it is there.
    """

    def table(window: EditorWindow) -> Any:
        return value_at(window.document, at(window))

    def rows(window: EditorWindow) -> list[Row]:
        known = inputs_of(type(table(window)))
        return [row for name, field in known.items() if name not in skip for row in _Key(at, name, field).rows()]

    return Row("folder", show=lambda window: {"visible": table(window) is not None}, rows=rows,
               key=lambda window: type(table(window)))  # fmt: skip


class _Key:
    """The rows of one key. Each has `show`, by the key's value, and `use`, which makes a value of what was said."""

    def __init__(self, at: At, name: str, field: dict[str, Any]) -> None:
        self._at, self._name, self._field, self._label = at, name, field, field["label"]

    def rows(self) -> Iterator[Row]:
        field, kind = self._field, self._field["input"]
        hint: dict[str, Any] = {"hint": field.get("description")}
        low, high = field.get("minimum", field.get("exclusiveMinimum")), field.get("maximum")
        if field["may_be_absent"]:
            begin = lambda window, said, was: field["start"] if said else None  # noqa: E731
            yield self._row("checkbox", self._label, lambda *now: now[1] is not None, begin, value=False, **hint)
        if kind == "table":
            yield fields(lambda window: (*self._at(window), self._name))
        elif kind == "number":
            start = int if field["type"] == "integer" else float
            look = {"value": start(max(low or 0, 1)), "min": low, "max": high, "step": start(1) or COARSE}
            yield self._row("number", self._label, _present, **look, **hint)
        elif kind in ("slider", "share"):
            look = {"min": FINE if low else 0.0, "max": 1.0, "step": FINE, "initial_value": 1.0}
            yield self._row("slider", self._label, _present, **look, **hint)
        elif kind in ("dropdown", "metal"):
            options = tuple(field.get("enum", METALS))
            shown = lambda window, value: {"options": options if value in (None, *options) else (*options, value)}  # noqa: E731
            yield self._row("dropdown", self._label, lambda *now: shown(*now) | _present(*now), options=options, **hint)
        elif kind == "picture":
            yield from self._pictures(self._label, (NONE,))
        elif kind in ("channels", "colour"):
            top = float(field["prefixItems"][0]["maximum"]) if kind == "channels" else 1.0
            look = {"value": (0.0,) * 3, "min": (0.0,) * 3, "max": (top,) * 3, "step": FINE}
            yield self._row("vector3", f"{self._label} R, G, B", _present, **look, **hint)
            if kind == "colour":
                linear = lambda window, said, was: tuple(float(linear_from_srgb(part / 255)) for part in said)  # noqa: E731
                yield self._row("rgb", "colour", _shown_colour, linear, value=(188, 188, 188))
                yield from self._pictures("picture", (COLOUR, VERTICES))
        else:
            start = (0.0,) * 3 if kind == "vector3" else False
            yield self._row(kind, self._label, _present, value=start, **hint)

    def _row(
        self, kind: str, label: str, show: Callable[[EditorWindow, Any], Any],
        make: Callable[[EditorWindow, Any, Any], Any] = lambda window, said, was: said, **start: Any,
    ) -> Row:  # fmt: skip
        """Return a row; show: given the window and the value. make: given window, what was said and the value."""

        def use(window: EditorWindow, said: Any) -> None:
            place = (*self._at(window), self._name)
            # Each choice is a change of its own; digits that are typed are one.
            label = " ".join(map(str, (*place, *((said,) if isinstance(said, str) else ())))).replace("_", " ")
            window.change(
                label, lambda document: with_value(document, place, make(window, said, value_at(document, place)))
            )

        value = lambda window: vars(value_at(window.document, self._at(window)))[self._name]  # noqa: E731
        return Row(kind, label, lambda window: show(window, value(window)), use, start)

    def _pictures(self, label: str, before: tuple[str, ...]) -> Iterator[Row]:
        known = {COLOUR: GRAY, VERTICES: VERTEX, NONE: None}

        def show(window: EditorWindow, value: Any) -> dict[str, Any]:
            words = COLOUR if isinstance(value, tuple) else VERTICES if value == VERTEX else NONE
            name = window.workspace.name(value.file) if isinstance(value, Texture) and value.file else words
            return {"options": tuple(dict.fromkeys((name, *before))), "value": name}

        def make(window: EditorWindow, said: str, was: Any) -> Any:
            return known[said] if said in known else read_texture(window.workspace.path(said))

        yield (chosen := self._row("dropdown", label, show, make, options=(NONE,)))
        yield Row("upload", f"Send a {self._field.get('of', 'texture')} from here", use=chosen.use)


def _shown_colour(window: EditorWindow, value: Any) -> dict[str, Any]:
    """Show a reflectance as sRGB where it is a colour."""
    if not isinstance(value, tuple):
        return {"visible": False}
    return {"visible": True, "value": tuple(round(255 * float(srgb_from_linear(part))) for part in value)}


def _present(window: EditorWindow, value: Any) -> dict[str, Any]:
    """Show a value where it is there. A picture, or the mesh's own colours, have no number."""
    if value is None or value == VERTEX or isinstance(value, Texture):
        return {"visible": False}
    return {"visible": True, "value": tuple(map(float, value)) if isinstance(value, tuple) else value}
