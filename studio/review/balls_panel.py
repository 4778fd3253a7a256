"""The panel of the balls: what was found, and corrected by hand."""

import numpy as np

from studio.photograph.outline_inputs import OutlineInputs
from studio.review.ball_marks import magnification, residuals_px, rms_px
from studio.review.corrected_session import outlines_of
from studio.review.review_window import ReviewWindow


class BallsPanel:
    """Which ball, and where its outline is; what is corrected is kept by a button, or by the next run."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window = window
        found = lambda: window.correct(outlines_of(window.review), "balls as found")  # noqa: E731
        self._outline = OutlineInputs(window, lambda: facts_text(window), found)
        self._keep = window.button("Keep", window.write_kept)

    def refresh(self) -> None:
        """Follow the window."""
        self._outline.refresh()
        self._keep.disabled = self._window.is_kept_so


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
