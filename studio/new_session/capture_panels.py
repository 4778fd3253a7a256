"""The panels in which a new session is put right: its balls, its photographs, and keys of session.toml."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from capture.session.manifest import TABLES
from capture.survey.folder_files import name_of
from scene.spheres import KINDS
from shoot.init.draft import ROLES
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photograph_roles import BOARD, UNUSED, role_of, with_role
from studio.photograph.outline_inputs import OutlineInputs
from studio.widgets import Inputs

MEAN = "(mean of the flash frames)"
NONE = "(none)"
BY_SIZE = "(by the object's size)"
MILLIMETRES: dict[str, Any] = {"min": 0.0, "max": 10_000.0, "step": 0.01}


class DiametersPanel:
    """The balls: their diameters, and which circles are balls."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        gui.add_markdown("Is every ball circled, and nothing else? Give their diameters; 0: not known.")
        self._diameters = Inputs(window, lambda **said: window.measure(*next(iter(said.items()))))
        for kind in KINDS:
            self._diameters.add(kind, "number", f"{kind} balls, mm", 0.0, hint="Diameter", **MILLIMETRES)
        self._outline = OutlineInputs(window, self._facts, window.back_to_found, self._add_own)

    def _add_own(self) -> None:
        window = self._window
        hint = "Where it is not that of the others of its kind; 0: not known"
        self._own = window.client.gui.add_number("diameter, mm", 0.0, hint=hint, **MILLIMETRES)
        window.on_input(self._own, lambda value: window.ball is None or window.measure(window.ball, value))

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        self._outline.refresh()
        self._own.disabled = window.ball is None
        self._own.value = 0.0 if window.ball is None else window.outlines[window.ball].diameter_mm or 0.0
        for kind, handle in self._diameters.items():
            known = [ball.diameter_mm or 0.0 for ball in window.balls if ball.kind == kind]
            handle.value, handle.disabled = known[0] if len(set(known)) == 1 else 0.0, not known

    def _facts(self) -> str:
        window = self._window
        if window.capture is None:
            return ""
        if window.ball is None:
            apart = [f" The {ball.kind} ball has photographs of its own." for ball in window.balls if ball.frames]
            return f"{len(window.outlines)} circles.{''.join(apart)}"
        place = "Placed by hand" if window.outlines[window.ball].is_moved else "As found"
        given = window.capture.written.spheres[window.place_of(window.ball)].center_px
        return f"{place}. session.toml gives {'its circle' if given else 'no circle: the ball is looked for again'}."


class PhotographsPanel:
    """What each photograph is used for."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        gui.add_markdown(
            "Click a photograph in the strip below the large one; a second click shows the mean again. One that is not "
            "to be used, because somebody walked by or the flash failed: choose *not used*."
        )
        self._photograph = gui.add_dropdown("photograph", (MEAN,))
        self._role = gui.add_dropdown("used for", (*ROLES, BOARD, UNUSED), disabled=True)
        window.on_input(self._photograph, lambda name: window.choose(photograph=self._names.get(name), ball=None))
        window.on_input(self._role, self._use)

    def refresh(self) -> None:
        """Follow the window."""
        window, draft, found = self._window, self._window.capture, self._window.found
        if draft is None or found is None:
            return
        self._names = {name_of(path, draft.folder): path for path in found.photographs}
        self._photograph.options = (MEAN, *self._names)
        self._photograph.value = MEAN if window.photograph is None else name_of(window.photograph, draft.folder)
        self._role.disabled = window.photograph is None
        if window.photograph is not None:
            self._role.value = role_of(draft, window.photograph)

    def _use(self, role: str) -> None:
        window, found = self._window, self._window.found
        if window.photograph is not None and found is not None:
            try:
                window.edit(with_role(window.need(), found.small, window.photograph, role), "use")
            finally:
                window.refresh()


class KeysPanel:
    """Inputs for keys of session.toml, made from their fields: their kind and description; what is known stands above.

    keys: Path of each, as in camera.focal_mm. files: The files that a key may name.
    """

    def __init__(
        self, window: NewSessionWindow, keys: tuple[str, ...], files: Callable[[str], list[Path]] = lambda path: []
    ) -> None:
        self._window, self._files = window, files
        self._inputs = {path: self._add(path) for path in keys}

    def _add(self, path: str) -> Any:
        """Add the input of a key: a number, 0 where it is not said; a checkbox; or a choice."""
        table, key = path.split(".")
        schema, gui = TABLES[table].model_json_schema()["properties"][key], self._window.client.gui
        kind, hint = schema.get("anyOf", [schema])[0], schema["description"]
        if kind["type"] == "boolean":
            handle = gui.add_checkbox(key, False, hint=hint)
        elif kind["type"] == "number":
            handle = gui.add_number(key, 0.0, hint=hint, **MILLIMETRES)
        else:
            handle = gui.add_dropdown(key, (BY_SIZE, *kind["enum"]) if "enum" in kind else (NONE,), hint=hint)
        self._window.on_input(handle, partial(self._say, table, key))
        return handle

    def refresh(self) -> None:
        """Follow the window."""
        draft = self._window.capture
        if draft is None:
            return
        for path, handle in self._inputs.items():
            table, key = path.split(".")
            said, nothing = getattr(draft.manifest, table), type(handle.value)()
            if isinstance(handle.value, str):
                nothing = handle.options[0]
                if nothing == NONE:
                    handle.options = (NONE, *(name_of(one, draft.folder) for one in self._files(path)))
            value = getattr(said, key) if said is not None and key in said.model_fields_set else None
            handle.value = nothing if value is None else value
            if isinstance(nothing, bool):
                # How values are coded is a question of some kinds of files only.
                handle.visible = value is not None

    def _say(self, table: str, key: str, value: Any) -> None:
        said = None if value in (0.0, NONE, BY_SIZE) and value is not False else value
        self._window.edit(self._window.need().saying(table, **{key: said}), key)


class LensPanel(KeysPanel):
    """The camera."""

    def __init__(self, window: NewSessionWindow) -> None:
        super().__init__(window, tuple(f"camera.{key}" for key in ("focal_mm", "sensor_mm", "pixel_um", "crop_factor")))
        window.client.gui.add_markdown(
            "0: as the photographs say. Shots of a ChArUco board or a chessboard measure all of it."
        )


class ObjectPanel(KeysPanel):
    """Scan, mask, light file, true normals; how 8-bit values are coded."""

    def __init__(self, window: NewSessionWindow) -> None:
        keys = ("object.scan", "object.scan_unit", "object.mask", "object.normals", "lights.file", "frames.linear")
        super().__init__(window, keys, self._candidates)

    def _candidates(self, path: str) -> list[Path]:
        files = self._window.files
        return {"object.scan": files.scans, "object.mask": files.masks, "object.normals": files.normals,
                "lights.file": files.lights}[path]  # fmt: skip
