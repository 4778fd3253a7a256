"""A window without a browser: what is said is done in order, nothing is lost, and what a browser began ends with it."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from scene.files import write_npy
from studio.editor import edits
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.edits import with_value
from studio.editor.files_panel import FilesPanel
from studio.editor.panels import CameraPanel, LightsPanel, MaterialsPanel, ObjectsPanel
from studio.editor.scene_view import SceneView
from studio.opening import lay
from studio.own_files import put_own
from studio.tabs import Header
from studio.widgets import UNITS_PER_MM
from studio.workspace import MOST_FILES, Workspace
from twin.description.description_file import read_document, read_scene, write_document
from twin.description.light_groups import DistantLight
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Subsurface, Texture

MATTE = ("materials", "matte")


@pytest.fixture
def furnished(nobody, no_preview, tmp_path, furnish):
    """Return what makes a window with panels, whose client is `window.client`."""

    def made(*panels, document=None, folder=None):
        workspace = Workspace.at(tmp_path)
        window = EditorWindow(nobody(), workspace, no_preview, begun(workspace, document, folder))
        window.list_files()
        return furnish(window, panels)

    return made


def slowly(window):
    """Begin a change that takes as long as one likes; return what lets it end."""
    begun, end = threading.Event(), threading.Event()

    def edit(document):
        begun.set()
        assert end.wait(60)
        return with_value(document, ("environment", "ambient"), (0.1, 0.1, 0.1))

    window.post(lambda: window.change("slow", edit))
    assert begun.wait(60)
    return end.set


def test_what_is_typed_while_the_studio_is_at_work_is_kept(furnished, settle):
    """The inputs' values as they were said, not as the change before them left them; and none is set back meanwhile."""
    window = furnished(CameraPanel, MaterialsPanel)
    client, written = window.client, []
    window.change("gloss", lambda d: with_value(d, MATTE, RoughPlastic((0.5, 0.5, 0.5), 0.2)))
    focal, rough = client.input("fx, px"), client.input("roughness")

    @focal.on_update
    async def _(event):
        if event.client is None:
            written.append(event.target.value)

    written.clear()
    end = slowly(window)
    for text in ("9", "99", "999"):
        client.says(focal, float(text))
    client.says("max depth", 7)
    client.says(rough, 0.4)
    end()
    settle(window)
    assert window.scene.camera.fx == 999
    assert window.scene.sampling.max_depth == 7
    assert window.scene.materials["matte"].roughness == 0.4
    assert (focal.value, rough.value) == (999, 0.4)
    assert not written, "an input that is typed into is not set back"


def test_what_cannot_be_is_told_and_taken_out_of_the_input(furnished, settle):
    window = furnished(CameraPanel)
    client = window.client
    client.says("error", 3.0)
    settle(window)
    assert "expected less than 1" in client.told[0]
    assert client.input("error").value == 0.01
    assert window.document == edits.start_document()


def test_an_edit_changes_what_it_says_and_nothing_else(furnished, settle):
    below = Subsurface(3.0, (0.9, 0.5, 0.2), 0.3)
    was = RoughPlastic((0.2, 0.3, 0.4), 0.1, 0.5, 1.6, below, 0.25)
    window = furnished(MaterialsPanel, document=with_value(edits.start_document(), MATTE, was))
    for label, value, change in (
        ("roughness", 0.7, {"roughness": 0.7}),
        ("distribution", "beckmann", {"distribution": "beckmann"}),
        ("mean free path, mm", 5.0, {"subsurface": replace(below, mean_free_path_mm=5.0)}),
        ("body roughness", True, {"body_roughness": 0.5}),
        ("subsurface", False, {"subsurface": None}),
        ("subsurface", True, {"subsurface": Subsurface(2.0)}),
    ):
        inputs = [one for one in window.client.inputs(label) if isinstance(one.value, type(value))]
        window.client.says(inputs[-1], value)
        settle(window)
        was = replace(was, **change)
        assert window.scene.materials["matte"] == was, label
    window.client.says("kind", "diffuse")
    settle(window)
    assert window.scene.materials["matte"] == Diffuse(was.reflectance, was.subsurface), "what it has too is kept"


def test_what_a_panel_has_no_choice_for_is_shown(furnished):
    window = furnished(MaterialsPanel, document=with_value(edits.start_document(), MATTE, Conductor("Hg", 0.1)))
    assert window.client.input("metal").value == "Hg"


def test_one_number_typed_gives_no_colour(furnished, settle):
    """Three channels have one input, until they are asked for one by one."""
    window = furnished(LightsPanel)
    for label, found in (
        ("ambient", lambda: window.scene.environment.ambient),
        ("intensity", lambda: tuple(window.scene.lights.intensities[0])),
    ):
        window.client.says(label, 0.3)
        settle(window)
        assert found() == (0.3,) * 3
        window.client.says(f"{label} by channel", True)
        settle(window)
        window.client.says(f"{label} R, G, B", (0.3, 0.2, 0.1))
        settle(window)
        assert found() == (0.3, 0.2, 0.1)
        window.client.says(f"{label} by channel", False)
        settle(window)
        assert found() == (0.3,) * 3


def test_sizes_are_millimetres(furnished, settle):
    window = furnished(ObjectsPanel)
    assert np.allclose(window.client.input("size, mm").value, 120, atol=0.1)
    window.client.says("size, mm", (60.0, 120.0, 120.0))
    settle(window)
    np.testing.assert_allclose(np.ptp(window.scene.points, axis=0), 60, atol=0.1)


def test_lights_are_made_changed_and_singled_out(furnished, settle):
    window = furnished(LightsPanel)
    client = window.client
    client.says(client.inputs("kind")[0], "ring")
    client.says("Replace the lights")
    settle(window)
    assert window.scene.lights.names == tuple(f"ring_{i:03d}" for i in range(8))
    client.says("count", 5)
    settle(window)
    client.says(next(one for one in client.inputs("distance, mm") if one.value is False), True)
    settle(window)
    assert np.allclose(np.linalg.norm(window.scene.lights.positions_mm - [0, 0, -600], axis=1), 800)
    client.says(client.inputs("kind")[0], "point")
    client.says("Add to the lights")
    client.says("Single out")
    settle(window)
    assert [one.kind for one in window.document.lights] == ["point"] * 6
    client.says("Remove light")
    settle(window)
    assert len(window.scene.lights) == 5
    assert not client.told
    client.says(client.inputs("kind")[0], "session")
    client.says("Replace the lights")
    settle(window)
    assert "no session" in client.told[-1]


def test_a_picture_sent_again_is_read_again(furnished, settle, tmp_path):
    window = furnished(MaterialsPanel)
    for level, name in ((0, "uploads/a.png"), (255, "uploads/a_2.png")):
        window.client.sends("Send a texture from here", "a.png", png(level))
        settle(window)
        texture = window.scene.materials["matte"].reflectance
        assert isinstance(texture, Texture)
        assert texture.values.mean() == pytest.approx(level / 255, abs=1e-6)
        assert window.client.input("picture").value == name
    window.undo()
    assert window.client.input("picture").value == "uploads/a.png", "the first one is as it was"


def png(level):
    import cv2

    return cv2.imencode(".png", np.full((4, 4, 3), level, np.uint8))[1].tobytes()


def test_a_map_is_called_by_its_own_name(furnished, settle, tmp_path):
    for name in ("a", "b"):
        write_npy(tmp_path / f"{name}.npy", np.full((2, 4, 3), 0.3, np.float32))
    window = furnished(LightsPanel)
    for name in ("a.npy", "b.npy"):
        window.client.says("map", name)
        settle(window)
        assert window.client.input("map").value == name
    window.undo()
    assert window.client.input("map").value == "a.npy"
    window.undo()
    assert window.client.input("map").value == "(none)"


def test_two_presses_are_two_changes_and_typed_digits_one(furnished, settle):
    window = furnished(ObjectsPanel, CameraPanel)
    for _ in range(3):
        window.client.says("Add shape")
    for width in (64, 640, 64):
        window.client.says("width, px", width)
    window.client.says("height, px", 48)
    settle(window)
    # The sphere of a new scene made place for the first.
    assert len(window.scene.objects) == 3
    labels = [label for label, *_ in window.history.past]
    assert [label.split()[0] for label in labels] == ["add"] * 3 + ["camera"] * 2


def test_opening_and_beginning_anew_can_be_taken_back(furnished, settle, tmp_path):
    """Nothing is lost; and a scene that is taken back is saved to its own folder, not over the one opened meanwhile."""
    write_document(edits.start_document(), tmp_path / "a" / "other")
    theirs = (tmp_path / "a" / "other" / "scene.toml").read_text()
    window = furnished(Header, FilesPanel, CameraPanel)
    client = window.client
    client.says("width, px", 64)
    settle(window)
    lay(window.desk, window.workspace, tmp_path / "a" / "other" / "scene.toml")
    window.refresh()
    assert window.scene.camera.width == 640
    assert client.input("name").value == "a/other", "the folder that it came from, below the workspace"
    client.says("Undo")
    settle(window)
    assert window.scene.camera.width == 64
    assert client.input("name").value == "scene"
    client.says("name", "a/other")
    client.says("Save scene")
    settle(window)
    assert "holds another scene already" in client.told[-1]
    assert (tmp_path / "a" / "other" / "scene.toml").read_text() == theirs
    client.says("name", "mine")
    client.says("Save scene")
    client.says("New scene")
    settle(window)
    assert read_scene(tmp_path / "mine" / "scene.toml").camera.width == 64
    client.says("name", "mine")
    client.says("Save scene")
    settle(window)
    assert "holds another scene already" in client.told[-1], "a new scene is another one"
    client.says("Undo")
    client.says("width, px", 80)
    client.says("Save scene")
    settle(window)
    assert read_scene(tmp_path / "mine" / "scene.toml").camera.width == 80, "its own it may write over"


@pytest.mark.parametrize("where", ["a/penguin", "."])
def test_a_scene_is_saved_where_it_was_opened_from(furnished, settle, tmp_path, where):
    folder = (tmp_path / where).resolve()
    path = folder / "scene.toml"
    put_own(folder, lambda place: write_document(with_value(edits.start_document(), ("name",), "penguin"), place))
    window = furnished(FilesPanel, CameraPanel, document=read_document(path), folder=folder)
    window.client.says("width, px", 64)
    window.client.says("Save scene")
    settle(window)
    assert window.client.told == [f"Saved: {path.relative_to(tmp_path)}"]
    saved = read_scene(path)
    assert (saved.camera.width, saved.name) == (64, "penguin")
    assert not (tmp_path / "penguin").exists()


@pytest.mark.parametrize("link", ["meshes", "textures", "scene.toml", "export"])
def test_nothing_is_written_through_a_link_that_leads_out(furnished, settle, tmp_path_factory, tmp_path, link):
    outside = tmp_path_factory.mktemp("outside")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / link).symlink_to(outside / link if link == "scene.toml" else outside)
    window = furnished(FilesPanel)
    window.client.says("name", "mine")
    window.client.says("Export for Mitsuba")
    settle(window)
    assert not list(outside.iterdir())


def test_lists_that_end_say_so(furnished, tmp_path):
    for number in range(MOST_FILES):
        (tmp_path / f"{number:03d}.ply").touch()
    (tmp_path / "ring").mkdir()
    (tmp_path / "ring" / "lights.json").touch()
    window = furnished(ObjectsPanel, LightsPanel)
    assert not window.client.told
    assert window.client.input("session").options == ("ring",)
    (tmp_path / "one_more.ply").touch()
    window.list_files()
    window.refresh()
    assert len(window.client.input("model").options) == MOST_FILES
    assert "Not every file is listed" in window.client.told[-1]


def test_a_refresh_looks_at_no_disk(furnished, settle, monkeypatch):
    window = furnished(ObjectsPanel, MaterialsPanel, LightsPanel, FilesPanel)

    def walked(*_):
        raise AssertionError("the workspace is walked at a refresh")

    monkeypatch.setattr(Workspace, "_walk", walked)
    window.client.says("Add shape")
    settle(window)
    assert not window.client.told


def test_names_are_shown_as_they_are(furnished):
    """Neither HTML nor Markdown: a file may come from anywhere."""
    name = '<img src=x onerror="alert(1)"> *b* `c`'
    window = furnished(LightsPanel)
    window.change("names", lambda d: with_value(d, ("lights",), (DistantLight(name=name, direction=(0, 0, 1)),)))
    shown = window.panels[0]._text.content
    assert rendered(shown).startswith(f"<p><strong>{escaped(name)}</strong>")


def rendered(markdown):
    from markdown_it import MarkdownIt

    return MarkdownIt("commonmark", {"html": True}).render(markdown)


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")


def test_a_drag_is_worked_out_in_the_windows_thread(furnished, settle, monkeypatch):
    """No mesh of a million vertices keeps the browser's messages waiting; and twice as far is twice as large."""
    window, threads = furnished(SceneView), []
    middle, scaled = edits.placement(window.document, 0).middle_mm, edits.scaled

    def watched(*given):
        threads.append(threading.current_thread().name)
        return scaled(*given)

    monkeypatch.setattr(edits, "scaled", watched)
    places = [(middle + [reach, 0, 0]) * UNITS_PER_MM for reach in (60.0, 90.0, 120.0)]
    window.client.drags(window.client.seen("/object_0/scale"), *places)
    settle(window)
    assert threads
    assert all(name.startswith("window 1") for name in threads)
    now = edits.placement(window.document, 0)
    np.testing.assert_allclose(now.scale, 2 * np.array([60.0, 60, 60]))
    np.testing.assert_allclose(now.middle_mm, middle, atol=1e-9)
    assert [label for label, *_ in window.history.past] == ["drag scale"]


def test_what_waits_is_dropped_when_the_window_is_closed(furnished, no_preview):
    """What is at work comes to its end, and whoever closes the window does not wait for it."""
    window = furnished()
    begun_, go_on, done = threading.Event(), threading.Event(), []

    def starts():
        begun_.set()
        assert go_on.wait(60)
        done.append("ended")
        window.refresh()

    window.post(starts)
    window.post(lambda: done.append("another began"))
    assert begun_.wait(60)
    window.close()
    assert done == []
    go_on.set()
    window.wait()
    assert done == ["ended"]
    assert no_preview.asked[-1] == ("forget", 1), "a request after that would be kept for good"
    window.post(lambda: done.append("later"))
    window.close()
    assert done == ["ended"]
