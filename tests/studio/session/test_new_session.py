"""A folder of photographs in the studio: `init` begins its session, and the command opens what a path is."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from capture.session.session import load_session
from scene.errors import SceneError
from studio.opening import OPEN_ROWS, OpenWindow, open_path
from studio.session.new_session import NEW_ROWS, NewWindow
from studio.session.photograph_view import PhotographView
from studio.session.session_rows import SESSION_ROWS
from studio.session.session_window import SessionWindow
from studio.studio_command import studio
from studio.studio_state import StudioState
from studio.workspace import Workspace
from tests.conftest import until


def photographs(place, count=5):
    """Leave photographs of noise in a folder."""
    generator = np.random.default_rng(10_040)
    place.mkdir(parents=True)
    for number in range(count):
        picture = generator.integers(1000, 60000, (60, 80, 3)).astype(np.uint16)
        cv2.imwrite(str(place / f"flash_{number}.png"), picture)


@pytest.fixture
def folder(tmp_path):
    photographs(tmp_path / "bench" / "jug")
    return tmp_path / "bench" / "jug"


@pytest.fixture
def begin(nobody, furnish, monkeypatch):
    """Return what opens a folder below its workspace; the window's `turned` says that it was left."""

    def begun(folder, out=None):
        place, state = Workspace.at(folder.parent), StudioState()
        open_path(state, place, folder, out)
        window = furnish(NewWindow(nobody(), place, state), NEW_ROWS)
        window.turned, window.turn = False, lambda: setattr(window, "turned", True)
        return window

    return begun


@pytest.fixture
def write(say):
    """Return what types values, has the session written, and waits until that has ended and was told."""

    def written(window, *typed):
        say(window, *typed, "Write session.toml")
        until(lambda: window.turned or window.client.told, lambda: window.work and window.work.said)

    return written


def test_what_is_typed_is_in_the_session_that_is_shown(begin, folder, nobody, furnish, say, write):
    """The whole way: a first photograph, session.toml, the folder as `init` saw it; its results go to the workspace."""
    window = begin(folder)
    assert window.client.shown("image")[0].shape == (60, 80, 3)
    write(window, ("focal, mm", 50.0), ("sensor, mm", 36.0), ("unit", "cm"), ("unit", "(not said)"))
    assert not window.client.told
    assert "focal_mm = 50.0" in (folder / "session.toml").read_text()
    out = folder.parent / "out" / "jug"
    assert (window.state.session, window.state.area) == ((out, folder), "Session")
    window = furnish(SessionWindow(nobody(), window.workspace, window.state), SESSION_ROWS, PhotographView)
    assert window.client.seen("/photograph/picture") is not None
    assert window.review.preview.shape[1] > 1000, "the contact sheet"
    window.open_tab("Balls")
    say(window, "Add a chrome ball")
    assert "frames: the step `check` has not ended here" in window.client.told[-1], "in which pixels is not known"


def test_what_init_refuses_is_told(begin, folder, write):
    """As it says it on the command line, and what was typed stays."""
    window = begin(folder)
    write(window, ("sensor, mm", 3000.0))
    assert "expected 1 to 250" in window.client.told[-1]
    assert window.client.input("sensor, mm").value == 3000
    assert not (folder / "session.toml").exists()


def test_of_several_objects_each_gets_a_session(begin, tmp_path, write):
    for name in ("shelf/cup", "shelf/jug", "other/a", "other/b"):
        photographs(tmp_path / name)
    window = begin(tmp_path / "shelf")
    write(window)
    assert all((tmp_path / "shelf" / name / "session.toml").exists() for name in ("cup", "jug"))
    assert (window.state.area, window.state.folder) == ("Open", tmp_path / "shelf")
    with pytest.raises(SceneError, match="2 objects"):
        begin(tmp_path / "other", tmp_path / "out")


def test_a_folder_of_sessions_is_listed(tmp_path, nobody, furnish, say):
    """What is chosen there is gone to."""
    for name in ("jug", "vase"):
        (tmp_path / "captures" / name).mkdir(parents=True)
        (tmp_path / "captures" / name / "session.toml").write_text('[frames]\nflash = "*.png"\n')
        for number in range(3):
            (tmp_path / "captures" / name / f"{number}.png").touch()
    state, workspace = StudioState(), Workspace.at(tmp_path)
    open_path(state, workspace, tmp_path / "captures")
    window = furnish(OpenWindow(nobody(), workspace, state), OPEN_ROWS)
    say(window, "vase")
    assert state.session == (tmp_path / "out" / "vase", tmp_path / "captures" / "vase")


def test_diameters_typed_before_the_photographs_are_decoded_are_kept(made, nobody, furnish, say, tmp_path):
    """Where the balls are is not known yet, nor changed."""
    state = StudioState(area="Session", session=(tmp_path / "new", made.session))
    window = furnish(SessionWindow(nobody(), Workspace.at(tmp_path), state), SESSION_ROWS)
    window.open_tab("Balls")
    say(window, ("white balls, mm", 80.0), "Keep")
    kept = load_session(tmp_path / "new" / "review").spheres
    assert [(one.kind, one.diameter_mm, one.center_px) for one in kept] == [
        ("chrome", 100.0, None), ("chrome", 100.0, None), ("white", 80.0, None)
    ]  # fmt: skip
    window.read_again()
    assert [ball.diameter_mm for ball in window.picks.balls] == [100.0, 100.0, 80.0]


def test_the_command_opens_what_a_path_is(folder, monkeypatch):
    """Before the page opens: no photographs, or an output folder outside of the workspace, end it with one message."""
    asked, opened = [], []

    def begin(place, **how):
        asked.append(how["state"])
        return SimpleNamespace(address="http://127.0.0.1:1", close=lambda: None)

    def wait(self, timeout=None):
        raise KeyboardInterrupt

    monkeypatch.setattr("studio.server.Studio", begin)
    monkeypatch.setattr("threading.Event.wait", wait)
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.chdir(folder.parent)

    def opens(*arguments, **options):
        with pytest.raises(KeyboardInterrupt):
            studio(*arguments, **options)
        return asked[-1]

    assert opens(browser=False).area == "Open"
    assert not opened
    state = opens(folder)
    assert opened == ["http://127.0.0.1:1"], "the system's browser"
    out = folder.parent / "out" / "jug"
    assert (state.area, state.session) == ("Session", (out, folder))
    with pytest.raises(SceneError, match="lies outside of the workspace"):
        studio(folder, out=folder.parent / "out", workspace=folder)
    (folder / "session.toml").write_text('[frames]\nflash = "flash_*.png"')
    state = opens(folder)
    assert (state.area, state.session) == ("Session", (out, folder))
    (folder.parent / "empty").mkdir()
    with pytest.raises(SceneError, match="photometric stereo needs 3"):
        studio(folder.parent / "empty")
