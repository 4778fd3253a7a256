"""The steps run from a session: as they were run before, with what was corrected, and what stops them."""

from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.session.session import load_session
from lab.options import Settings
from scene.output_folder import open_record
from studio import background_process
from studio.background_process import BackgroundProcess
from studio.photograph import outline_marks, photograph_window
from studio.photograph.outline_marks import KNOB, OutlineMarks
from studio.photograph.outlines import moved
from studio.photograph.plane import ROOT, Plane
from studio.review import review_window
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel
from studio.workspace import Workspace


def test_what_stops_the_steps_is_told(made):
    """In their own process: photographs that are no pictures end it, with the line that says so."""
    said, ended = [], []
    arguments = ["-m", "studio.studio_run", "check", str(made.session), str(made.folder.parent / "again")]
    BackgroundProcess(arguments, said.append, ended.append).wait()
    (fault,) = ended
    assert "flash_0.png" in fault
    assert not fault.startswith("rgbn")
    assert "Traceback" not in "".join(said)


@pytest.fixture
def opened(made, nobody, no_preview, monkeypatch):
    """Return what opens a window on the folder that was made, whose runs are listed and end at once."""
    runs, windows = [], []

    class Ran:
        def __init__(self, arguments, tell, ended):
            assert arguments[:2] == ["-m", "studio.studio_run"]
            assert arguments[4] == str(made.folder)
            runs.append((load_session(Path(arguments[3])), arguments[2]))
            tell("<b>solve</b> ...")
            ended("")

        def stop(self):
            pass

    monkeypatch.setattr(background_process, "BackgroundProcess", Ran)

    def window(desk=None, number=1):
        found = ReviewWindow(
            nobody(number), Workspace.at(made.folder.parent), no_preview, made.folder, made.session, desk
        )
        found.read()
        found.panels.append(RunPanel(found))
        found.refresh()
        windows.append(found)
        return found

    window.runs = runs
    yield window
    for one in windows:
        one.close()
        one.wait()


def test_a_run_takes_what_was_corrected_and_the_session_as_it_is_now(opened, made, settle):
    """It says with what other programs: a folder that came from elsewhere may name any."""
    with open_record(made.folder, among_others=True) as record:
        Settings(external=("Net=python `net` {data} {out}",)).keep(record)
    window = opened()
    window.open_tab("Verdict")
    panel, runs = window.panels[-1], opened.runs
    assert "Net=python `net` {data} {out}" in panel._what.content
    window.client.says("Run everything")
    settle(window)
    settle(window)
    assert (runs[0][0].folder, runs[0][1]) == (made.session, "compare")
    window.open_tab("Balls")
    window.correct(moved(window.outlines, 0, (40.0, 30.0), made.camera))
    text = (made.session / "session.toml").read_text()
    (made.session / "session.toml").write_text(text + 'scan_unit = "cm"\n')
    assert "what you corrected" in panel._what.content
    window.client.says("Run up to Balls")
    settle(window)
    settle(window)
    session, step = runs[1]
    assert (session.scan_unit, session.spheres[0].center_px, step) == ("cm", (40.0, 30.0), "calibrate")
    window.client.says("Run up to Balls")
    settle(window)
    assert runs[2][0].spheres[0].center_px == (40.0, 30.0), "what was kept stays so"
    window.forget()
    window.client.says("Run up to Balls")
    settle(window)
    assert runs[3][0].folder == made.session


def test_corrections_are_undone_and_outlive_the_window(opened, made):
    """A reload shows them as they were, not kept, and undo still takes them back."""
    window = opened()
    found = window.outlines
    window.correct(moved(found, 0, (40.0, 30.0), made.camera), "move ball 1")
    window.correct(moved(window.outlines, 1, (90.0, 40.0), made.camera), "move ball 2")
    window.close()
    again = opened(window.desk, 2)
    assert again.outlines[0].center_px == (40.0, 30.0)
    assert not again.is_kept_so
    again.undo()
    assert again.outlines[1] == found[1]
    again.undo()
    assert (again.outlines, again.is_kept_so) == (found, True)
    again.redo()
    assert again.outlines[0].center_px == (40.0, 30.0)


def test_what_another_window_kept_is_not_written_over_unseen(opened, made, settle):
    """The second one is told once; that it keeps all the same is then its own decision."""
    one, other = opened(), opened(number=2)
    one.correct(moved(one.outlines, 0, (40.0, 30.0), made.camera))
    other.correct(moved(other.outlines, 1, (90.0, 40.0), made.camera))
    kept = one.write_kept() / "session.toml"
    text = kept.read_text()
    with pytest.raises(review_window.SceneError, match="another window"):
        other.write_kept()
    assert kept.read_text() == text
    other.write_kept()
    assert load_session(kept.parent).spheres[1].center_px == (90.0, 40.0)
    one.close()


def test_a_drag_is_undone_as_one_however_slow_it_is(opened, settle, monkeypatch):
    """A machine that is busy, or a hand that rests, sends the next place seconds later."""
    clock = SimpleNamespace(monotonic=count(0, 10).__next__)
    monkeypatch.setattr(outline_marks, "time", clock)
    monkeypatch.setattr(photograph_window, "time", clock)
    window, plane = opened(), Plane(160, 120)
    window.choose_ball(0)
    OutlineMarks(window, lambda ball: KNOB).refresh(plane)
    found = window.outlines[0]
    window.client.camera.position = (0.0, 0.0, 5.0)
    for reach in (1.05, 1.1):
        places = plane.place(np.add(found.center_px, [[part * found.radius_px, 0] for part in (1, 1.02, reach)]))
        window.client.drags(window.client.seen(f"{ROOT}/rim"), *places)
    settle(window)
    assert [label for label, *_ in window.history.past] == ["resize ball 1"] * 2
    assert window.outlines[0].radius_px == pytest.approx(1.1 * found.radius_px, rel=0.01)
    window.undo()
    assert window.outlines[0].radius_px == pytest.approx(1.05 * found.radius_px, rel=0.01)
    window.undo()
    assert window.outlines[0] == found
