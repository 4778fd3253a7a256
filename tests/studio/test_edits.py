"""What can be done to a scene, without a browser: laws, and the convention of each number."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene.current import fingerprint
from scene.errors import RenderError
from scene.pose import rotation_from_vector
from studio.desk import TOGETHER_S, History
from studio.editor import edits
from studio.editor.placement import Placement, matrix_of, placement_of, quaternion, rotation_of
from twin.description.description import Sampling
from twin.description.description_file import read_scene
from twin.description.description_tables import GridTable, LightTable, RingTable
from twin.description.description_writer import write_scene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.object_mesh import ObjectMesh, built_in

ANGLE = st.floats(-89, 89)
FACTOR = st.floats(0.2, 5)
PLACE = st.floats(-300, 300)


def off_centre():
    """A mesh whose origin lies far from its middle, as a scan's does."""
    cube = built_in("cube")
    return ObjectMesh(cube.vertices * [3, 2, 1] + [40, -70, 25], cube.faces, cube.normals, cube.texcoords)


def one_object(mesh=None):
    return edits.added(edits.start_scene(), "thing", off_centre() if mesh is None else mesh)


def middle(one):
    return (one.placed.vertices.min(0) + one.placed.vertices.max(0)) / 2


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(PLACE, PLACE, PLACE),
    st.tuples(st.floats(-179, 179), ANGLE, st.floats(-179, 179)),
    st.tuples(st.one_of(FACTOR, FACTOR.map(lambda x: -x)), FACTOR, FACTOR),
)
def test_numbers_and_matrix_say_the_same(place, angles, scale):
    scene = one_object()
    wanted = Placement(np.array(place), np.array(angles), np.array(scale))
    one = edits.placed(scene, 0, wanted).objects[0]
    found = placement_of(one)
    assert found.is_exact
    np.testing.assert_allclose(found.middle_mm, place, atol=1e-7)
    np.testing.assert_allclose(found.rotate_deg, angles, atol=1e-5)
    np.testing.assert_allclose(found.scale, scale, rtol=1e-9)
    np.testing.assert_allclose(matrix_of(one, found), one.matrix, atol=1e-7)
    np.testing.assert_allclose(rotation_of(quaternion(found.rotation)), found.rotation, atol=1e-12)


def test_the_angles_are_those_of_a_scene_description(tmp_path):
    """About x, then y, then z, the axes standing still: every other order or sign gives another matrix."""
    text = """
[camera]
width = 32
height = 24
fx = 50.0
[[objects]]
shape = "cube"
scale = [30, 20, 10]
rotate_deg = [20, 35, -50]
translate_mm = [5, -7, -400]
material = "m"
[materials.m]
kind = "diffuse"
reflectance = 0.5
[[lights]]
kind = "distant"
direction = [0, 0, 1]
"""
    (tmp_path / "scene.toml").write_text(text)
    read = read_scene(tmp_path / "scene.toml")
    numbers = Placement(np.array([5.0, -7, -400]), np.array([20.0, 35, -50]), np.array([30.0, 20, 10]))
    scene = edits.added(edits.start_scene(), "cube", built_in("cube"))
    np.testing.assert_allclose(edits.placed(scene, 0, numbers).objects[0].matrix, read.objects[0].matrix, atol=1e-10)
    np.testing.assert_allclose(placement_of(read.objects[0]).rotate_deg, [20, 35, -50], atol=1e-9)


def test_a_gizmo_moves_rigidly_about_the_middle():
    scene = one_object()
    rotation = rotation_from_vector(np.array([0.3, -0.8, 0.5]))
    there = np.array([11.0, -20.0, -500.0])
    was, now = scene.objects[0], edits.turned(scene, 0, there, rotation).objects[0]
    # Each point turns about the middle, which goes to where the gizmo is.
    expected = (was.placed.vertices - middle(was)) @ rotation.T + there
    np.testing.assert_allclose(now.placed.vertices, expected, atol=1e-9)
    np.testing.assert_allclose(placement_of(now).rotation, rotation, atol=1e-9)


def test_scaling_keeps_the_middle():
    scene = edits.turned(one_object(), 0, np.array([3.0, 4, -600]), rotation_from_vector(np.array([0.4, 0.2, 0.1])))
    was, now = scene.objects[0], edits.scaled(scene, 0, 1.7).objects[0]
    expected = placement_of(was).middle_mm + 1.7 * (was.placed.vertices - placement_of(was).middle_mm)
    np.testing.assert_allclose(now.placed.vertices, expected, atol=1e-9)
    with pytest.raises(RenderError, match="above 0"):
        edits.scaled(scene, 0, 0.0)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (6, 1, 1), (1, 9, 2)])
def test_a_loaded_model_fills_the_picture_and_stays_inside(stretch):
    """In millimetres as it is, whatever its size; nearer than 0.8 of the picture no corner comes."""
    mesh = off_centre()
    scene = one_object(ObjectMesh(mesh.vertices * stretch, mesh.faces))
    one, camera = scene.objects[0], scene.camera
    assert [found.name for found in scene.objects] == ["thing"], "the sphere of a new scene makes place"
    np.testing.assert_allclose(np.ptp(one.placed.vertices, axis=0), np.ptp(mesh.vertices * stretch, axis=0))
    pixels = camera.project(one.placed.vertices)
    filled = np.ptp(pixels, axis=0) / [camera.width, camera.height]
    assert filled.max() == pytest.approx(edits.FILLED, abs=1e-6)
    np.testing.assert_allclose(scene.lights.reference_point_mm, middle(one), atol=1e-9)
    assert len(edits.added(scene, "thing", mesh).objects) == 2, "the second does not"
    assert edits.added(scene, "thing", mesh).objects[1].name == "thing 2"


def test_lights_follow_the_middle():
    ring = RingTable(kind="ring", count=5, polar_deg=40, distance_mm=300)
    scene = edits.with_lights(one_object(), [ring], None)
    was = scene.lights
    moved = edits.turned(scene, 0, np.array([50.0, 0, -900]), np.eye(3))
    lights = edits.centred(moved).lights
    np.testing.assert_allclose(
        lights.positions_mm - lights.reference_point_mm, was.positions_mm - was.reference_point_mm
    )
    np.testing.assert_allclose(lights.reference_point_mm, [50, 0, -900], atol=1e-9)


def test_a_light_is_dragged_to_where_it_is_let_go():
    """Up and to the left of the object: x < 0, y > 0, toward the light."""
    scene = one_object()
    reference = scene.lights.reference_point_mm
    moved = edits.moved_light(scene, 3, reference + [-200, 100, 200]).lights
    np.testing.assert_allclose(moved.directions[3], [-2 / 3, 1 / 3, 2 / 3])
    others = np.arange(24) != 3
    assert np.array_equal(moved.directions[others], scene.lights.directions[others])
    near = edits.with_lights(scene, [GridTable(kind="hemisphere", rings=2, around=4, distance_mm=500)], None)
    there = reference + np.array([-200.0, 100, 200])
    moved = edits.moved_light(near, 1, there).lights
    np.testing.assert_allclose(moved.positions_mm[1], there)
    np.testing.assert_allclose(moved.directions[1], [-2 / 3, 1 / 3, 2 / 3])
    with pytest.raises(RenderError, match="reference point"):
        edits.moved_light(near, 1, reference)


def test_lights_are_added_of_one_sort_and_named_apart():
    scene = edits.with_lights(one_object(), [RingTable(kind="ring", count=3, polar_deg=40)], None)
    more = edits.with_more_lights(scene, [RingTable(kind="ring", count=2, polar_deg=20)], None)
    assert more.lights.names == ("ring_000", "ring_001", "ring_002", "ring_003", "ring_004")
    np.testing.assert_allclose(more.lights.directions[3:, 2], np.cos(np.radians(20)))
    near = LightTable(kind="point", position_mm=(0, 0, 100))
    with pytest.raises(RenderError, match="distant, these are near"):
        edits.with_more_lights(scene, [near], None)
    left = edits.without_light(more, 1)
    assert left.lights.names == ("ring_000", "ring_002", "ring_003", "ring_004")
    assert len(left.radii_mm) == 4
    with pytest.raises(RenderError, match="only one"):
        edits.without_light(edits.with_lights(scene, [near], None), 0)


def test_what_is_in_use_cannot_be_removed():
    scene = edits.with_material(one_object(), "gold", RoughPlastic((0.9, 0.7, 0.1)))
    assert "gold" not in edits.without_material(scene, "gold").materials
    with pytest.raises(RenderError, match="thing is made of it"):
        edits.without_material(edits.assigned(scene, 0, "gold"), "gold")
    with pytest.raises(RenderError, match="only one"):
        edits.removed(scene, 0)


def test_a_resized_camera_sees_the_same():
    scene = one_object()
    small = edits.with_camera(scene, width=320, height=240, focal_px=800.0, orthographic=False)
    points = scene.objects[0].placed.vertices
    np.testing.assert_allclose(
        (small.camera.project(points) + 0.5) / [320, 240], (scene.camera.project(points) + 0.5) / [640, 480], atol=1e-12
    )


EDITS = {
    "add": lambda s: edits.added(s, "ball", built_in("sphere")),
    "move": lambda s: edits.turned(s, 0, np.array([1.0, 2, -700]), np.eye(3)),
    "scale": lambda s: edits.scaled(s, 0, 2.0),
    "material": lambda s: edits.with_material(s, "matte", Diffuse((0.1, 0.2, 0.3))),
    "light": lambda s: edits.moved_light(s, 0, [1, 2, 3]),
    "intensity": lambda s: edits.with_intensity(s, 1, (2, 1, 1)),
    "ambient": lambda s: edits.with_environment(s, ambient=(0.1, 0.1, 0.2)),
    "camera": lambda s: edits.with_camera(s, width=100, height=80, focal_px=300.0, orthographic=False),
    "sampling": lambda s: replace(s, sampling=Sampling("mitsuba", 16, 5)),
}


def test_undo_gives_back_every_scene_exactly():
    """No edit touches what it is given; undo and redo walk through the very same scenes."""
    history, seen = History(one_object()), []
    for number, (label, edit) in enumerate(EDITS.items()):
        seen.append((history.state, fingerprint(history.state)))
        history = history.did(label, edit(history.state), now_s=10.0 * number)
        assert fingerprint(history.state) != seen[-1][1], f"{label} changes something"
    last = history.state
    for scene, mark in reversed(seen):
        history = history.undone()
        assert history.state is scene
        assert fingerprint(scene) == mark
    assert history.undone() is history
    for _ in EDITS:
        history = history.redone()
    assert history.state is last
    assert history.redone() is history
    branched = history.undone().did("other", last, now_s=1e6)
    assert branched.redone() is branched, "a new change forgets what was taken back"


def test_digits_typed_are_undone_together():
    start, scenes = History(one_object()), [one_object() for _ in range(3)]
    history = start
    for number, scene in enumerate(scenes):
        history = history.did("place 0", scene, 0.5 * TOGETHER_S * number, "place")
    assert history.undone().state is start.state
    later = history.did("place 0", scenes[0], 5 * TOGETHER_S, "place")
    assert later.undone().state is scenes[2]
    other = history.did("place 0", scenes[0], 1.1 * TOGETHER_S, "scale")
    assert other.undone().state is scenes[2], "another input's change is another"
    pressed = history.did("add", scenes[0], 1.1 * TOGETHER_S).did("add", scenes[1], 1.2 * TOGETHER_S)
    assert pressed.undone().state is scenes[0], "a button pressed twice"


def test_a_scene_edited_is_saved_and_read_again(tmp_path):
    """Whatever the studio makes, the command line reads: the same places, lights, materials and sampling."""
    scene = one_object()
    for edit in EDITS.values():
        scene = edit(scene)
    again = read_scene(write_scene(scene, tmp_path))
    assert fingerprint(again.camera, again.sampling, again.environment) == fingerprint(
        replace(scene.camera, source=again.camera.source), scene.sampling, scene.environment
    )
    np.testing.assert_allclose(again.lights.directions, scene.lights.directions, atol=1e-12)
    np.testing.assert_allclose(again.points, scene.points, atol=1e-6)
    np.testing.assert_allclose(again.irradiance, scene.irradiance)
    assert fingerprint(again.materials["matte"]) == fingerprint(scene.materials["matte"])
