"""The panels of a review, put on a browser's desk."""

from studio.results.panel import ResultsPanel
from studio.review.balls_panel import BallsPanel
from studio.review.frames_panel import FramesPanel
from studio.review.hemisphere_panel import LightsPanel
from studio.review.light_stage import LightStage
from studio.review.review_desk import ReviewDesk
from studio.review.run_panel import RunPanel
from studio.review.scan_panel import ScanPanel
from studio.review.twin_panel import TwinPanel
from studio.review.wall import Wall
from studio.review.warnings_panel import WarningsPanel


def furnish(desk: ReviewDesk) -> None:
    """Put the panels of a review on a desk."""
    desk.read()
    gui = desk.client.gui
    wall, stage = Wall(desk), LightStage(desk)
    tabs = gui.add_tab_group()
    makers = {
        "Frames": FramesPanel,
        "Balls": BallsPanel,
        "Lights": LightsPanel,
        "Scan": lambda desk: ScanPanel(desk, wall, stage),
        "Twin": TwinPanel,
        "Results": ResultsPanel,
        "Warnings": WarningsPanel,
        "Run": RunPanel,
    }
    panels = []
    for label, make in makers.items():
        if desk.is_gone:
            return
        with tabs.add_tab(label):
            panels.append(make(desk))
    # The twin's panel says what stands beside the photograph; the picks' panel marks the scan once it is there.
    desk.panels += [*(one for one in panels if not isinstance(one, ScanPanel)), wall, stage]
    desk.panels += [one for one in panels if isinstance(one, ScanPanel)]
    gui.main_panel.dock_right()
    gui.main_panel.set_width(480)
    desk.refresh()
