"""The panel of the scan: its pose, and pairs of pixels and points where it was not found without help."""

from typing import Any

import numpy as np

from compare.report.facts import read_optional
from studio.markdown import code, plain
from studio.review.corrected_session import write_amended
from studio.review.light_stage import LightStage
from studio.review.plane import ROOT, add_lines
from studio.review.review_desk import ReviewDesk
from studio.review.scan_picks import Picks, load_scan, pose_of, write_picks
from studio.review.shown import Shown
from studio.review.wall import Wall

FEWEST = 4
PICKED, OUTLINE = (60, 170, 255), (255, 0, 190)


class ScanPanel:
    """Where the scan stands, and picks."""

    def __init__(self, desk: ReviewDesk, wall: Wall, stage: LightStage) -> None:
        self._desk, self._wall, self._stage, gui = desk, wall, stage, desk.client.gui
        self.picks, self.found, self._strokes = Picks(), None, np.zeros((0, 2, 2))
        self._shown = Shown()
        self._facts = gui.add_markdown("")
        with gui.add_folder("Pick points"):
            gui.add_markdown(
                "Where the pose is refused or wrong: click a point in the photograph, then the same point on the scan. "
                "Four pairs at least, better six, spread over the object."
            )
            self._go = desk.on_click(gui.add_button("Start picking"), self._toggle)
            self._status = gui.add_markdown("")
            desk.on_click(gui.add_button("Take the last one back"), self._take_back)
            desk.on_click(gui.add_button("Pose from the picks"), self._pose)
            self._keep = desk.on_click(gui.add_button("Keep these picks", disabled=True), self._keep_picks)

    def refresh(self) -> None:
        """Follow the desk."""
        desk, review = self._desk, self._desk.review
        self._facts.content = self._text()
        picks, plane = self.picks, self._wall.plane
        self._go.label = "Start picking" if desk.on_photograph is None else "Stop picking"
        if plane is not None:
            self._shown.once("pixels", (desk.reading, picks.pixels), self._add_pixels)
            key = (desk.reading, self._strokes.tobytes())
            self._shown.once("outline", key, self._add_outline)
        self._stage.mark(np.array(picks.points).reshape(-1, 3))
        waiting = len(picks.pixels) > len(picks.points)
        self._status.content = f"{picks.pairs} pairs." + (" Now the same point on the scan." if waiting else "")
        self._keep.disabled = picks.pairs < FEWEST or review.session is None

    def _text(self) -> str:
        review = self._desk.review
        if "scan" in review.missing:
            return f"**Not registered**: {review.missing['scan']}"
        pose = read_optional(review.store, "pose.json")
        if not isinstance(pose, dict):
            return "The ground truth was given, not registered from a scan."
        return (
            f"Registered: outline to {pose['residual_px']:.2f} px rms, place ± {pose['sigma_mm']:.2f} mm, turn ± "
            f"{pose['sigma_deg']:.2f}°. Lay it over the photograph under **Frames**."
        )

    def _toggle(self) -> None:
        desk = self._desk
        if desk.on_photograph is not None:
            desk.on_photograph = desk.on_scan = None
            desk.choose(view="Photograph")
            return
        load_scan(desk.review)  # What is at fault with it is told before anything is picked.
        desk.on_photograph, desk.on_scan = self._take_pixel, self._take_point
        desk.ball = None
        desk.choose(view="Photograph")

    def _take_pixel(self, pixel: tuple[float, float]) -> None:
        self.picks = self.picks.with_pixel(pixel)
        self._desk.choose(view="Scan" if len(self.picks.pixels) > len(self.picks.points) else "Photograph")

    def _take_point(self, point: Any) -> None:
        self.picks = self.picks.with_point(point)
        self._desk.choose(view="Photograph")

    def _take_back(self) -> None:
        self.picks = self.picks.without_last()
        self._desk.refresh()

    def _pose(self) -> None:
        from align.pose.appearance import outline

        review = self._desk.review
        mesh = load_scan(review)
        found = self.found = pose_of(review, self.picks, mesh)
        assert review.material.camera is not None
        self._strokes = outline(mesh, found.pose, review.material.camera)
        self._desk.choose(view="Photograph")
        told = "".join(f"\n\n**Warning:** {plain(text)}" for text in found.warnings)
        self._status.content = (
            f"{self.picks.pairs} pairs, {found.residual_px:.1f} px rms apart at the pose that they give. Its outline "
            f"is drawn in pink: a start, which the step `align` refines.{told}"
        )

    def _keep_picks(self) -> None:
        desk = self._desk
        folder = write_amended(desk.review, picks=write_picks(desk.review, self.picks))
        name, out = desk.workspace.name(folder), desk.workspace.name(desk.review.store.folder)
        self._status.content = (
            f"Kept in {code(desk.workspace.name(folder / 'session.toml'))}; your own session.toml is as it was. To "
            f"register from them: **Run**, or {code(f'rgbn process {name} --out {out}')}."
        )

    def _add_pixels(self) -> list[Any]:
        plane, view, handles = self._wall.plane, self._desk.client.scene, []
        assert plane is not None
        for index, pixel in enumerate(self.picks.pixels):
            place = tuple(plane.place(pixel, lift=0.003))
            handles.append(view.add_icosphere(f"{ROOT}/pick_{index}", radius=0.04, color=PICKED, position=place))
            handles.append(view.add_label(f"{ROOT}/pick_number_{index}", str(index + 1), position=place))
        return handles

    def _add_outline(self) -> list[Any]:
        plane = self._wall.plane
        if plane is None or not len(self._strokes):
            return []
        return [add_lines(self._desk.client.scene, "picked", plane.place(self._strokes, lift=0.002), OUTLINE, 2.0)]
