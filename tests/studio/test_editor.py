"""The scene editor's window without a browser: what is said in it is done, in order, and nothing else is changed."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from formats.meshes.scan_files import write_mesh
from scene.errors import SceneError
from scene.mesh import Mesh
from scene.store import Store
from studio.editor import edits
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.edits import with_value
from studio.editor.scene_rows import SCENE_ROWS
from studio.opening import entries, open_path
from studio.studio_state import StudioState
from studio.workspace import Workspace, put_own
from twin.description.description_file import read_document, read_scene, write_document
from twin.description.light_groups import DistantLight
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Subsurface, Texture
from twin.description.object_mesh import built_in

MATTE = ("materials", "matte")


@pytest.fixture
def furnished(nobody, no_preview, tmp_path, furnish):
    """Return what makes a window with all rows."""

    def made(*views, document=None, folder=None):
        workspace = Workspace.at(tmp_path)
        state = StudioState(edits={"Scene": begun(workspace, document, folder)})
        window = furnish(EditorWindow(nobody(), workspace, state, no_preview), SCENE_ROWS, *views)
        for tab in ("Material", "Lights", "Camera", "Dataset", "Objects"):
            window.open_tab(tab)
        return window

    return made


def test_what_is_typed_while_the_studio_is_at_work_is_kept(furnished, settle):
    """The inputs' values as they were said, not as the change before them left them; and none is set back meanwhile."""
    window = furnished()
    client, written, begun_, end = window.client, [], threading.Event(), threading.Event()
    window.change("gloss", lambda d: with_value(d, MATTE, RoughPlastic((0.5, 0.5, 0.5), 0.2)))
    focal, rough = client.input("fx, px"), client.input("roughness")

    @focal.on_update
    async def _(event):
        if event.client is None:
            written.append(event.target.value)

    def slow(document):
        begun_.set()
        assert end.wait(60)
        return with_value(document, ("environment", "ambient"), (0.1, 0.1, 0.1))

    window.post(lambda: window.change("slow", slow))
    assert begun_.wait(60)
    for text in ("9", "99", "999"):
        client.says(focal, float(text))
    client.says("max depth", 7)
    client.says(rough, 0.4)
    end.set()
    settle(window)
    assert window.scene.camera.fx == 999
    assert window.scene.sampling.max_depth == 7
    assert window.scene.materials["matte"].roughness == 0.4
    assert (focal.value, rough.value) == (999, 0.4)
    assert not written, "an input that is typed into is not set back"


def test_what_cannot_be_is_told_and_taken_out_of_the_input(furnished, say):
    window = furnished()
    say(window, ("error", 3.0))
    assert "expected less than 1" in window.client.told[0]
    assert window.client.input("error").value == 0.01
    assert window.document == edits.start_document()


def test_an_edit_changes_what_it_says_and_nothing_else(furnished, say):
    below = Subsurface(3.0, (0.9, 0.5, 0.2), 0.3)
    was = RoughPlastic((0.2, 0.3, 0.4), 0.1, 0.5, 1.6, below)
    window = furnished(document=with_value(edits.start_document(), MATTE, was))
    for label, value, change in (
        ("roughness", 0.7, {"roughness": 0.7}),
        ("distribution", "beckmann", {"distribution": "beckmann"}),
        ("mean free path, mm", 5.0, {"subsurface": replace(below, mean_free_path_mm=5.0)}),
        ("body roughness", True, {"body_roughness": 0.5}),
        ("subsurface", False, {"subsurface": None}),
        ("subsurface", True, {"subsurface": Subsurface(2.0)}),
    ):
        inputs = [one for one in window.client.inputs(label) if isinstance(one.value, type(value))]
        say(window, (inputs[-1], value))
        was = replace(was, **change)
        assert window.scene.materials["matte"] == was, label
    say(window, (window.client.inputs("kind")[0], "diffuse"))
    assert window.scene.materials["matte"] == Diffuse(was.reflectance, was.subsurface), "what it has too is kept"
    window.change("metal", lambda d: with_value(d, MATTE, Conductor("Hg", 0.1)))
    assert window.client.input("metal").value == "Hg", "what there is no choice for is shown"


def test_lights_are_made_changed_and_singled_out(furnished, tmp_path, say):
    window = furnished()
    say(window, ("kind", "ring"), "Replace the lights")
    assert window.scene.lights.names == tuple(f"ring_{i:03d}" for i in range(8))
    box = next(one for one in window.client.inputs("distance, mm") if one.value is False)
    say(window, ("count", 5), (box, True))
    assert np.allclose(np.linalg.norm(window.scene.lights.positions_mm - [0, 0, -600], axis=1), 800)
    say(window, ("kind", "point"), "Add to the lights", "Single out")
    assert [one.kind for one in window.document.lights] == ["point"] * 6
    say(window, "Remove light")
    assert len(window.scene.lights) == 5
    assert not window.client.told
    say(window, ("kind", "session"), "Replace the lights")
    assert "no session" in window.client.told[-1]
    window.state.session = tmp_path, None
    Store(tmp_path).save_lights(window.scene.lights)
    say(window, "Replace the lights")
    assert window.scene.lights.names == Store(tmp_path).load_lights().names


def test_a_model_is_opened_into_the_scene(furnished, tmp_path, say):
    """As one that is sent, and it can be taken back."""
    cone = built_in("cone")
    write_mesh(tmp_path / "cone.ply", Mesh(cone.vertices * 40, cone.faces))
    assert dict(entries(tmp_path))[tmp_path / "cone.ply"] == "model"
    window = furnished()
    open_path(window.state, window.workspace, tmp_path / "cone.ply")
    window.refresh()
    assert (window.state.area, [one.name for one in window.scene.objects]) == ("Scene", ["cone"])
    say(window, "Undo")
    assert window.document == edits.start_document()


def test_a_picture_sent_again_is_read_again(furnished, settle):
    import cv2

    window = furnished()
    for level, name in ((0, "uploads/a.png"), (255, "uploads/a_2.png")):
        picture = cv2.imencode(".png", np.full((4, 4, 3), level, np.uint8))[1].tobytes()
        window.client.sends(window.client.inputs("Send a texture from here")[0], "a.png", picture)
        settle(window)
        texture = window.scene.materials["matte"].reflectance
        assert isinstance(texture, Texture)
        assert texture.values.mean() == pytest.approx(level / 255, abs=1e-6)
        assert window.client.input("picture").value == name
    window.undo()
    assert window.client.input("picture").value == "uploads/a.png", "the first one is as it was"


def test_a_broken_file_is_told_and_the_scene_is_as_it_was(furnished, settle, say):
    window = furnished()
    before, broken = window.scene, b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n1 2\n"
    for button, name, content in (("Load model", "b.ply", broken), ("Send a texture from here", "j.png", b"none")):
        window.client.sends(window.client.inputs(button)[0], name, content)
        settle(window)
        assert "That cannot be done" in window.client.told[-1]
        assert name in window.client.told[-1]
        assert window.scene is before
    assert window.client.input("picture").value == "(the colour)"
    say(window, "Add shape")
    assert window.scene is not before


def test_opening_and_beginning_anew_can_be_taken_back(furnished, tmp_path, say):
    """Nothing is lost; and a scene that is taken back is saved to its own folder, not over the one opened meanwhile."""
    write_document(edits.start_document(), tmp_path / "a" / "other")
    theirs = (tmp_path / "a" / "other" / "scene.toml").read_text()
    window = furnished()
    client = window.client
    say(window, ("width, px", 64))
    open_path(window.state, window.workspace, tmp_path / "a" / "other" / "scene.toml")
    window.refresh()
    assert window.scene.camera.width == 640
    assert client.input("name").value == "a/other", "the folder that it came from, below the workspace"
    say(window, "Undo")
    assert window.scene.camera.width == 64
    assert client.input("name").value == "scene"
    say(window, ("name", "a/other"), "Save scene")
    assert "holds another scene already" in client.told[-1]
    assert (tmp_path / "a" / "other" / "scene.toml").read_text() == theirs
    say(window, ("name", "mine"), "Save scene", "New scene")
    assert read_scene(tmp_path / "mine" / "scene.toml").camera.width == 64
    say(window, ("name", "mine"), "Save scene")
    assert "holds another scene already" in client.told[-1], "a new scene is another one"
    say(window, "Undo", ("width, px", 80), "Save scene")
    assert read_scene(tmp_path / "mine" / "scene.toml").camera.width == 80, "its own it may write over"


@pytest.mark.parametrize("where", ["a/penguin", "."])
def test_a_scene_is_saved_where_it_was_opened_from(furnished, tmp_path, say, where):
    folder = (tmp_path / where).resolve()
    path = folder / "scene.toml"
    put_own(folder, lambda place: write_document(with_value(edits.start_document(), ("name",), "penguin"), place))
    window = furnished(document=read_document(path), folder=folder)
    say(window, ("width, px", 64), "Save scene")
    assert window.client.told == [f"Saved: {path.relative_to(tmp_path)}"]
    saved = read_scene(path)
    assert (saved.camera.width, saved.name) == (64, "penguin")
    assert not (tmp_path / "penguin").exists()


@pytest.mark.parametrize("name", ["meshes", "scene.toml", "export", "export/scene.xml", "export/meshes/00.ply"])
def test_nothing_foreign_is_written_over_nor_through_a_link_that_leads_out(
    furnished, say, tmp_path_factory, tmp_path, name
):
    outside, place = tmp_path_factory.mktemp("outside"), tmp_path / "mine" / name
    place.parent.mkdir(parents=True)
    if name in ("meshes", "export"):
        place.symlink_to(outside)
    else:
        place.write_text("mine")
    folder = tmp_path / "mine" if name == "scene.toml" else None
    window = furnished(document=edits.start_document(), folder=folder)
    say(window, ("name", "mine"), "Export for Mitsuba")
    assert not list(outside.iterdir())
    if place.is_file():
        assert "rgbn did not write it" in window.client.told[-1], window.client.told
        assert place.read_text() == "mine"


def test_names_are_shown_as_they_are(furnished):
    """Neither HTML nor Markdown: a file may come from anywhere."""
    from markdown_it import MarkdownIt

    name = '<img src=x onerror="alert(1)"> *b* `c`'
    window = furnished()
    window.change("names", lambda d: with_value(d, ("lights",), (DistantLight(name=name, direction=(0, 0, 1)),)))
    (shown,) = [text for text in window.client.shown() if "1 of 1" in text]
    escaped = name.replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
    assert MarkdownIt("commonmark", {"html": True}).render(shown).startswith(f"<p><strong>{escaped}</strong>")


def test_what_waits_is_dropped_when_the_window_is_closed(furnished):
    """What is at work comes to its end, and whoever closes the window does not wait for it."""
    window = furnished()
    begun_, go_on, done = threading.Event(), threading.Event(), []

    def starts():
        begun_.set()
        assert go_on.wait(60)
        done.append("ended")
        window.change("late", lambda d: with_value(d, ("camera", "width"), 64))

    window.post(starts)
    window.post(lambda: done.append("another began"))
    assert begun_.wait(60)
    window.close()
    assert done == []
    go_on.set()
    window.wait()
    assert done == ["ended"]
    window.post(lambda: done.append("later"))
    window.close()
    assert done == ["ended"]


def test_what_cannot_be_opened_changes_no_area(tmp_path):
    """A scene at fault, and a folder that is gone: the input is at fault, and the studio stays where it was."""
    (tmp_path / "scene.toml").write_text("name = [")
    state = StudioState(area="Open")
    with pytest.raises(SceneError, match=r"scene\.toml"):
        open_path(state, Workspace.at(tmp_path), tmp_path / "scene.toml")
    assert state.area == "Open"
    with pytest.raises(SceneError, match=r"gone: cannot be read"):
        list(entries(tmp_path / "gone"))
