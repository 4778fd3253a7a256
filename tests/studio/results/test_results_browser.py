"""Results in a real browser: a pixel is clicked in the right picture, and both cursors, numbers and charts are its."""

import cv2
import numpy as np
import pytest

from studio.results.panel import MIDDLES, ResultsPanel
from studio.results.side_by_side import map_picture, viewport_of
from studio.server import Studio
from studio.workspace import Workspace

pytestmark = [pytest.mark.slow]


def place_of(panel, results, pixel, side):
    """Return where a pixel of the left or the right picture stands in the 3-D view."""
    across, down = viewport_of(results, panel.choice).share(*pixel)
    wide, high = panel.size
    return np.array([MIDDLES[side] + (across - 0.5) * wide, (0.5 - down) * high, 0.0])


def is_drawn(visitor, panel, results, pixel):
    """Whether the screen shows, in the middle of a pixel on both sides, the colour that the picture has there."""
    screen = cv2.imdecode(np.frombuffer(visitor.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    across, down = viewport_of(results, panel.choice).share(*pixel)
    for side, source in enumerate((panel.choice.left, panel.choice.right)):
        picture = map_picture(results, panel.choice, source)
        drawn = picture[int(down * picture.shape[0]), int(across * picture.shape[1])]
        x, y = visitor.on_screen(place_of(panel, results, pixel, side)).astype(int)
        if np.abs(screen[y, x].astype(int) - drawn).max() > 25:
            return False
    return True


def test_a_pixel_is_pointed_at(visit, made, tmp_path):
    studio = Studio(Workspace.at(tmp_path), port=0, review=(made.folder, None))
    try:
        visitor = visit(studio, "Photograph")
        window, results = visitor.window, made.read(made.folder)
        visitor.tab("Results")
        visitor.press("Show side by side")
        visitor.until(lambda: window.view == "Results", "the results are shown")
        panel = next(one for one in window.panels if isinstance(one, ResultsPanel))
        visitor.see("Click a pixel of either picture")
        for side, pixel in ((1, (40, 26)), (0, made.odd)):
            visitor.frames(3)
            visitor.page.mouse.click(*visitor.on_screen(place_of(panel, results, pixel, side)))
            visitor.until(lambda: panel.choice.cursor == pixel, "the pixel was clicked")  # noqa: B023
            visitor.see(f"photographs, pixel {pixel[0]}, {pixel[1]}")
        visitor.page.locator('input[value="1 x"]:visible').click(force=True)
        visitor.page.get_by_role("option", name="8 x").click(force=True)
        visitor.until(lambda: panel.choice.zoom == 8, "zoomed")
        assert viewport_of(results, panel.choice).centre == pytest.approx(made.odd)
        visitor.page.locator('input[value="normals"]:visible').click(force=True)
        visitor.page.get_by_role("option", name="errors").click(force=True)
        visitor.until(lambda: panel.choice.what == "errors", "errors are shown")
        visitor.until(lambda: is_drawn(visitor, panel, results, made.odd), "the errors are drawn around the cursor")
        # Samples by light and by n . l, and the histograms.
        assert visitor.page.locator(".js-plotly-plot").count() == 3
        visitor.keep("results")
        visitor.page.locator(".js-plotly-plot").nth(1).evaluate("plot => plot.scrollIntoView({block: 'end'})")
        visitor.frames(3)
        visitor.keep("results_charts")
        outside = [url for url in visitor.asked if studio.address.split("//")[1] not in url]
        assert all(url.startswith(("data:", "blob:")) for url in outside), "nothing is fetched from elsewhere"
    finally:
        studio.close()
