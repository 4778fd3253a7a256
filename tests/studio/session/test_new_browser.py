"""From a folder of photographs to the report in a real browser, without a terminal."""

import json
import shutil

import numpy as np
import pytest

from scene.current import ROOT
from scene.normals import angular_error_deg

pytestmark = [pytest.mark.slow]
FIXTURE = ROOT / "fixtures" / "bumpy"
MOST_INTERACTIONS = 8


@pytest.fixture
def studio(tmp_path, run_studio):
    """A studio in whose workspace the fixture's photographs and scan lie, without a session.toml."""
    for part in ("raw", "scan"):
        shutil.copytree(FIXTURE / part, tmp_path / "bumpy" / part)
    return run_studio(tmp_path)


@pytest.mark.full
def test_from_a_folder_to_the_report(visit, studio, tmp_path):
    """Nothing but the page is used; the report that is shown in it is the session's own."""
    visitor = visit(studio, "New session here")
    visitor.settle()
    visitor.keep("open")
    visitor.press("bumpy/")
    visitor.button("One folder up").wait_for()
    visitor.press("New session here")
    visitor.button("Write session.toml").wait_for()
    visitor.fill("chrome, mm", 100)
    visitor.fill("white, mm", 90)
    visitor.settle()
    visitor.keep("new_session")
    visitor.press("Write session.toml")
    visitor.button("Run everything").wait_for()
    visitor.settle()
    visitor.keep("new_session_seen")
    text = (tmp_path / "bumpy" / "session.toml").read_text()
    assert 'scan_unit = "mm"' in text, "the balls' diameters tell the scan's unit"
    (tmp_path / "bumpy" / "session.toml").write_text(text.replace("[object]\n", "[object]\ntolerance_deg = 25\n"))
    visitor.press("Run everything")
    report = visitor.page.frame_locator("#studio-report")
    report.get_by_text("iterative").first.wait_for(timeout=600_000)
    assert report.locator(".headline .badge").inner_text().lower() == "pass"
    assert visitor.interactions <= MOST_INTERACTIONS
    visitor.settle()
    visitor.keep("verdict")
    out = tmp_path / "out" / "bumpy"
    summary = json.loads((out / "summary.json").read_text())
    assert {"ls", "iterative"} <= set(summary["compare"]["methods"])
    truth = json.loads((FIXTURE / "truth.json").read_text())
    lights = visitor.window.review.lights.seen_from(np.array(truth["object_centre_mm"]))
    assert np.median(angular_error_deg(lights.directions, np.array(truth["directions_at_object"]))) < 1.5
    # Its scripts have no part in the studio's own page.
    frame = next(frame for frame in visitor.page.frames if "/report/" in frame.url)
    assert frame.evaluate("self.origin") == "null"
    # What is shown follows the tab: the view is the photograph's again, and the report's again.
    visitor.tab("Balls")
    visitor.page.locator("#studio-report").wait_for(state="detached")
    visitor.tab("Verdict")
    visitor.page.locator("#studio-report").wait_for()
    outside = [url for url in visitor.asked if studio.address.split("//")[1] not in url]
    assert all(url.startswith(("data:", "blob:")) for url in outside), "nothing is fetched from elsewhere"
