"""The panel of the scan: its pose, and pairs of pixels and points where it was not found without help."""

from typing import Any

import numpy as np

from compare.report.facts import read_optional
from studio.photograph.plane import ROOT, Plane, add_lines, add_numbered
from studio.review.review_window import ReviewWindow, View
from studio.review.scan_picks import Picks, pose_of
from studio.widgets import Layers, plain

FEWEST = 4
PICKED, OUTLINE = (60, 170, 255), (255, 0, 190)


class ScanPanel:
    """Where the scan stands, and picks."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self.found, self._strokes = None, np.zeros((0, 2, 2))
        self._layers = Layers()
        self._facts = gui.add_markdown("")
        with gui.add_folder("Pick points"):
            gui.add_markdown(
                "Where the pose is refused or wrong: click a point in the photograph, then the same point on the scan. "
                "Four pairs at least, better six, spread over the object."
            )
            self._go = window.button("Start picking", self._toggle)
            self._status = gui.add_markdown("")
            window.button("Pose from the picks", self._pose)
            self._keep = window.button("Keep", window.write_kept, disabled=True)

    def refresh(self) -> None:
        """Follow the window."""
        window, picks, plane = self._window, self._window.picks, self._window.plane
        self._facts.content = self._text()
        self._go.label = "Stop picking" if self._is_picking else "Start picking"
        if plane is not None and window.tab != "Scan":
            self._layers.keep_only(set())
        elif plane is not None:
            self._layers.draw("pixels", (window.reading, picks.pixels), lambda: self._add_pixels(plane))
            key = (window.reading, self._strokes.tobytes())
            self._layers.draw("outline", key, lambda: self._add_outline(plane))
        waiting = len(picks.pixels) > len(picks.points)
        self._status.content = f"{picks.pairs} pairs." + (" Now the same point on the scan." if waiting else "")
        self._keep.disabled = picks.pairs < FEWEST or window.is_kept_so

    @property
    def _is_picking(self) -> bool:
        return self._window.on_photograph == self._take_pixel

    def _text(self) -> str:
        review = self._window.review
        if "scan" in review.missing:
            return f"**Not registered**: {review.missing['scan']}"
        pose = read_optional(review.store, "pose.json")
        if not isinstance(pose, dict):
            return "The ground truth was given, not registered from a scan."
        return (
            f"Registered: outline to {pose['residual_px']:.2f} px rms, place ± {pose['sigma_mm']:.2f} mm, turn ± "
            f"{pose['sigma_deg']:.2f}°. It lies over the photograph, shaded: **Capture** lays on other things."
        )

    def _toggle(self) -> None:
        window = self._window
        if self._is_picking:
            window.on_photograph = window.on_scan = None
        else:
            _ = window.review.scan_mesh  # What is at fault with it is told before anything is picked.
            window.on_photograph, window.on_scan = self._take_pixel, self._take_point
            window.ball = None
        window.choose(view="Photograph")

    def _take_pixel(self, pixel: tuple[float, float]) -> None:
        picks = self._window.picks.with_pixel(pixel)
        self._take("a pixel", picks, "Scan" if len(picks.pixels) > len(picks.points) else "Photograph")

    def _take_point(self, point: Any) -> None:
        self._take("a point of the scan", self._window.picks.with_point(point), "Photograph")

    def _take(self, label: str, picks: Picks, view: View) -> None:
        self._window.view = view
        self._window.alter(label, picks=picks)

    def _pose(self) -> None:
        from align.pose.scan_outline import outline_strokes

        review, picks = self._window.review, self._window.picks
        mesh = review.scan_mesh
        found = self.found = pose_of(review, picks, mesh)
        self._strokes = outline_strokes(mesh, found.pose, *review.need("camera"))
        self._window.choose(view="Photograph")
        told = "".join(f"\n\n**Warning:** {plain(text)}" for text in found.warnings)
        self._status.content = (
            f"{picks.pairs} pairs, {found.residual_px:.1f} px rms apart at the pose that they give. Its outline "
            f"is drawn in pink: a start, which the step `align` refines.{told}"
        )

    def _add_pixels(self, plane: Plane) -> list[Any]:
        places = [tuple(plane.place(pixel, lift=0.003)) for pixel in self._window.picks.pixels]
        return add_numbered(self._window.client.scene, f"{ROOT}/pick", places, 0.04, PICKED)

    def _add_outline(self, plane: Plane) -> list[Any]:
        if not len(self._strokes):
            return []
        return [add_lines(self._window.client.scene, "picked", plane.place(self._strokes, lift=0.002), OUTLINE, 2.0)]
