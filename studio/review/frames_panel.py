"""The panels of the photographs, which frame and what lies over it, and of the warnings, which lead to frames."""

from typing import Any

from compare.report.facts import read_optional
from studio.review.folder import Warned
from studio.review.photograph_picture import OVERLAYS
from studio.review.review_window import VIEWS, ReviewWindow
from studio.widgets import Inputs, Layers, plain

MOST = 60
"""Warnings that are listed; more would only be scrolled through."""


class FramesPanel:
    """Frame, view, overlay and brightness; what the folder lacks."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._look = Inputs(window, window.show)
        self._lacks = gui.add_markdown("")
        views = gui.add_button_group("view", VIEWS)
        window.on(views.on_click, self._see, lambda event: (event.target.value,))
        self._frame = gui.add_slider("frame", min=1, max=2, step=1, initial_value=1, hint="Or click one in the strip")
        self._facts = gui.add_markdown("")
        with gui.add_folder("Over the photograph"):
            add = self._look.add
            add("overlay", "dropdown", "show", OVERLAYS)
            add("opacity", "slider", "opacity", min=0.0, max=1.0, step=0.05, initial_value=window.shown.opacity)
            add("brightness", "slider", "brightness", min=0.2, max=8.0, step=0.1, initial_value=1.0)
            add("marks_clipped", "checkbox", "mark clipped pixels", True)
            self._note = gui.add_markdown("")
        window.on_input(self._frame, lambda value: window.choose(frame=int(value) - 1))

    def _see(self, view: Any) -> None:
        """Look at a view; a second press on the one that is shown looks at all of it again."""
        window = self._window
        window.choose(**{"view": view} if window.view != view else {"looks": window.looks + 1, "ball": None})

    def refresh(self) -> None:
        """Follow the window."""
        window, review = self._window, self._window.review
        frames = review.material.frames
        self._lacks.content = lacks_text(review.missing, review.why_no_session)
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


def lacks_text(missing: dict[str, str], why_no_session: str) -> str:
    """Return what a folder lacks and why, as Markdown; empty where it is whole."""
    lines = [f"- **no {name}**: {why}" for name, why in missing.items()]
    lines += [f"- **no session**: {plain(why_no_session)}"] if why_no_session else []
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
    """All warnings of all steps; a press goes to the frame or the ball that one is about."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._layers = window, Layers()
        self._folder = window.client.gui.add_folder("Warnings")

    def refresh(self) -> None:
        """List the warnings of the folder as it was read."""
        self._layers.draw("warnings", self._window.reading, self._list)

    def _list(self) -> list[Any]:
        review, gui, handles = self._window.review, self._window.client.gui, []
        self._folder.label = f"Warnings ({len(review.warnings)})"
        with self._folder:
            if not review.warnings:
                ended = ", ".join(sorted(review.done)) or "none has ended"
                handles.append(gui.add_markdown(f"No step warned of anything. Steps: {ended}."))
            for one in review.warnings[:MOST]:
                handles += self._add(one)
            if len(review.warnings) > MOST:
                handles.append(gui.add_markdown(f"{len(review.warnings) - MOST} more are in report.html."))
        return handles

    def _add(self, one: Warned) -> list[Any]:
        gui, frames = self._window.client.gui, self._window.review.material.frames
        targets = [(f"Show {frames.names[frame]}", {"frame": frame}) for frame in one.frames[:4]] if frames else []
        ball = {} if one.ball is None else {"ball": one.ball}
        if ball and not targets:
            targets = [(f"Show ball {ball['ball'] + 1}", ball)]

        def button(label: str, there: dict[str, int]) -> Any:
            return self._window.button(label, lambda: self._window.choose(view="Photograph", **ball | there))

        return [gui.add_markdown(f"**{plain(one.step)}**: {plain(one.text)}"), *(button(*pair) for pair in targets)]
