"""The panels in which a capture is put right: balls, photographs, camera, object."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from scene.length_units import UNITS_MM
from scene.spheres import KINDS, Kind
from studio.new_session.edited_capture import UNUSED
from studio.new_session.found_capture import ROLES
from studio.new_session.new_session_window import NewSessionWindow
from studio.photograph.outline_inputs import OutlineInputs
from studio.widgets import Inputs, code, plain

MEAN = "(mean of the flash frames)"
NONE = "(none)"
BY_SIZE = "(by the object's size)"
MILLIMETRES: dict[str, Any] = {"min": 0.0, "max": 10_000.0, "step": 0.01}


def name_of(path: Path, folder: Path) -> str:
    """Return what a file is called in the lists: as seen from the session's folder."""
    return os.path.relpath(path, folder).replace(os.sep, "/")


class DiametersPanel:
    """The balls: their diameters, and which circles are balls."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        gui.add_markdown("Is every ball circled, and nothing else? Give their diameters; 0: not known.")
        self._diameters = Inputs(window, self._say)
        for kind in KINDS:
            self._diameters.add(kind, "number", f"{kind} balls, mm", 0.0, hint="Diameter", **MILLIMETRES)
        self._outline = OutlineInputs(window, self._facts, window.back_to_found, self._add_own)

    def _add_own(self) -> None:
        hint = "Where it is not that of the others of its kind; 0: as they are"
        self._own = self._window.client.gui.add_number("diameter, mm", 0.0, hint=hint, **MILLIMETRES)
        self._window.on_input(self._own, self._say_own)

    def refresh(self) -> None:
        """Follow the window."""
        window, capture = self._window, self._window.capture
        self._outline.refresh()
        ball = None if window.ball is None else window.outlines[window.ball]
        self._own.disabled = ball is None
        known = capture.diameters_mm if capture else {}
        self._own.value = (ball and (ball.diameter_mm or known.get(ball.kind))) or 0.0
        self._diameters.show(**{kind: known.get(kind) or 0.0 for kind in KINDS})

    def _say(self, **diameters: float) -> None:
        capture = self._window.need()
        known = {**capture.diameters_mm, **{kind: value or None for kind, value in diameters.items()}}
        self._window.edit(replace(capture, diameters_mm=known), "diameter")

    def _say_own(self, value: float) -> None:
        window, index = self._window, self._window.ball
        if index is not None:
            ball = window.outlines[index]
            is_own = value not in (0.0, window.need().diameters_mm.get(ball.kind))
            ball = replace(ball, diameter_mm=float(value) if is_own else None)
            window.correct((*window.outlines[:index], ball, *window.outlines[index + 1 :]), "diameter")

    def _facts(self) -> str:
        window = self._window
        if window.capture is None:
            return ""
        if window.ball is None:
            apart = [ball for ball in window.draft.balls if ball.files]
            lines = [f"{len(window.outlines)} circles."]
            lines += [f"The {ball.kind} ball has {len(ball.files)} photographs of its own." for ball in apart]
            return " ".join(lines)
        ball = window.outlines[window.ball]
        place = "Placed by hand" if ball.is_moved else "As found"
        given = "its circle" if self._has_circle(ball.kind) else "no circle: the ball is looked for again"
        return f"{place}. session.toml gives {given}."

    def _has_circle(self, kind: Kind) -> bool:
        window, index = self._window, self._window.ball
        assert index is not None
        center = window.outlines[index].center_px
        return any(ball.by_hand for ball in window.draft.balls if ball.kind == kind and ball.center_px == center)


class PhotographsPanel:
    """What each photograph is used for."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        gui.add_markdown(
            "Click a photograph in the strip below the large one; a second click shows the mean again. One that is not "
            "to be used, because somebody walked by or the flash failed: choose *not used*."
        )
        self._photograph = gui.add_dropdown("photograph", (MEAN,))
        self._role = gui.add_dropdown("used for", (*ROLES, UNUSED), disabled=True)
        self._counts = gui.add_markdown("")
        window.on_input(self._photograph, self._choose)
        window.on_input(self._role, self._use)

    def refresh(self) -> None:
        """Follow the window."""
        window, capture = self._window, self._window.capture
        if capture is None:
            return
        self._names = {name_of(path, window.files.folder): path for path in capture.found.photographs}
        shown = next((name for name, path in self._names.items() if path == window.photograph), MEAN)
        self._photograph.options = (MEAN, *self._names)
        self._photograph.value = shown
        self._role.disabled = window.photograph is None
        if window.photograph is not None:
            self._role.value = capture.role_of(window.photograph)
        lines = ["| | | |", "|---|---|---|"]
        for role in (*ROLES, UNUSED):
            own = [name for name, path in self._names.items() if capture.role_of(path) == role]
            if own:
                lines.append(f"| {role} | {len(own)} | {plain(own[0])}{' ...' if len(own) > 1 else ''} |")
        self._counts.content = "\n".join(lines)

    def _choose(self, name: str) -> None:
        self._window.choose(photograph=self._names.get(name), ball=None)

    def _use(self, role: str) -> None:
        window = self._window
        if window.photograph is not None:
            try:
                window.edit(window.need().with_role(window.photograph, role), "use")
            finally:
                window.refresh()


class LensPanel:
    """The camera."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        self._told = gui.add_markdown("")
        self._lens = Inputs(window, self._say)
        self._lens.add("focal_mm", "number", "focal length, mm", 0.0, hint="As engraved on the lens", **MILLIMETRES)
        self._lens.add("sensor_mm", "number", "sensor, mm", 0.0, hint="Longer side: 36 for full frame", **MILLIMETRES)
        gui.add_markdown("0: as the photographs say. Shots of a ChArUco board or a chessboard measure all of it.")

    def refresh(self) -> None:
        """Follow the window."""
        capture = self._window.capture
        if capture is None:
            return
        self._told.content = f"**How it is known:** {plain(capture.draft.camera_told)}"
        for name, handle in self._lens.items():
            handle.value, handle.disabled = getattr(capture.draft.lens, name) or 0.0, capture.draft.board is not None

    def _say(self, **lens: float) -> None:
        self._window.edit(
            self._window.need().with_lens(**{name: value or None for name, value in lens.items()}), "lens"
        )


class ObjectPanel:
    """Scan, mask, light file, true normals; how 8-bit values are coded."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        self._files, self._paths = Inputs(window, self._take), dict[str, dict[str, Path]]()
        self._files.add("scan", "dropdown", "scan", (NONE,))
        self._unit = gui.add_dropdown("its unit", (BY_SIZE, *UNITS_MM))
        self._told = gui.add_markdown("")
        for name, label in (("mask", "mask"), ("lights", "light file"), ("normals", "true normals")):
            self._files.add(name, "dropdown", label, (NONE,))
        self._linear = gui.add_checkbox("values are proportional to light", False, visible=False)
        window.on_input(self._unit, self._measure)
        window.on_input(self._linear, lambda value: window.edit(window.need().with_draft(linear=value)))

    def refresh(self) -> None:
        """Follow the window."""
        window, capture = self._window, self._window.capture
        if capture is None:
            return
        files, draft = window.files, window.draft
        for name, paths in (("scan", files.scans), ("mask", files.masks), ("lights", files.lights),
                            ("normals", files.normals)):  # fmt: skip
            self._paths[name] = {name_of(path, files.folder): path for path in paths}
            self._files[name].options = (NONE, *self._paths[name])
            chosen = getattr(draft, name)
            self._files[name].value = next((one for one, path in self._paths[name].items() if path == chosen), NONE)
        self._unit.value, self._unit.disabled = capture.unit or BY_SIZE, draft.scan is None
        told = f"{draft.scan_told}; unit {code(draft.unit)}" + (f": {draft.unit_told}" if draft.unit_told else "")
        self._told.content = told if draft.scan else ""
        self._linear.visible, self._linear.value = draft.linear is not None, bool(draft.linear)

    def _take(self, **chosen: str) -> None:
        ((name, value),) = chosen.items()
        path, capture = self._paths[name].get(value), self._window.need()
        self._window.edit(capture.with_scan(path) if name == "scan" else capture.with_draft(**{name: path}), name)

    def _measure(self, unit: Any) -> None:
        self._window.edit(replace(self._window.need(), unit=None if unit == BY_SIZE else unit), "unit")
