"""The panel of the photographs: which frame, from where it is looked at, what lies over it; what the folder lacks."""

from compare.report.facts import read_optional
from studio.markdown import plain
from studio.review.photograph_view import OVERLAYS
from studio.review.review_desk import VIEWS, ReviewDesk


class FramesPanel:
    """Frame, view, overlay and brightness."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._lacks = gui.add_markdown("")
        self._view = gui.add_button_group("view", VIEWS)
        self._view.on_click(self._on_view)
        self._frame = gui.add_slider("frame", min=1, max=2, step=1, initial_value=1, hint="Or click one in the strip")
        self._facts = gui.add_markdown("")
        with gui.add_folder("Over the photograph"):
            self._overlay = gui.add_dropdown("show", OVERLAYS)
            self._opacity = gui.add_slider("opacity", min=0.0, max=1.0, step=0.05, initial_value=desk.look.opacity)
            self._gain = gui.add_slider("brightness", min=0.2, max=8.0, step=0.1, initial_value=1.0)
            self._clipped = gui.add_checkbox("mark clipped pixels", True)
            self._note = gui.add_markdown("")
        desk.on_input(self._frame, lambda value: desk.choose(frame=int(value) - 1))
        desk.on_input(self._overlay, lambda value: desk.show(overlay=value))
        desk.on_input(self._opacity, lambda value: desk.show(opacity=float(value)))
        desk.on_input(self._gain, lambda value: desk.show(brightness=float(value)))
        desk.on_input(self._clipped, lambda value: desk.show(marks_clipped=bool(value)))

    async def _on_view(self, event: object) -> None:
        desk = self._desk
        # A second press on the view that is shown looks at all of it again.
        value = self._view.value
        desk.post(lambda: desk.choose(view=value) if desk.view != value else desk.look_again())

    def refresh(self) -> None:
        """Follow the desk."""
        desk, review = self._desk, self._desk.review
        frames = review.material.frames
        self._lacks.content = lacks_text(review.missing, review.why_no_session)
        count = 0 if frames is None else len(frames)
        self._frame.max, self._frame.disabled = max(count, 2), count < 2
        self._frame.value = desk.frame + 1
        self._overlay.value = desk.look.overlay
        if frames is None:
            self._facts.content = ""
            return
        facts = [f"**{plain(frames.names[desk.frame])}**, {frames.width} x {frames.height} px"]
        if review.clipped_share is not None:
            facts.append(f"clipped {review.clipped_share[desk.frame]:.2%} (red)")
        if review.lights is not None:
            facts += [f"**{plain(flag)}**" for flag in review.lights.flags[desk.frame]]
        self._facts.content = ", ".join(facts)
        self._note.content = _note(desk)


def lacks_text(missing: dict[str, str], why_no_session: str) -> str:
    """Return what a folder lacks and why, as Markdown; empty where it is whole."""
    lines = [f"- **no {name}**: {why}" for name, why in missing.items()]
    lines += [f"- **no session**: {plain(why_no_session)}"] if why_no_session else []
    return "\n".join(["**Not in this folder**", "", *lines]) if lines else ""


def _note(desk: ReviewDesk) -> str:
    if desk.look.overlay == "scan, shaded":
        return (
            "The registered scan in one colour under this frame's light, without cast shadows. Where it lies right, "
            "shading and outline stay in place as the opacity changes."
        )
    if desk.look.overlay == "scan, normals":
        return "Red: right, green: up, blue: toward the viewer."
    if desk.look.overlay == "mask":
        pose = read_optional(desk.review.store, "pose.json")
        return "The object, " + ("by the registered scan." if pose else "as found in the photographs.")
    return ""
