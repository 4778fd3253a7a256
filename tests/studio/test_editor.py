"""The scene editor without a browser: laws of edits, windows that do what is said in order, the preview's pictures."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from formats.meshes.scan_files import write_mesh
from scene.current import fingerprint
from scene.errors import RenderError, SceneError
from scene.mesh import Mesh
from scene.pose import rotation_from_vector
from scene.store import Store
from studio.editor import edits
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.edits import quaternion, with_value
from studio.editor.preview import Preview, rendered
from studio.editor.scene_rows import SCENE_ROWS
from studio.opening import entries, open_path
from studio.studio_state import TOGETHER_S, History, StudioState
from studio.widgets import display_mesh
from studio.workspace import Workspace, put_own
from twin.description.description_file import read_document, read_scene, write_document
from twin.description.light_groups import AreaLight, DistantLight, GridTable, RingTable
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


class Shown:
    """What a browser was shown, in order."""

    def __init__(self):
        self.rows, self._change = [], threading.Condition()

    def __call__(self, drawn):
        with self._change:
            self.rows.append(drawn)
            self._change.notify_all()

    def until(self, light, *, is_refined):
        """Wait until a light's picture was shown, and return it."""
        with self._change:
            here = lambda: [one for one in self.rows if (one.light, one.is_refined) == (light, is_refined)]  # noqa: E731
            assert self._change.wait_for(here, 120), self.rows
            return here()[0]


@pytest.fixture
def running():
    one = Preview()
    yield one
    one.close()


def made_of(material, **around):
    document = with_value(edits.start_document(), MATTE, material)
    return with_value(document, ("environment", "ambient"), around.get("ambient", (0.0, 0.0, 0.0))).scene()


def drawn(scene, light=0, *, is_refined=True):
    return rendered(scene, light, "refined" if is_refined else "first picture")


@pytest.mark.render
def test_a_light_shines_from_where_its_arrow_stands():
    """From the upper left: the ball is bright there, dark at the lower right."""
    document = edits.start_document()
    reference = document.scene().lights.reference_point_mm
    scene = edits.moved_light(document, 0, reference + [-200, 200, 60]).scene()
    picture = drawn(scene, is_refined=False).mean(-1)
    assert picture.shape == (120, 160)
    assert picture[:60, :80].mean() > 5 * picture[60:, 80:].mean()


@pytest.mark.render
@pytest.mark.parametrize(
    "material", [Diffuse((0.7, 0.3, 0.1)), RoughPlastic((0.6, 0.1, 0.3), 0.2), Conductor("Al", 0.3)]
)
def test_the_first_picture_is_the_refined_one_made_small(material):
    scene = made_of(material)
    rough, fine = drawn(scene, 20, is_refined=False), drawn(scene, 20)
    small = fine.reshape(120, 2, 160, 2, 3).mean((1, 3))
    assert np.corrcoef(rough.ravel(), small.ravel())[0, 1] > 0.98
    assert rough.mean() == pytest.approx(small.mean(), rel=0.05)


@pytest.mark.render
def test_a_mirror_shows_an_even_environment():
    mirror = made_of(Conductor("none", 0.0), ambient=(0.3, 0.2, 0.1))
    np.testing.assert_allclose(drawn(mirror)[120, 160], [0.3, 0.2, 0.1], rtol=1e-3)


@pytest.mark.render
def test_only_the_newest_wish_is_refined_and_a_fault_is_told(running):
    shown, small = Shown(), made_of(Diffuse((0.5, 0.5, 0.5)))
    # A texture on a mesh that has nowhere to put it.
    bare = Mesh(built_in("sphere").vertices, built_in("sphere").faces)
    broken = edits.added(edits.start_document(), "bare", mesh=bare)
    broken = with_value(broken, MATTE, Diffuse(Texture(np.ones((2, 2, 3))))).scene()
    for _ in range(5):
        running.request(small, 0, shown)
    running.request(broken, 1, shown)
    assert "has no texture coordinates" in shown.until("light_001", is_refined=True).fault
    assert [one.light for one in shown.rows if one.is_refined] == ["light_001"]
    running.request(small, 2, shown)
    assert shown.until("light_002", is_refined=True).picture.max() > 0.1


def test_the_display_mesh_has_few_triangles_and_the_same_outline(monkeypatch):
    sphere = built_in("sphere")
    assert display_mesh(sphere.vertices, sphere.faces)[1] is sphere.faces
    monkeypatch.setattr("studio.widgets.MOST_FACES", 5000)
    vertices, faces = display_mesh(sphere.vertices * [60, 40, 20], sphere.faces)
    assert 1500 < len(faces) <= 5000
    assert abs(np.linalg.norm(vertices / [60, 40, 20], axis=1) - 1).max() < 0.05
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 60 * 40 * 20, rel=0.05), "closed, and turned outward"


ANGLE = st.floats(-89, 89)
FACTOR = st.floats(0.2, 5)
PLACE = st.floats(-300, 300)


def off_centre(stretch=(1, 1, 1)):
    """A mesh whose origin lies far from its middle, as a scan's does."""
    cube = built_in("cube")
    vertices = (cube.vertices * [3, 2, 1] + [40, -70, 25]) * stretch
    return Mesh(vertices, cube.faces, cube.normals, cube.texcoords)


def one_object(mesh=None):
    return edits.added(edits.start_document(), "thing", mesh=mesh or off_centre())


def vertices(document, index=0):
    return document.scene().objects[index].placed.vertices


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(PLACE, PLACE, PLACE),
    st.tuples(st.floats(-179, 179), ANGLE, st.floats(-179, 179)),
    st.tuples(st.one_of(FACTOR, FACTOR.map(lambda x: -x)), FACTOR, FACTOR),
)
def test_a_matrix_is_said_in_numbers(place, angles, scale):
    """About x, then y, then z, the axes standing still; the placement's middle is the mesh's."""
    matrix, turn = np.eye(4), Rotation.from_euler("xyz", angles, degrees=True)
    matrix[:3, :3], matrix[:3, 3] = turn.as_matrix() * scale, place
    document = edits.with_matrix(one_object(), 0, matrix)
    table, found = document.objects[0], edits.placement(document, 0)
    np.testing.assert_allclose(table.rotate_deg, angles, atol=1e-5)
    np.testing.assert_allclose(table.scale, scale, rtol=1e-9)
    np.testing.assert_allclose(table.translate_mm, place)
    np.testing.assert_allclose(found.middle_mm, matrix[:3, :3] @ [40, -70, 25] + place, atol=1e-7)
    np.testing.assert_allclose(found.size_mm, np.abs(scale) * np.array([6, 4, 2]))
    turned = Rotation.from_quat(quaternion(found.rotation), scalar_first=True)
    np.testing.assert_allclose(turned.as_matrix(), turn.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(vertices(document), off_centre().vertices @ matrix[:3, :3].T + place, atol=1e-6)


def test_a_size_is_in_millimetres_and_in_proportion_if_that_is_asked_for():
    """About the middle, which stays."""
    document = edits.added(edits.start_document(), "ball", shape="sphere")
    was = edits.placement(document, 0)
    np.testing.assert_allclose(was.size_mm, 120, atol=0.1)
    wanted = (50.0, *was.size_mm[1:])
    for in_proportion, expected in ((True, 50), (False, [50, 120, 120])):
        now = edits.sized(document, 0, wanted, in_proportion=in_proportion)
        np.testing.assert_allclose(np.ptp(vertices(now), axis=0), expected, atol=0.1)
        np.testing.assert_allclose(edits.placement(now, 0).middle_mm, was.middle_mm, atol=1e-9)
    with pytest.raises(RenderError, match="above 0"):
        edits.sized(document, 0, (0.0, 1.0, 1.0), in_proportion=True)


def test_a_gizmo_moves_rigidly_about_the_middle():
    """Where the file has a matrix that shears, too."""
    shear = ((1.0, 0.3, 0.0, 4.0), (0.0, 1.2, 0.0, 5.0), (0.0, 0.0, 1.0, -20.0), (0.0, 0.0, 0.0, 1.0))
    rotation, there = rotation_from_vector(np.array([0.3, -0.8, 0.5])), np.array([11.0, -20.0, -500.0])
    for document in (one_object(), with_value(one_object(), ("objects", 0, "matrix"), shear)):
        was, before = edits.placement(document, 0), vertices(document)
        turn = rotation @ was.rotation.T
        now = edits.turned(document, 0, there, rotation)
        np.testing.assert_allclose(vertices(now), (before - was.middle_mm) @ turn.T + there, atol=1e-9)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (6, 1, 1), (1, 9, 2)])
def test_a_loaded_model_fills_the_picture_and_stays_inside(stretch):
    """In millimetres as it is, whatever its size; nearer than 0.8 of the picture no corner comes."""
    mesh = off_centre(stretch)
    document = one_object(mesh)
    scene, placed = document.scene(), vertices(document)
    assert [one.name for one in scene.objects] == ["thing"], "the sphere of a new scene makes place"
    np.testing.assert_allclose(np.ptp(placed, axis=0), np.ptp(mesh.vertices, axis=0))
    filled = np.ptp(scene.camera.project(placed), axis=0) / [scene.camera.width, scene.camera.height]
    assert filled.max() == pytest.approx(edits.FILLED, abs=1e-6)
    np.testing.assert_allclose(scene.lights.reference_point_mm, (placed.min(0) + placed.max(0)) / 2, atol=1e-9)
    assert len(edits.added(document, "thing", mesh=mesh).objects) == 2


@pytest.mark.parametrize("distance", [None, 500.0])
def test_a_light_is_dragged_to_where_it_is_let_go(distance):
    """Of a group it is singled out, and the others stay; distant ones shine from there."""
    ring = RingTable(count=5, polar_deg=40.0, distance_mm=distance, radius_mm=distance and 9.0)
    document = with_value(one_object(), ("lights",), (GridTable(rings=2, around=4, distance_mm=distance), ring))
    was = document.scene()
    place = was.lights.reference_point_mm + [-200, 100, 200]
    moved = edits.moved_light(document, 9, place)
    now = moved.scene()
    np.testing.assert_allclose(now.lights.directions[9], [-2 / 3, 1 / 3, 2 / 3])
    others = np.arange(13) != 9
    np.testing.assert_allclose(now.lights.directions[others], was.lights.directions[others], atol=1e-12)
    np.testing.assert_array_equal(now.radii_mm, was.radii_mm)
    assert now.lights.names == was.lights.names
    assert isinstance(moved.lights[0], GridTable), "other groups stay groups"
    if distance:
        np.testing.assert_allclose(now.lights.positions_mm[9], place)
        assert isinstance(moved.lights[2], AreaLight)
    with pytest.raises(RenderError, match="reference point"):
        edits.moved_light(document, 9, was.lights.reference_point_mm).scene()


def test_what_may_not_be_is_told_with_its_key_and_nothing_is_changed():
    document = one_object()
    for place, value, told in (
        (("sampling", "error"), 3.0, "error: found 3.0; expected less than 1"),
        (("materials", "matte", "reflectance"), "red", "reflectance: found 'red'"),
        (("camera", "width"), 0, "width: found 0"),
        (("lights", 0, "radius_mm"), 5.0, "^radius_mm: .*; radius_mm wants distance_mm"),
        (("lights",), (), "expected 1 to"),
    ):
        with pytest.raises(RenderError, match=told):
            with_value(document, place, value)
    for key in ("objects", "lights"):
        with pytest.raises(RenderError, match="only one"):
            edits.without(document, key, 0)


EDITS = {
    "add": lambda d: edits.added(d, "ball", shape="sphere"),
    "move": lambda d: edits.turned(d, 0, np.array([1.0, 2, -700]), np.eye(3)),
    "scale": lambda d: with_value(d, ("objects", 0, "scale"), (2.0, 2.0, 2.0)),
    "material": lambda d: with_value(d, ("materials", "matte"), Diffuse((0.1, 0.2, 0.3))),
    "light": lambda d: edits.moved_light(d, 0, [1, 2, 3]),
    "intensity": lambda d: with_value(d, ("lights", 1, "intensity"), (2.0, 1.0, 1.0)),
    "ambient": lambda d: with_value(d, ("environment", "ambient"), (0.1, 0.1, 0.2)),
    "camera": lambda d: with_value(d, ("camera", "width"), 100),
    "sampling": lambda d: with_value(d, ("sampling", "max_depth"), 5),
}


def test_undo_gives_back_every_document_and_the_last_is_saved_and_read_again(tmp_path):
    """No edit touches what it is given; whatever the studio makes, the command line reads."""
    history, seen = History(one_object()), []
    for number, (label, edit) in enumerate(EDITS.items()):
        seen.append((history.state, fingerprint(history.state.scene())))
        history = history.did(label, edit(history.state), now_s=10.0 * number)
        assert fingerprint(history.state.scene()) != seen[-1][1], f"{label} changes something"
    last = history.state
    for document, was in reversed(seen):
        history = history.undone()
        assert history.state is document
        assert fingerprint(document.scene()) == was
    assert history.undone() is history
    for _ in EDITS:
        history = history.redone()
    assert history.state is last
    assert history.redone() is history
    branched = history.undone().did("other", last, now_s=1e6)
    assert branched.redone() is branched, "a new change forgets what was taken back"
    one, two = last.scene(), read_document(write_document(last, tmp_path)).scene()
    assert (one.camera, one.sampling, one.environment, one.materials) == (
        two.camera, two.sampling, two.environment, two.materials
    )  # fmt: skip
    np.testing.assert_allclose(two.points, one.points, atol=1e-6)
    np.testing.assert_allclose(two.irradiance * two.lights.directions, one.irradiance * one.lights.directions)


def test_digits_typed_are_undone_together():
    start, states = History(one_object()), [one_object() for _ in range(3)]
    history = start
    for number, state in enumerate(states):
        history = history.did("place 0", state, 0.5 * TOGETHER_S * number, "place")
    assert history.undone().state is start.state
    later = history.did("place 0", states[0], 5 * TOGETHER_S, "place")
    assert later.undone().state is states[2]
    other = history.did("place 0", states[0], 1.1 * TOGETHER_S, "scale")
    assert other.undone().state is states[2], "another input's change is another"
    pressed = history.did("add", states[0], 1.1 * TOGETHER_S).did("add", states[1], 1.2 * TOGETHER_S)
    assert pressed.undone().state is states[0], "a button pressed twice"
