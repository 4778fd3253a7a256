"""The rows in which a new session is put right: what was found, its balls, photographs, and keys of session.toml."""

import os
import re
from pathlib import Path
from typing import Any

from capture.session.manifest import TABLES
from capture.survey.folder_files import name_of
from lab.session_place import MANIFEST
from scene.spheres import KINDS
from shoot.init.draft import ROLES
from shoot.init.session_text import facts_of, notes_of
from studio.new_session.new_session_window import BOARD, UNUSED, NewSessionWindow, role_of, with_role
from studio.photograph.outline_rows import of_ball, outline_rows
from studio.tabs import tab_rows
from studio.widgets import Row, button, code, fenced, plain, text

MEAN = "(mean of the flash frames)"
NONE = "(none)"
BY_SIZE = "(by the object's size)"
MILLIMETRES: dict[str, Any] = {"value": 0.0, "min": 0.0, "max": 10_000.0, "step": 0.01}


def _names(window: NewSessionWindow) -> dict[str, Path]:
    """Return the folders by the names by which they are chosen."""
    folders = list(window.state.looks)
    top = os.path.commonpath([folder.parent for folder in folders])
    there = " (has a session.toml)" if len(folders) > 1 else ""
    return {f"{folder.relative_to(top)}{there if (folder / MANIFEST).exists() else ''}": folder for folder in folders}


def _object(window: NewSessionWindow) -> dict[str, Any]:
    names = _names(window)
    chosen = next(name for name, folder in names.items() if folder == window.place)
    return {"visible": len(names) > 1, "options": tuple(names), "value": chosen}


def _found(window: NewSessionWindow) -> str:
    """Return what was found, or what is looked for, as Markdown."""
    draft, lines = window.capture, [code(str(window.place)), ""]
    if draft is None:
        told = "has a session.toml, which stays as it is." if window.manifest.exists() else window.taken.told
        return "\n".join([*lines, f"**{plain(told)}**"])
    # No table: its first column would be as wide as the longest key, and the panel is narrow.
    lines += [f"- **{plain(what)}**: {plain(told)}" for what, told in facts_of(draft)]
    count = len(notes_of(draft))
    notes = f"⚠ {count} missing or assumed: see **session.toml**." if count else "Nothing is missing, nothing assumed."
    return "\n".join([*lines, "", notes])


def _progress(window: NewSessionWindow) -> dict[str, Any]:
    look = window.taken
    return {"visible": bool(look.begun_s) and not look.is_over, "value": 100 * look.done / look.total}


def _diameter(kind: str) -> Row:
    def show(window: NewSessionWindow) -> dict[str, Any]:
        known = [ball.diameter_mm or 0.0 for ball in window.balls if ball.kind == kind]
        return {"value": known[0] if len(set(known)) == 1 else 0.0, "disabled": not known}

    return Row("number", f"{kind} balls, mm", show, lambda window, value: window.measure(kind, value),
               MILLIMETRES | {"hint": "Diameter"})  # fmt: skip


def _ball_facts(window: NewSessionWindow) -> str:
    if window.capture is None:
        return ""
    if window.ball is None:
        apart = [f" The {ball.kind} ball has photographs of its own." for ball in window.balls if ball.frames]
        return f"{len(window.outlines)} circles.{''.join(apart)}"
    ball = window.outlines[window.ball]
    number = next(number for number, one in enumerate(window.balls) if one is ball)
    given = window.capture.written.spheres[number].center_px
    return (
        f"{'As found' if window.is_found(ball) else 'Placed by hand'}. session.toml gives "
        f"{'its circle' if given else 'no circle: the ball is looked for again'}."
    )


def _measure_one(window: NewSessionWindow, diameter_mm: float) -> None:
    if window.ball is not None:
        window.measure(window.ball, diameter_mm)


def _photographs(window: NewSessionWindow) -> dict[str, Path]:
    return {name_of(path, window.place): path for path in window.taken.small}


def _photograph(window: NewSessionWindow) -> dict[str, Any]:
    chosen = MEAN if window.photograph is None else name_of(window.photograph, window.place)
    return {"options": (MEAN, *_photographs(window)), "value": chosen}


def _role(window: NewSessionWindow) -> dict[str, Any]:
    draft, photograph = window.capture, window.photograph
    if draft is None or photograph is None:
        return {"disabled": True}
    return {"disabled": False, "value": role_of(draft, photograph)}


def _use(window: NewSessionWindow, role: str) -> None:
    if window.photograph is not None:
        try:
            window.edit(with_role(window.need(), window.taken.small, window.photograph, role), "use")
        finally:
            window.refresh()


def _files(window: NewSessionWindow, path: str) -> list[Path]:
    """Return the files that a key may name."""
    files = window.taken.files
    return {"object.scan": files.scans, "object.mask": files.masks, "object.normals": files.normals,
            "lights.file": files.lights}.get(path, [])  # fmt: skip


def _key(path: str) -> Row:
    """Return the input of a key of session.toml, as in camera.focal_mm, made from its declaration.

    It is a number, 0 where it is not said; a checkbox; or a choice.
    """
    table, key = path.split(".")
    schema = TABLES[table].model_json_schema()["properties"][key]
    declared, start = schema.get("anyOf", [schema])[0], {"hint": schema["description"]}
    widget, nothing = {"boolean": ("checkbox", False), "number": ("number", 0.0)}.get(
        declared["type"], ("dropdown", BY_SIZE if "enum" in declared else NONE)
    )
    start |= {"checkbox": {"value": False}, "number": MILLIMETRES, "dropdown": {"options": (nothing,)}}[widget]

    def show(window: NewSessionWindow) -> dict[str, Any]:
        draft = window.capture
        said = getattr(draft.manifest, table) if draft else None
        value = getattr(said, key) if said is not None and key in said.model_fields_set else None
        shown: dict[str, Any] = {"value": nothing if value is None else value}
        if widget == "dropdown":
            names = (name_of(one, window.place) for one in _files(window, path))
            shown = {"options": (nothing, *declared.get("enum", names))} | shown
        # How values are coded is a question of some kinds of files only.
        return shown | ({"visible": value is not None} if widget == "checkbox" else {})

    def use(window: NewSessionWindow, value: Any) -> None:
        said = None if widget != "checkbox" and value == nothing else value
        window.edit(window.need().saying(table, **{key: said}), key)

    return Row(widget, key, show, use, start)


def _text(window: NewSessionWindow) -> str:
    # The columns of comments would be cut off here.
    return fenced(re.sub(r"(?<=\S) {2,}#", "  #", window.text), "toml") if window.capture else ""


def _where(window: NewSessionWindow) -> str:
    if window.capture is None:
        return ""
    return f"Writes {code(str(window.manifest))}. Results go to {code(window.workspace.name(window.taken.out))}."


def _is_found(window: NewSessionWindow) -> bool:
    return window.capture is not None


TABS = {
    "Balls": (
        text("Is every ball circled, and nothing else? Give their diameters; 0: not known."),
        *map(_diameter, KINDS),
        *outline_rows(_ball_facts, [
            Row("number", "diameter, mm", of_ball(lambda ball: ball.diameter_mm or 0.0), _measure_one,
                MILLIMETRES | {"hint": "Where it is not that of the others of its kind; 0: not known"}),
        ]),
    ),
    "Photographs": (
        text("Click a photograph in the strip below the large one; a second click shows the mean again. One that is "
             "not to be used, because somebody walked by or the flash failed: choose *not used*."),
        Row("dropdown", "photograph", _photograph, lambda window, name: window.choose(
            photograph=_photographs(window).get(name), ball=None), {"options": (MEAN,)}),
        Row("dropdown", "used for", _role, _use, {"options": (*ROLES, BOARD, UNUSED), "disabled": True}),
    ),
    "Camera": (
        *(_key(f"camera.{key}") for key in ("focal_mm", "sensor_mm", "pixel_um", "crop_factor")),
        text("0: as the photographs say. Shots of a ChArUco board or a chessboard measure all of it."),
    ),
    "Object": tuple(map(_key, ("object.scan", "object.scan_unit", "object.mask", "object.normals", "lights.file",
                               "frames.linear"))),
    "session.toml": (text(_text),),
}  # fmt: skip
NEW_SESSION_ROWS = (
    text(lambda window: {"content": "Several objects: each gets a session of its own.",
                         "visible": len(window.state.looks) > 1}),
    Row("dropdown", "object", _object, lambda window, name: window.open(_names(window)[name]),
        {"options": ("",), "visible": False}),
    text(_found),
    Row("progress_bar", show=_progress, start={"value": 0, "visible": False, "animated": True}),
    button("Open its session", lambda window: window.open_session(),
           lambda window: {"visible": window.capture is None and window.manifest.exists()}, kind="main", visible=False),
    *tab_rows(TABS, when=_is_found),
    button("Write session", lambda window: window.write(), lambda window: {"visible": _is_found(window)}, kind="main",
           visible=False),
    text(_where),
)  # fmt: skip
