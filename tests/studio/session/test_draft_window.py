"""The window of a session that is begun, without a browser: what is typed, clicked and chosen, and what is written."""

from threading import Event
from types import SimpleNamespace

import pytest

from capture.session.manifest import SphereTable
from capture.session.session import load_session
from capture.session.session_types import Lens
from scene.errors import SceneError
from shoot.init import init_session
from shoot.init.session_text import notes_of
from studio.opening import open_path
from studio.session.draft_window import DRAFT_ROWS, TABS, DraftWindow
from studio.session.looking import role_of, with_role
from studio.session.photograph_view import PhotographView
from studio.session.plane import Plane
from studio.studio_command import studio
from studio.studio_state import StudioState
from studio.widgets import fenced
from studio.workspace import Workspace

SIZE = Plane(80, 60)


@pytest.fixture
def looks(found, monkeypatch):
    """What looks at folders come to, in this order; the last one again and again."""
    ends = [found.draft]

    def prepare(files, asking, progress, seen):
        end = ends.pop(0) if len(ends) > 1 else ends[0]
        if isinstance(end, Exception):
            raise end
        return end(seen) if callable(end) else end

    monkeypatch.setattr("studio.session.looking.prepare", prepare)
    return ends


@pytest.fixture
def settled(settle):
    """Return what waits until a look has ended, and a window shows what came of it."""

    def wait(window):
        window.taken.wait()
        window.post(window.look_again)
        settle(window)
        return window

    return wait


@pytest.fixture
def begin(nobody, furnish):
    """Return what opens a folder below its workspace, or goes on with a state, in a window."""

    def begun(folder=None, state=None):
        place = Workspace.at(folder.parent if folder else state.session[0].parents[1])
        if state is None:
            state = StudioState()
            open_path(state, place, folder)
        return furnish(DraftWindow(nobody(), place, state), DRAFT_ROWS, PhotographView)

    return begun


@pytest.fixture
def window(folder, looks, begin, settled):
    """A window on the folder, with all its tabs, as soon as that was looked at."""
    made = settled(begin(folder))
    for tab in reversed(TABS):
        made.open_tab(tab)
    assert made.draft is not None
    return made


def files_in(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != "session.toml"}


def test_the_panels_write_what_they_show(window, folder, settle):
    """Typed, clicked and chosen in the panels; the file holds it, and nothing else in the folder is touched."""
    before, client = files_in(folder), window.client

    def say(label, value=True):
        client.says(label, value)
        settle(window)

    def diameters():
        return [ball.diameter_mm for ball in window.outlines]

    say("chrome balls, mm", 0.05)
    assert "expected 0.1 to 10000" in client.told[-1]
    assert client.input("chrome balls, mm").value == 0.0, "what could not be done is taken out of the input"
    say("chrome balls, mm", 40.0)
    say("white balls, mm", 38.5)
    assert not client.input("white balls, mm").disabled
    assert any("unit is not told: mm is taken" in note for note in notes_of(window.draft))
    say("scan_unit", "cm")
    assert not any("unit is not told" in note for note in notes_of(window.draft))
    say("scan_unit", "(mm; m for GLB)")
    say("focal_mm", 50.0)
    say("Write session")
    assert "without the size of the sensor" in client.told[-1]
    say("sensor_mm", 3600.0)
    assert "expected 1 to 250" in client.told[-1]
    say("sensor_mm", 36.0)
    say("tolerance_deg", 90.0)
    assert "expected less than 90" in client.told[-1]
    say("tolerance_deg", 2.5)
    say("photograph", "flash_2.png")
    say("used for", "not used")
    say("mask", "mask.png")
    say("ball", "2: chrome")
    assert client.input("diameter, mm").value == 40.0, "as the others of its kind"
    say("diameter, mm", 60.0)
    assert diameters() == [40.0, 60.0, 38.5]
    say("kind", "white")
    assert diameters() == [40.0, 38.5, 38.5], "as those of its new kind"
    say("Back to the balls as found")
    assert diameters() == [40.0, 40.0, 38.5]
    client.clicks(client.seen("/photograph/picture"), ray_origin=SIZE.place((21.0, 46.0)) + [0, 0, 5],
                  ray_direction=[0.0, 0.0, -1.0])  # fmt: skip
    settle(window)
    assert window.ball == 2, "the ball under the click"
    say("Remove this ball")
    say("ball", "1: chrome")
    say("centre, px", (21.0, 15.0))
    shown = window.text
    say("Write session")
    assert (folder / "session.toml").read_text() == shown
    assert files_in(folder) == before
    session = load_session(folder)
    assert [path.name for path in session.flash] == ["flash_0.png", "flash_1.png", "flash_3.png", "flash_4.png"]
    rows = [(one.kind, one.diameter_mm, one.center_px, one.radius_px) for one in session.spheres]
    assert rows == [("chrome", 40.0, (21.0, 15.0), 8.0), ("chrome", 40.0, (60.0, 15.0), 7.5)]
    assert session.mask == folder / "mask.png"
    assert (session.scan_unit, session.camera) == ("mm", Lens(focal_mm=50.0, sensor_mm=36.0))
    assert session.tolerance_deg == 2.5
    state = window.state
    assert (state.area, state.session) == ("Session", (folder.parent / "out" / "jug", folder)), "it goes on there"
    assert window.draft is None, "nothing here changes it any more"


def test_what_cannot_be_written_is_not(window, folder, monkeypatch):
    """Before the folder was looked at, over a file that is there, outside of the workspace, or not to be read again."""
    edits = window.state.edits.pop(folder)
    window.refresh()
    assert not window.client.input("Write session").visible
    with pytest.raises(SceneError, match="still being looked at"):
        window.write()
    window.state.edits[folder] = edits
    (folder / "session.toml").write_text("# mine")
    with pytest.raises(SceneError, match="is there already"):
        window.write()
    assert (folder / "session.toml").read_text() == "# mine"
    (folder / "session.toml").unlink()
    window.workspace = Workspace.at(folder)
    with pytest.raises(SceneError, match="lies outside of the workspace"):
        window.write()
    window.workspace = Workspace.at(folder.parent)

    def refuse(path):
        raise SceneError("not a session")

    monkeypatch.setattr(init_session, "load_session", refuse)
    with pytest.raises(SceneError, match="not a session"):
        window.write()
    assert not (folder / "session.toml").exists()
    assert window.draft is not None


def test_a_photograph_gets_another_use_where_it_can_have_it(found, folder):
    draft, small, flash = found.draft, found.small, folder / "flash_3.png"
    without = with_role(draft, small, flash, "not used")
    assert role_of(without, flash) == "not used"
    assert flash not in without.photographs["flash"]
    assert with_role(without, small, flash, "flash").photographs == draft.photographs
    assert "ambient" not in with_role(draft, small, folder / "ambient_0.png", "dark").photographs
    fewer = with_role(without, small, folder / "flash_0.png", "not used")
    apart = draft.with_balls([SphereTable(kind="chrome", frames=["flash_*.png"])])
    for one, path, role, told in (
        (apart, "flash_1.png", "not used", "under frames.skip in session.toml"),
        (draft, "odd.png", "dark", "40 x 30 px"),
        (fewer, "flash_1.png", "not used", "3 flash frames are the fewest"),
        (draft, "odd.png", "board", "a folder called board"),
    ):
        with pytest.raises(SceneError, match=told):
            with_role(one, small, folder / path, role)


def test_each_object_keeps_what_was_put_right(tmp_path, found, looks, begin, settle, settled):
    """Two objects in a folder, one with a session: each is shown when it is chosen, and the other is as it was left."""
    top = tmp_path / "shelf"
    for name in ("cup", "jug"):
        (top / name).mkdir(parents=True)
        for path in found.draft.photographs["flash"]:
            (top / name / path.name).write_bytes(path.read_bytes())
    (top / "cup" / "session.toml").write_text("")
    window = settled(begin(top))
    assert tuple(window.client.input("object").options) == ("cup (has a session.toml)", "jug")
    assert window.place == top / "jug"
    window.post(lambda: window.measure("white", 5.0))
    window.client.says("object", "cup (has a session.toml)")
    settle(window)
    assert window.state.session == (tmp_path / "out" / "cup", top / "cup")
    (top / "cup" / "session.toml").unlink()
    cup = settled(begin(state=window.state))
    assert [ball.diameter_mm for ball in cup.outlines] == [None] * 3
    cup.client.says("object", "jug")
    settle(cup)
    assert begin(state=window.state).outlines[2].diameter_mm == 5.0
    with pytest.raises(SceneError, match="2 objects"):
        open_path(StudioState(), Workspace.at(tmp_path), top, tmp_path / "out")


def test_what_is_known_so_far_is_shown(folder, found, looks, begin, settle, settled):
    """The first photograph, then the mean, then the balls in it; nothing of it can be changed yet."""
    steps, waits = [Event() for _ in range(3)], [Event() for _ in range(3)]

    def prepare(seen):
        for number, draft in enumerate((None, found.draft.with_balls([]), found.draft)):
            if draft is not None:
                seen(draft)
            steps[number].set()
            assert waits[number].wait(60)
        return found.draft

    looks[:] = [prepare]
    window = begin(folder)
    for number, (balls, told) in enumerate(((0, "Reading"), (0, "Looking for balls"), (3, "Looking at the scan"))):
        assert steps[number].wait(60)
        window.post(window.look_again)
        settle(window)
        assert len(window.outlines) == balls
        assert told in window.taken.told
        assert window.client.seen("/photograph/picture") is not None
        assert window.draft is None
        waits[number].set()
    settled(window)
    assert window.draft is not None
    assert not window.client.told


def test_what_fails_is_told_and_can_be_asked_again(folder, found, looks, begin, settled):
    """A folder that was looked at is not looked at again, unless it is opened again."""
    looks[:] = [SceneError("jug: 2 of 5 photographs can be read."), found.draft, found.draft.noting("y.")]
    window = settled(begin(folder))
    assert any("2 of 5 photographs" in told for told in window.client.told)
    for _ in range(2):
        assert settled(begin(state=window.state)).draft is found.draft, "once"
    assert settled(begin(folder)).draft.notes[-1] == "y."


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
    assert (state.area, state.session, set(state.looks)) == ("Session", (out, folder), {folder})
    with pytest.raises(SceneError, match="lies outside of the workspace"):
        studio(folder, out=folder.parent / "out", workspace=folder)
    (folder / "session.toml").write_text('[frames]\nflash = "flash_*.png"')
    state = opens(folder)
    assert (state.area, state.session, state.looks) == ("Session", (out, folder), {})
    (folder.parent / "empty").mkdir()
    with pytest.raises(SceneError, match="photometric stereo needs 3"):
        studio(folder.parent / "empty")


def test_no_name_breaks_out_of_the_shown_file():
    shown = fenced('flash = "a```b.png"', "toml")
    assert shown.startswith("````toml\n")
    assert shown.endswith("\n````")
