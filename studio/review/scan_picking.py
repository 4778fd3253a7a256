"""The tab of the scan: its pose, and pairs of pixels and points where it was not found without help."""

from typing import Any

import numpy as np

from compare.report.facts import read_optional
from studio.photograph.plane import ROOT, Plane, add_lines, add_numbered
from studio.review.corrections import Picks, pose_of
from studio.review.review_window import ReviewWindow
from studio.widgets import Layers, Panel, Row, plain, text

PICKED, OUTLINE = (60, 170, 255), (255, 0, 190)
HOW = (
    "Where the pose is refused or wrong: click a point in the photograph, then the same point on the scan. Four pairs "
    "at least, better six, spread over the object."
)


def _pose_facts(window: ReviewWindow) -> str:
    review = window.review
    if "scan" in review.missing:
        return f"**Not registered**: {review.missing['scan']}"
    pose = read_optional(review.store, "pose.json")
    if not isinstance(pose, dict):
        return "The ground truth was given, not registered from a scan."
    return (
        f"Registered: outline to {pose['residual_px']:.2f} px rms, place ± {pose['sigma_mm']:.2f} mm, turn ± "
        f"{pose['sigma_deg']:.2f}°. It lies over the photograph, shaded: **Capture** lays on other things."
    )


class ScanPanel(Panel):
    """Where the scan stands, and picks; what is picked is drawn on the photograph."""

    def __init__(self, window: ReviewWindow) -> None:
        self._strokes, self._told = np.zeros((0, 2, 2)), ""
        self._layers = Layers()
        super().__init__(window, (
            text(_pose_facts),
            Row("folder", "Pick points", rows=(
                text(lambda window: HOW),
                Row("button", "Start picking", self._switch, lambda window: self._toggle()),
                text(self._status),
                Row("button", "Pose from the picks", lambda window: {"disabled": not window.picks.pairs},
                    lambda window: self._pose()),
            )),
        ))  # fmt: skip

    def refresh(self) -> None:
        """Follow the window."""
        super().refresh()
        window, picks, plane = self._window, self._window.picks, self._window.plane
        if window.tab != "Scan" or plane is None:
            self._layers.keep_only(set())
            return
        self._layers.draw("pixels", (window.reading, picks.pixels), lambda: self._add_pixels(plane))
        key = (window.reading, self._strokes.tobytes())
        self._layers.draw("outline", key, lambda: self._add_outline(plane))

    @property
    def _is_on(self) -> bool:
        return self._window.on_photograph == self._take_pixel

    def _status(self, window: ReviewWindow) -> str:
        waiting = len(window.picks.pixels) > len(window.picks.points)
        now = " Now the same point on the scan." if waiting else self._told
        return f"{window.picks.pairs} pairs.{now}"

    def _switch(self, window: ReviewWindow) -> dict[str, Any]:
        return {"label": "Stop picking" if self._is_on else "Start picking"}

    def _toggle(self) -> None:
        window = self._window
        if self._is_on:
            window.on_photograph = window.on_scan = None
        else:
            _ = window.review.scan_mesh  # What is at fault with it is told before anything is picked.
            window.on_photograph, window.on_scan = self._take_pixel, self._take_point
        window.choose(is_scan_asked=False, ball=None)

    def _take_pixel(self, pixel: tuple[float, float]) -> None:
        picks = self._window.picks.with_pixel(pixel)
        self._take("a pixel", picks, len(picks.pixels) > len(picks.points))

    def _take_point(self, point: Any) -> None:
        self._take("a point of the scan", self._window.picks.with_point(point), False)

    def _take(self, label: str, picks: Picks, is_scan_asked: bool) -> None:
        self._window.is_scan_asked, self._told = is_scan_asked, ""
        self._window.alter(label, picks=picks)

    def _pose(self) -> None:
        from align.pose.scan_outline import outline_strokes

        window, review, picks = self._window, self._window.review, self._window.picks
        found = window.picked_pose = pose_of(review, picks, review.scan_mesh)
        self._strokes = outline_strokes(review.scan_mesh, found.pose, *review.need("camera"))
        told = "".join(f"\n\n**Warning:** {plain(text)}" for text in found.warnings)
        self._told = (
            f" They lie {found.residual_px:.1f} px rms apart at the pose that they give. Its outline is drawn in pink: "
            f"a start, which the step `align` refines.{told}"
        )
        window.choose(is_scan_asked=False)

    def _add_pixels(self, plane: Plane) -> list[Any]:
        places = [tuple(plane.place(pixel, lift=0.003)) for pixel in self._window.picks.pixels]
        return add_numbered(self._window.client.scene, f"{ROOT}/pick", places, 0.04, PICKED)

    def _add_outline(self, plane: Plane) -> list[Any]:
        if not len(self._strokes):
            return []
        return [add_lines(self._window.client.scene, "picked", plane.place(self._strokes, lift=0.002), OUTLINE, 2.0)]
