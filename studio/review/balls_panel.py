"""The panel of the balls: what was found, corrected by hand, calibrated again, and kept for the command line."""

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from scene.errors import SceneError
from studio.photograph.outline_inputs import OutlineInputs
from studio.review.ball_marks import magnification
from studio.review.corrected_session import write_amended
from studio.review.corrections import outlines_of, specs_of
from studio.review.recalibration import Change, calibrate_again, change_of, residuals_px, rms_px
from studio.review.review_window import ReviewWindow
from studio.widgets import plain


class BallsPanel:
    """Which ball, where its outline is, and what calibrating again changes."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._outline = OutlineInputs(
            window, lambda: facts_text(window), lambda: window.correct(outlines_of(window.review))
        )
        with gui.add_folder("Calibrate again"):
            self._again = window.button("Calibrate again", self._start, color="green")
            self._bar = gui.add_progress_bar(0, visible=False)
            self._changes = gui.add_markdown(
                "Nothing is written: what would change is shown here, and the outlines as they are found again (blue)."
            )
            self._keep = window.button("Keep these balls", self._keep_balls, disabled=True)

    def refresh(self) -> None:
        """Follow the window."""
        self._outline.refresh()
        self._keep.disabled = not self._window.refitted

    def _start(self) -> None:
        if self._bar.visible:
            raise SceneError("the calibration is at work. Wait for it.")
        window, review, outlines = self._window, self._window.review, self._window.outlines
        self._again.disabled = self._bar.visible = True
        self._bar.value, self._changes.content = 0, "Calibrating ..."

        def told(done: int, total: int) -> None:
            window.post(lambda: setattr(self._bar, "value", 100 * done / max(total, 1)))

        def show(found: Future[Change]) -> None:
            self._again.disabled = self._bar.visible = False
            self._changes.content, frames = "Not calibrated.", window.review.material.frames
            change = found.result()  # What was at fault is told by the window.
            self._changes.content = change_text(change, () if frames is None else frames.names)
            if review is window.review and outlines is window.outlines:
                window.choose(refitted=change.spheres)

        pool = ThreadPoolExecutor(1, thread_name_prefix="calibrate")
        work = pool.submit(lambda: change_of(review, calibrate_again(review, outlines, progress=told)))
        work.add_done_callback(lambda found: window.post(lambda: show(found)))
        pool.shutdown(wait=False)

    def _keep_balls(self) -> None:
        window = self._window
        session, camera = window.review.need("session", "camera")
        folder = write_amended(window.review, spheres=specs_of(session, window.outlines, camera))
        self._changes.content += f"\n\n{window.kept_text(folder, 'use them')}"
        window.notify("Kept", f"{window.workspace.name(folder)}/session.toml")


def facts_text(window: ReviewWindow) -> str:
    """Return what is known of the chosen ball, or of all, as Markdown."""
    review = window.review
    if window.ball is None:
        if not window.outlines:
            return review.missing.get("balls", "There is no ball here.")
        moved_ones = [str(index + 1) for index, ball in enumerate(window.outlines) if ball.is_moved]
        return f"{len(window.outlines)} balls." + (
            f" Corrected by hand: {', '.join(moved_ones)}." if moved_ones else ""
        )
    ball = window.outlines[window.ball]
    lines = ["corrected by hand, not calibrated with yet" if ball.is_moved else "as found"]
    if window.ball < len(review.spheres) and len(window.outlines) == len(review.spheres):
        sphere = review.spheres[window.ball]
        lines[0] += f"; fitted: centre ± {sphere.sigma_px:.2f} px, outline seen {sphere.score:.0%}"
        lines += _highlight_lines(window, window.ball)
    if ball.diameter_mm:
        lines.append(f"diameter {ball.diameter_mm:g} mm")
    return "\n".join(f"- {line}" for line in lines)


def _highlight_lines(window: ReviewWindow, index: int) -> list[str]:
    review = window.review
    seen, lights, camera = review.highlights_px, review.lights, review.material.camera
    if seen is None or lights is None or camera is None or review.spheres[index].kind != "chrome":
        return []
    sphere = review.spheres[index]
    misses = residuals_px(camera, sphere, lights, seen[index])
    count, rms = int(np.isfinite(misses[:, 0]).sum()), rms_px(misses)
    if not count:
        return ["no highlight was seen or believed on it"]
    here = misses[window.frame]
    lines = [
        f"highlight (yellow) in {count} of {len(misses)} frames, {rms:.2f} px rms beside where the lights put it",
        f"misses are drawn {magnification(rms, sphere.radius_px):g} times as long (pink)",
    ]
    if np.isfinite(here).all():
        lines.append(f"in this frame: {here[0]:+.2f} px right, {here[1]:+.2f} px down")
    else:
        lines.append("in this frame: not seen, or not believed")
    return lines


def change_text(change: Change, names: Any) -> str:
    """Return what calibrating again changes, as Markdown."""
    lines = []
    if change.turned_deg is None:
        lines.append("There were no lights before; now there are.")
    else:
        worst = int(np.argmax(change.turned_deg))
        lines.append(
            f"Lights turn by **{np.median(change.turned_deg):.3f}°** (median), {change.turned_deg[worst]:.3f}° at most "
            f"({plain(names[worst])})."
        )
    rows = (("highlights beside their place, px rms", change.rms_px, ".3f"),
            ("sigma of the directions, median, °", change.sigma_deg, ".3f"))  # fmt: skip
    lines += ["", "| | before | after |", "|---|---|---|"]
    lines += [f"| {what} | {_shown(before, form)} | {_shown(after, form)} |" for what, (before, after), form in rows]
    lines += ["", "| ball | centre, px | radius, px | outline seen |", "|---|---|---|---|"]
    for index, ball in enumerate(change.spheres):
        u, v = ball.center_px
        lines.append(f"| {index + 1} {ball.kind} | {u:.2f}, {v:.2f} | {ball.radius_px:.2f} | {ball.score:.0%} |")
    lines += [f"\n**Warning:** {plain(text)}" for text in change.warnings]
    return "\n".join(lines)


def _shown(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "–"
