"""The panel of the balls: what was found, corrected by hand, calibrated again, and kept for the command line."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from scene.errors import SceneError
from studio.markdown import code, plain
from studio.review.ball_marks import magnification
from studio.review.calibrated_again import Change, calibrate_again, change_of
from studio.review.corrected_session import write_amended
from studio.review.corrections import added, moved, outlines_of, removed, resized, specs_of
from studio.review.mirror import residuals_px, rms_px
from studio.review.review_desk import ReviewDesk

ALL = "(all)"


class BallsPanel:
    """Which ball, where its outline is, and what calibrating again changes."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._worker: ThreadPoolExecutor | None = None
        self._ball = gui.add_dropdown("ball", (ALL,), hint="Or click one in the photograph")
        self._facts = gui.add_markdown("")
        with gui.add_folder("Correct the outline"):
            gui.add_markdown("Drag the orange knobs: the middle moves, the one on the rim resizes. Or by numbers:")
            self._center = gui.add_vector2("centre, px", (0.0, 0.0), step=0.1)
            self._radius = gui.add_number("radius, px", 1.0, min=0.1, step=0.1)
            desk.on_input(self._center, self._move)
            desk.on_input(self._radius, self._resize)
            self._kind = gui.add_dropdown("kind of a new ball", ("chrome", "white"))
            desk.on_click(gui.add_button("Add a ball"), self._add)
            self._remove = desk.on_click(gui.add_button("Remove this ball"), self._take_out)
            desk.on_click(gui.add_button("Back to the balls as found"), lambda: desk.correct(outlines_of(desk.review)))
        with gui.add_folder("Calibrate again"):
            self._again = desk.on_click(gui.add_button("Calibrate again", color="green"), self._start)
            self._bar = gui.add_progress_bar(0, visible=False)
            self._changes = gui.add_markdown(
                "Nothing is written: what would change is shown here, and the outlines as they are found again (blue)."
            )
            self._keep = desk.on_click(gui.add_button("Keep these balls", disabled=True), self._keep_balls)
        desk.on_input(self._ball, self._choose)
        desk.on_close(self._close)

    def refresh(self) -> None:
        """Follow the desk."""
        desk = self._desk
        names = tuple(f"{index + 1}: {ball.kind}" for index, ball in enumerate(desk.outlines))
        self._ball.options = (ALL, *names)
        self._ball.value = ALL if desk.ball is None else names[desk.ball]
        for handle in (self._center, self._radius, self._remove):
            handle.disabled = desk.ball is None
        self._facts.content = facts_text(desk)
        self._keep.disabled = not desk.refitted
        if desk.ball is not None:
            ball = desk.outlines[desk.ball]
            self._center.value = tuple(round(value, 2) for value in ball.center_px)
            self._radius.value = round(ball.radius_px, 2)

    def _choose(self, value: str) -> None:
        if value == ALL:
            self._desk.leave_ball()
        else:
            self._desk.choose(ball=int(value.split(":")[0]) - 1, view="Photograph")

    def _move(self, value: tuple[float, float]) -> None:
        desk, camera = self._desk, self._desk.review.material.camera
        if desk.ball is not None and camera is not None:
            desk.correct(moved(desk.outlines, desk.ball, value, camera))

    def _resize(self, value: float) -> None:
        desk, camera = self._desk, self._desk.review.material.camera
        if desk.ball is not None and camera is not None:
            desk.correct(resized(desk.outlines, desk.ball, value, camera))

    def _add(self) -> None:
        desk, camera = self._desk, self._desk.review.material.camera
        if camera is None:
            raise SceneError(f"camera: {desk.review.missing['camera']}")
        desk.outlines, desk.refitted = added(desk.outlines, self._kind.value, camera), ()
        desk.choose(ball=len(desk.outlines) - 1, view="Photograph")

    def _take_out(self) -> None:
        desk = self._desk
        if desk.ball is not None:
            desk.outlines, desk.refitted, desk.ball = removed(desk.outlines, desk.ball), (), None
            desk.refresh()

    def _start(self) -> None:
        if self._worker is not None:
            raise SceneError("the calibration is at work. Wait for it.")
        desk = self._desk
        review, outlines = desk.review, desk.outlines
        self._again.disabled, self._bar.visible, self._bar.value = True, True, 0
        self._changes.content = "Calibrating ..."
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="calibrate")

        def told(done: int, total: int) -> None:
            desk.post(lambda: setattr(self._bar, "value", 100 * done / max(total, 1)))

        def work() -> None:
            try:
                change = change_of(review, calibrate_again(review, outlines, progress=told))
                desk.post(lambda: self._show(change, review is desk.review and outlines is desk.outlines))
            except Exception as error:
                fault = error
                desk.post(lambda: self._fail(fault))

        self._worker.submit(work)

    def _idle(self) -> None:
        if self._worker is not None:
            self._worker.shutdown(wait=False)
        self._worker = None
        self._again.disabled, self._bar.visible = False, False

    def _show(self, change: Change, is_current: bool) -> None:
        self._idle()
        names = () if self._desk.review.material.frames is None else self._desk.review.material.frames.names
        self._changes.content = change_text(change, names)
        if is_current:
            self._desk.refitted = change.spheres
            self._desk.refresh()

    def _fail(self, fault: Exception) -> None:
        self._idle()
        self._changes.content = "Not calibrated."
        raise fault

    def _keep_balls(self) -> None:
        desk = self._desk
        session, camera = desk.review.session, desk.review.material.camera
        if session is None or camera is None:
            raise SceneError(desk.review.why_no_session or f"camera: {desk.review.missing['camera']}")
        folder = write_amended(desk.review, spheres=specs_of(session, desk.outlines, camera))
        name, out = desk.workspace.name(folder), desk.workspace.name(desk.review.store.folder)
        self._changes.content += (
            f"\n\nKept in {code(f'{name}/session.toml')}; your own session.toml is as it was. To use them: **Run**, or "
            f"{code(f'rgbn process {name} --out {out}')}."
        )
        desk.tell("Kept", f"{name}/session.toml")

    def _close(self) -> None:
        if self._worker is not None:
            self._worker.shutdown(wait=False, cancel_futures=True)


def facts_text(desk: ReviewDesk) -> str:
    """Return what is known of the chosen ball, or of all, as Markdown."""
    review = desk.review
    if desk.ball is None:
        if not desk.outlines:
            return review.missing.get("balls", "There is no ball here.")
        moved_ones = [str(index + 1) for index, ball in enumerate(desk.outlines) if ball.is_moved]
        return f"{len(desk.outlines)} balls." + (f" Corrected by hand: {', '.join(moved_ones)}." if moved_ones else "")
    ball = desk.outlines[desk.ball]
    lines = ["corrected by hand, not calibrated with yet" if ball.is_moved else "as found"]
    if desk.ball < len(review.spheres) and len(desk.outlines) == len(review.spheres):
        sphere = review.spheres[desk.ball]
        lines[0] += f"; fitted: centre ± {sphere.sigma_px:.2f} px, outline seen {sphere.score:.0%}"
        lines += _highlight_lines(desk, desk.ball)
    if ball.diameter_mm:
        lines.append(f"diameter {ball.diameter_mm:g} mm")
    return "\n".join(f"- {line}" for line in lines)


def _highlight_lines(desk: ReviewDesk, index: int) -> list[str]:
    review = desk.review
    seen, lights, camera = review.highlights_px, review.lights, review.material.camera
    if seen is None or lights is None or camera is None or review.spheres[index].kind != "chrome":
        return []
    sphere = review.spheres[index]
    misses = residuals_px(camera, sphere, lights, seen[index])
    count, rms = int(np.isfinite(misses[:, 0]).sum()), rms_px(misses)
    if not count:
        return ["no highlight was seen or believed on it"]
    here = misses[desk.frame]
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
