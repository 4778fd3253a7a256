"""A folder with several sessions in a real browser: its list, one that is opened by a click, and the way back."""

import numpy as np
import pytest

from lab.options import Settings
from lab.run import run_session
from scene.store import Store
from studio.opening import open_many
from studio.server import Studio
from studio.studio_state import StudioState
from studio.workspace import Workspace
from tests.lab.test_foreign_files import make_session

ODD = "x <b>&"

pytestmark = [pytest.mark.slow, pytest.mark.full]


@pytest.fixture
def studio(tmp_path):
    """A studio on a folder with three sessions, one of them processed."""
    for name in ("jug", "day/vase", ODD):
        make_session(tmp_path / "captures" / name)
    normals = np.random.default_rng(10_005).normal(0, 0.3, (24, 32, 3)) + [0, 0, 1]
    np.save(tmp_path / "captures" / "jug" / "n.npy", normals / np.linalg.norm(normals, axis=-1, keepdims=True))
    with open(tmp_path / "captures" / "jug" / "session.toml", "a") as file:
        file.write('normals = "n.npy"\ntolerance_deg = 3\n')
    run_session(
        tmp_path / "captures" / "jug", "compare", out=tmp_path / "out" / "captures" / "jug", said=Settings("ls")
    )
    state, workspace = StudioState(), Workspace.at(tmp_path)
    assert open_many(state, workspace, tmp_path / "captures")
    running = Studio(workspace, port=0, state=state)
    yield running
    running.close()


def test_the_sessions_below_a_folder_are_listed_and_opened(visit, studio, tmp_path):
    out, visitor = tmp_path / "out" / "captures", visit(studio, "day/vase: not processed")
    visitor.settle()
    visitor.keep("many")
    buttons = [
        text
        for text in visitor.page.get_by_role("button").all_inner_texts()
        if ": " in text and not text.endswith(": session")
    ]
    assert buttons == ["day/vase: not processed", "jug: fail", f"{ODD}: not processed"]
    visitor.see("of the object lies within")
    warned = Store(out / "jug").read_json("summary.json")["warnings"]
    visitor.see(f"{len(warned)} warnings")
    picture = visitor.page.get_by_alt_text("normals of jug by ls")
    assert picture.evaluate("image => image.naturalWidth") > 0
    assert visitor.page.locator("img[alt^=normals]").count() == 1

    visitor.press("jug: fail")
    visitor.page.frame_locator("#studio-report").get_by_text("Photometric stereo report").wait_for()
    assert studio.state.session == (out / "jug", tmp_path / "captures" / "jug")
    visitor.press("Open")
    visitor.button("day/vase: not processed").wait_for()
    visitor.press("day/vase: not processed")
    visitor.button("Run up to Capture").wait_for()
    visitor.press("Run up to Capture")
    visitor.until(lambda: "check" in visitor.window.review.done, "the first step is done")
    assert (out / "day" / "vase" / "frames").is_dir()
    visitor.press("Open")
    visitor.button(f"{ODD}: not processed").wait_for()
