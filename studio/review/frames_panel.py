"""The panels of the photographs, which frame and what lies over it, and of the warnings, which lead to frames."""

from functools import partial
from typing import Any

from compare.report.facts import read_optional
from studio.review.folder import Review, Warned
from studio.review.photograph_picture import OVERLAYS
from studio.review.review_window import STEPS, ReviewWindow
from studio.widgets import Inputs, Layers, plain

MOST = 60
"""Warnings that are listed; more would only be scrolled through."""


class FramesPanel:
    """Frame, overlay and brightness; what the folder lacks."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._look = Inputs(window, window.show)
        self._lacks = gui.add_markdown("")
        self._frame = gui.add_slider("frame", min=1, max=2, step=1, initial_value=1, hint="Or click one in the strip")
        self._facts = gui.add_markdown("")
        with gui.add_folder("Over the photograph"):
            add = self._look.add
            add("overlay", "dropdown", "show", OVERLAYS)
            add("opacity", "slider", "opacity", min=0.0, max=1.0, step=0.05, initial_value=window.shown.opacity)
            add("brightness", "slider", "brightness", min=0.2, max=8.0, step=0.1, initial_value=1.0)
            add("marks_clipped", "checkbox", "mark clipped pixels", True)
            self._note = gui.add_markdown("")
        window.button("Show all of it", lambda: window.choose(looks=window.looks + 1, ball=None))
        window.on_input(self._frame, lambda value: window.choose(frame=int(value) - 1))

    def refresh(self) -> None:
        """Follow the window."""
        window, review = self._window, self._window.review
        frames = review.material.frames
        self._lacks.content = lacks_text(review)
        count = 0 if frames is None else len(frames)
        self._frame.max, self._frame.disabled = max(count, 2), count < 2
        self._frame.value = window.frame + 1
        self._look.show(overlay=window.shown.overlay)
        if frames is None:
            self._facts.content = ""
            return
        facts = [f"**{plain(frames.names[window.frame])}**, {frames.width} x {frames.height} px"]
        if review.clipped_share is not None:
            facts.append(f"clipped {review.clipped_share[window.frame]:.2%} (red)")
        if review.lights is not None:
            facts += [f"**{plain(flag)}**" for flag in review.lights.flags[window.frame]]
        self._facts.content = ", ".join(facts)
        self._note.content = _note(window)


def lacks_text(review: Review) -> str:
    """Return what a folder lacks and why, as Markdown; empty where it is whole."""
    waits = review.unfinished
    lines = [f"- **no {name}**: {why}" for name, why in review.missing.items() if name not in waits]
    if waits:
        steps = ", ".join(f"`{step}`" for step in dict.fromkeys(waits.values()))
        lines += [f"- **{', '.join(waits)}**: not made yet ({steps}). **Run** makes them, or says what stops it."]
    lines += [f"- **no session**: {plain(review.why_no_session)}"] if review.why_no_session else []
    return "\n".join(["**Not in this folder**", "", *lines]) if lines else ""


def _note(window: ReviewWindow) -> str:
    by = "by the registered scan" if read_optional(window.review.store, "pose.json") else "as found in the photographs"
    return {
        "nothing": "",
        "mask": f"The object, {by}.",
        "scan, shaded": "The registered scan in one colour under this frame's light, without cast shadows. Where it "
        "lies right, shading and outline stay in place as the opacity changes.",
        "scan, normals": "Red: right, green: up, blue: toward the viewer.",
    }[window.shown.overlay]


class WarningsPanel:
    """What the steps of the open tab warned of, under Verdict all; a press goes to the frame or the ball."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._layers = window, Layers()
        self._folder = window.client.gui.add_folder("Warnings")

    def refresh(self) -> None:
        """List the warnings of the folder as it was read."""
        self._layers.draw("warnings", (self._window.reading, self._window.tab), self._list)

    def _list(self) -> list[Any]:
        window, gui, handles = self._window, self._window.client.gui, []
        found = warnings_of(window, window.tab)
        self._folder.label, self._folder.visible = f"Warnings ({len(found)})", bool(found)
        with self._folder:
            for one in found[:MOST]:
                handles += self._add(one)
            if len(found) > MOST:
                handles.append(gui.add_markdown(f"{len(found) - MOST} more are in report.html."))
        return handles

    def _add(self, one: Warned) -> list[Any]:
        window, gui, frames = self._window, self._window.client.gui, self._window.review.material.frames
        handles = [gui.add_markdown(f"**{plain(one.step)}**: {plain(one.text)}")]
        for frame in one.frames[:4]:
            assert frames is not None
            handles.append(window.button(f"Show {frames.names[frame]}", partial(self._show_frame, frame)))
        if one.ball is not None:
            handles.append(window.button(f"Show ball {one.ball + 1}", partial(window.choose_ball, one.ball)))
        return handles

    def _show_frame(self, frame: int) -> None:
        self._window.frame = frame
        self._window.open_tab("Capture")


def warnings_of(window: ReviewWindow, tab: str) -> list[Warned]:
    """Return the warnings that stand on a tab: each on the first one of its step; all of them under Verdict."""
    warnings = window.review.warnings
    if tab == "Verdict":
        return list(warnings)
    return [one for one in warnings if next((name for name in STEPS if STEPS[name] == one.step), "") == tab]


def marks_of(window: ReviewWindow) -> dict[str, str]:
    """Return what stands behind the names of the tabs: a tick where the step is done, and how many warnings it has."""
    marks = {}
    for tab, step in STEPS.items():
        count = 0 if tab == "Verdict" else len(warnings_of(window, tab))
        marks[tab] = f"⚠{count}" if count else "✓" if step in window.review.done else ""
    return marks
