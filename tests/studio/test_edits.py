"""Laws of the scene editor's edits, of what is undone, and of the pictures that the preview draws of a scene."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fixtures.mesh_shapes import volume
from scene.current import fingerprint
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.pose import rotation_from_vector
from studio.editor import edits
from studio.editor.edits import quaternion, with_value
from studio.editor.preview import Preview, rendered
from studio.studio_state import TOGETHER_S, History
from studio.widgets import display_mesh
from tests.conftest import until
from twin.description.description_file import read_document, write_document
from twin.description.light_groups import AreaLight, GridTable, RingTable
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Texture
from twin.description.object_mesh import built_in

MATTE = ("materials", "matte")


@pytest.fixture
def running():
    one = Preview()
    yield one
    one.close()


def made_of(material, **around):
    document = with_value(edits.start_document(), MATTE, material)
    return with_value(document, ("environment", "ambient"), around.get("ambient", (0.0, 0.0, 0.0))).scene()


def refined(shown, light):
    """Wait until a light's refined picture was shown, and return it."""
    until(lambda: (light, True) in [(one.light, one.is_refined) for one in shown], lambda: str(shown))
    return next(one for one in shown if (one.light, one.is_refined) == (light, True))


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
    shown, small = [], made_of(Diffuse((0.5, 0.5, 0.5)))
    # A texture on a mesh that has nowhere to put it.
    bare = Mesh(built_in("sphere").vertices, built_in("sphere").faces)
    broken = edits.added(edits.start_document(), "bare", mesh=bare)
    broken = with_value(broken, MATTE, Diffuse(Texture(np.ones((2, 2, 3))))).scene()
    for _ in range(5):
        running.request(small, 0, shown.append)
    running.request(broken, 1, shown.append)
    assert "has no texture coordinates" in refined(shown, "light_001").fault
    assert [one.light for one in shown if one.is_refined] == ["light_001"]
    running.request(small, 2, shown.append)
    assert refined(shown, "light_002").picture.max() > 0.1


def test_the_display_mesh_has_few_triangles_and_the_same_outline(monkeypatch):
    sphere = built_in("sphere")
    assert display_mesh(sphere.vertices, sphere.faces)[1] is sphere.faces
    monkeypatch.setattr("studio.widgets.MOST_FACES", 5000)
    vertices, faces = display_mesh(sphere.vertices * [60, 40, 20], sphere.faces)
    assert 1500 < len(faces) <= 5000
    assert abs(np.linalg.norm(vertices / [60, 40, 20], axis=1) - 1).max() < 0.05
    # Closed, and turned outward.
    assert volume(Mesh(vertices, faces)) == pytest.approx(4 / 3 * np.pi * 60 * 40 * 20, rel=0.05)


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
