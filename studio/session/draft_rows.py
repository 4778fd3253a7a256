"""The rows in which a new session is put right: what was found, its balls, photographs, and keys of session.toml."""

import re
from pathlib import Path
from typing import Any

from capture.session.manifest import TABLES
from capture.survey.folder_files import name_of
from lab.session_place import MANIFEST
from shoot.init.draft import ROLES
from shoot.init.draft_notes import notes_of
from shoot.init.session_text import facts_of
from studio.session.ball_rows import BALL_ROWS, MILLIMETRES, OBJECT
from studio.session.draft_window import DraftWindow
from studio.session.looking import BOARD, UNUSED, role_of, with_role
from studio.tabs import tab_rows
from studio.widgets import Row, button, code, fenced, plain, text

MEAN = "(mean of the flash frames)"
NONE = "(none)"
BY_SIZE = "(by the object's size)"


def _found(window: DraftWindow) -> str:
    """Return what was found, or what is looked for, as Markdown."""
    draft, lines = window.draft, [code(str(window.place)), ""]
    if draft is None:
        return "\n".join([*lines, f"**{plain(window.taken.told)}**"])
    # No table: its first column would be as wide as the longest key, and the panel is narrow.
    lines += [f"- **{plain(what)}**: {plain(told)}" for what, told in facts_of(draft)]
    count = len(notes_of(draft))
    notes = f"⚠ {count} missing or assumed: see **session.toml**." if count else "Nothing is missing, nothing assumed."
    return "\n".join([*lines, "", notes])


def _progress(window: DraftWindow) -> dict[str, Any]:
    look = window.taken
    return {"visible": bool(look.begun_s) and not look.is_over, "value": 100 * look.done / look.total}


def _photographs(window: DraftWindow) -> tuple[str, ...]:
    return MEAN, *(name_of(path, window.place) for path in window.taken.small)


def _photograph(window: DraftWindow) -> dict[str, Any]:
    names = _photographs(window)
    return {"options": names, "value": names[window.frame + 1]}


def _role(window: DraftWindow) -> dict[str, Any]:
    draft, photograph = window.draft, window.photograph
    if draft is None or photograph is None:
        return {"disabled": True}
    return {"disabled": False, "value": role_of(draft, photograph)}


def _use(window: DraftWindow, role: str) -> None:
    if window.photograph is not None:
        try:
            window.alter("use", with_role(window.need(), window.taken.small, window.photograph, role))
        finally:
            window.refresh()


def _files(window: DraftWindow, path: str) -> list[Path]:
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

    def show(window: DraftWindow) -> dict[str, Any]:
        draft = window.draft
        said = getattr(draft.manifest, table) if draft else None
        value = getattr(said, key) if said is not None and key in said.model_fields_set else None
        shown: dict[str, Any] = {"value": nothing if value is None else value}
        if widget == "dropdown":
            names = (name_of(one, window.place) for one in _files(window, path))
            shown = {"options": (nothing, *declared.get("enum", names))} | shown
        # How values are coded is a question of some kinds of files only.
        return shown | ({"visible": value is not None} if widget == "checkbox" else {})

    def use(window: DraftWindow, value: Any) -> None:
        said = None if widget != "checkbox" and value == nothing else value
        window.alter(key, window.need().saying(table, **{key: said}))

    return Row(widget, key, show, use, start)


def _text(window: DraftWindow) -> str:
    # The columns of comments would be cut off here.
    return fenced(re.sub(r"(?<=\S) {2,}#", "  #", window.text), "toml") if window.draft else ""


def _where(window: DraftWindow) -> str:
    if window.draft is None:
        return ""
    return f"Writes {code(str(window.place / MANIFEST))}. Results go to {code(window.workspace.name(window.taken.out))}."


def _is_found(window: DraftWindow) -> bool:
    return window.draft is not None


TABS = {
    "Balls": BALL_ROWS,
    "Photographs": (
        text("Click a photograph in the strip below the large one; a second click shows the mean again. One that is "
             "not to be used, because somebody walked by or the flash failed: choose *not used*."),
        Row("dropdown", "photograph", _photograph, lambda window, name: window.choose(
            frame=_photographs(window).index(name) - 1, ball=None), {"options": (MEAN,)}),
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
DRAFT_ROWS = (
    OBJECT,
    text(_found),
    Row("progress_bar", show=_progress, start={"value": 0, "visible": False, "animated": True}),
    *tab_rows(TABS, when=_is_found),
    button("Write session", lambda window: window.write(), lambda window: {"visible": _is_found(window)}, kind="main",
           visible=False),
    text(_where),
)  # fmt: skip
