"""The window of a new session without a browser: what is typed, clicked and chosen, and what is written."""

from concurrent.futures import Future
from dataclasses import replace
from types import SimpleNamespace

import pytest

from capture.session.manifest import SphereTable
from capture.session.session import load_session
from capture.session.session_types import Lens
from capture.survey.folder_files import survey
from scene.errors import SceneError
from shoot.init import init_session
from shoot.init.draft_notes import notes_of
from studio.new_session.capture_panels import DiametersPanel, LensPanel, ObjectPanel, PhotographsPanel
from studio.new_session.found_capture import Looking
from studio.new_session.found_panel import FoundPanel, TextPanel, WritePanel
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photograph_roles import role_of, with_role
from studio.new_session.photographs_view import PhotographsView
from studio.photograph.plane import Plane
from studio.studio_command import studio
from studio.widgets import fenced
from studio.workspace import Workspace

SIZE = Plane(80, 60)
PANELS = (FoundPanel, DiametersPanel, PhotographsPanel, LensPanel, ObjectPanel, TextPanel, WritePanel, PhotographsView)


def looked(looking, files):
    """Wait until a folder was looked at."""
    done = Future()
    looking.ask(files, lambda done, total: None, done.set_result)
    return done.result(60)


@pytest.fixture
def begun(folder, found, nobody, no_preview, furnish, settle, monkeypatch):
    """Return what makes a window on the folder with its panels, as soon as it was looked at."""
    monkeypatch.setattr("studio.new_session.found_capture.look", lambda files, progress: (progress(1, 2), found)[1])

    def furnished(*panels):
        looking = Looking(survey(folder), folder.parent / "out" / "jug")
        window = NewSessionWindow(nobody(), Workspace.at(folder.parent), no_preview, looking)
        furnish(window, panels)
        window.open(window.files)
        assert looked(looking, window.files).result() is found
        settle(window)
        assert window.capture is not None
        return window

    return furnished


def test_the_panels_write_what_they_show(begun, folder, settle):
    """Typed, clicked and chosen in the panels; the file holds it, and nothing else in the folder is touched."""
    before = {path: path.read_bytes() for path in folder.rglob("*")}
    window = begun(*PANELS)
    client = window.client

    def say(label, value=True):
        client.says(label, value)
        settle(window)

    def diameters():
        return [ball.diameter_mm for ball in window.outlines]

    say("chrome balls, mm", 40.0)
    say("white balls, mm", 38.5)
    assert not client.input("white balls, mm").disabled
    assert window.capture.scan_told.endswith("unit mm: the object looks 80 mm large"), "the balls tell the scan's unit"
    say("scan_unit", "cm")
    assert any("as with unit mm" in note for note in notes_of(window.capture))
    say("scan_unit", "(by the object's size)")
    say("focal_mm", 50.0)
    say("Write session")
    assert "without the size of the sensor" in client.told[-1]
    say("sensor_mm", 3600.0)
    assert "expected 1 to 250" in client.told[-1]
    say("sensor_mm", 36.0)
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
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.name != "session.toml"} == before
    session = load_session(folder)
    assert [path.name for path in session.flash] == ["flash_0.png", "flash_1.png", "flash_3.png", "flash_4.png"]
    rows = [(one.kind, one.diameter_mm, one.center_px, one.radius_px) for one in session.spheres]
    assert rows == [("chrome", 40.0, (21.0, 15.0), 8.0), ("chrome", 40.0, (60.0, 15.0), 7.5)]
    assert session.mask == folder / "mask.png"
    assert (session.scan_unit, session.camera) == ("mm", Lens(focal_mm=50.0, sensor_mm=36.0))
    desk = window.desk
    assert (desk.area, desk.review) == ("Session", (folder.parent / "out" / "jug", folder)), "it goes on there"
    assert window.capture is None, "nothing here changes it any more"


def test_what_cannot_be_written_is_not(begun, folder, nobody, no_preview, monkeypatch):
    """Before the folder was looked at, over a file that is there, outside of the workspace, or not to be read again."""
    window = NewSessionWindow(nobody(), Workspace.at(folder.parent), no_preview, Looking(survey(folder)))
    panel = WritePanel(window)
    panel.refresh()
    assert not window.client.input("Write session").visible
    window.close()
    window.wait()
    window = begun()
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
    assert window.desk.area == "Open"


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


def test_each_object_keeps_what_was_put_right(tmp_path, found, nobody, no_preview, furnish, settle, monkeypatch):
    """Two objects in a folder: one is looked at when it is chosen, and the other is as it was left."""
    top = tmp_path / "shelf"
    for name in ("cup", "jug"):
        (top / name).mkdir(parents=True)
        for path in found.draft.photographs["flash"]:
            (top / name / path.name).write_bytes(path.read_bytes())
    (top / "cup" / "session.toml").write_text("")
    monkeypatch.setattr("studio.new_session.found_capture.look", lambda files, progress: found)
    looking = Looking(survey(top))
    assert [looking.out_of(one).name for one in looking.folders] == ["cup", "jug"]
    window = NewSessionWindow(nobody(), Workspace.at(tmp_path), no_preview, looking)
    furnish(window, [FoundPanel])
    assert tuple(window.client.input("object").options) == ("cup (has a session.toml)", "jug")
    assert window.files.folder.name == "jug", "where there is something to do"

    def turn(files):
        window.post(lambda: window.open(files))
        looked(looking, files)
        settle(window)
        settle(window)

    def white():
        return window.outlines[2].diameter_mm

    cup, jug = looking.folders
    turn(jug)
    window.post(lambda: window.measure("white", 5.0))
    turn(cup)
    assert window.capture is None
    assert window.client.input("Open its session").visible
    (top / "cup" / "session.toml").unlink()
    turn(cup)
    assert white() is None
    turn(jug)
    assert white() == 5.0
    assert not window.client.input("Open its session").visible
    with pytest.raises(SceneError, match="2 objects"):
        Looking(looking.folders, tmp_path / "out")


def test_what_fails_is_told_and_can_be_asked_again(begun, found, settle, monkeypatch):
    answers = [
        SceneError("jug: 2 of 5 photographs can be read."),
        found,
        replace(found, draft=found.draft.noting("y.")),
    ]

    def look(files, progress):
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    window = begun(FoundPanel)
    monkeypatch.setattr("studio.new_session.found_capture.look", look)
    window.looking = looking = Looking(window.looking.folders)
    window.desk.captures.clear()
    window.post(lambda: window.open(window.files))
    settle(window)
    looked(looking, window.files)
    settle(window)
    assert any("2 of 5 photographs" in told for told in window.client.told)
    assert looked(looking, window.files).result() is looked(looking, window.files).result() is found
    looking.forget(window.files.folder)
    assert looked(looking, window.files).result().draft.notes[-1] == "y.", "it is looked at again"


def test_typing_and_marking_are_undone_one_by_one(begun, settle):
    window = begun(*PANELS)
    window.client.says("chrome balls, mm", 40.0)
    window.client.says("ball", "2: chrome")
    window.client.says("Remove this ball")
    settle(window)
    assert [ball.diameter_mm for ball in window.outlines] == [40.0, None]
    window.undo()
    assert [ball.diameter_mm for ball in window.outlines] == [40.0, 40.0, None]
    window.undo()
    assert window.client.input("chrome balls, mm").value == 0.0
    window.redo()
    assert [ball.diameter_mm for ball in window.outlines] == [40.0, 40.0, None]


def test_no_name_breaks_out_of_the_shown_file():
    shown = fenced('flash = "a```b.png"', "toml")
    assert shown.startswith("````toml\n")
    assert shown.endswith("\n````")


def test_the_command_opens_what_a_path_is(folder, monkeypatch):
    """Before the page opens: no photographs, or an output folder outside of the workspace, end it with one message."""
    asked, opened = [], []

    def begin(place, **how):
        asked.append(how["desk"])
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
    desk = opens(folder)
    assert opened == ["http://127.0.0.1:1"], "the system's browser"
    assert (desk.area, desk.looking.out_of(desk.looking.folders[0])) == ("New session", folder.parent / "out" / "jug")
    with pytest.raises(SceneError, match="lies outside of the workspace"):
        studio(folder, out=folder.parent / "out", workspace=folder)
    (folder / "session.toml").write_text('[frames]\nflash = "flash_*.png"')
    desk = opens(folder)
    assert (desk.area, desk.review) == ("Session", (folder.parent / "out" / "jug", folder))
    (folder.parent / "empty").mkdir()
    with pytest.raises(SceneError, match="photometric stereo needs 3"):
        studio(folder.parent / "empty")
