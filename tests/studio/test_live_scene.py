"""The preview: after any row of changes the picture is that of the scene loaded afresh."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from scene.pose import rotation_from_vector
from studio.display_mesh import clustered, display_mesh
from studio.editor import edits
from studio.editor.live_scene import LiveScene, refining
from studio.editor.placement import placement_of
from studio.editor.preview import Preview
from twin.description.description import TwinObject
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Texture
from twin.description.object_mesh import ObjectMesh, built_in
from twin.engines.variant import SLOW, pick_variant

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="the preview's first picture needs the vectorised variant"),
]
SIZE = {"width": 48, "height": 36}


def refined(scene, light):
    return list(refining(scene, light, **SIZE))[-1]


def two_objects():
    scene = edits.added(edits.start_scene(), "ball", built_in("sphere"))
    cube = TwinObject("cube", built_in("cube"), "other", np.diag([0.4, 0.4, 0.4, 1.0]))
    scene = edits.with_material(scene, "other", RoughPlastic((0.2, 0.5, 0.3), 0.3))
    scene = replace(scene, objects=(*scene.objects, cube))
    return edits.turned(scene, 1, placement_of(scene.objects[0]).middle_mm + [0.9, 0, 0.8], np.eye(3))


def test_a_picture_after_changes_is_that_of_the_scene_loaded_afresh():
    tilted = rotation_from_vector(np.array([0.5, 0.3, 0.0]))
    mirrored = np.array([-0.4, 0.4, 0.4])
    texture = Texture(np.random.default_rng(10001).uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32))
    changes = [
        ("colour", lambda s: edits.with_material(s, "matte", Diffuse((0.7, 0.3, 0.1))), False),
        ("gloss", lambda s: edits.with_material(s, "other", RoughPlastic((0.6, 0.1, 0.3), 0.15, 0.8)), False),
        ("turn", lambda s: edits.turned(s, 1, placement_of(s.objects[1]).middle_mm, tilted), False),
        ("stretch", lambda s: edits.scaled(s, 0, 0.8), False),
        ("light", lambda s: edits.moved_light(s, 2, s.lights.reference_point_mm + [-3, 2, 2]), False),
        ("swap", lambda s: edits.assigned(edits.assigned(s, 0, "other"), 1, "matte"), True),
        ("texture", lambda s: edits.with_material(s, "matte", Diffuse(texture)), True),
        ("mirror", lambda s: edits.placed(s, 1, replace(placement_of(s.objects[1]), scale=mirrored)), True),
        ("remove", lambda s: edits.removed(s, 0), True),
    ]  # fmt: skip
    live, scene = LiveScene(), two_objects()
    before = live.picture(scene, 2, **SIZE)
    for label, change, is_loaded_again in changes:
        scene, loads = change(scene), live.loads
        picture = live.picture(scene, 2, **SIZE)
        np.testing.assert_allclose(picture, LiveScene().picture(scene, 2, **SIZE), atol=1e-5, err_msg=label)
        assert np.abs(picture - before).max() > 0.02, f"{label} shows"
        assert (live.loads > loads) == is_loaded_again, label
        before = picture


def test_a_light_shines_from_where_its_arrow_stands():
    """From the upper left: the ball is bright there, dark at the lower right."""
    scene = edits.start_scene()
    scene = edits.moved_light(scene, 0, scene.lights.reference_point_mm + [-200, 200, 60])
    picture = LiveScene().picture(scene, 0, **SIZE).mean(-1)
    upper_left, lower_right = picture[:18, :24], picture[18:, 24:]
    assert upper_left.mean() > 5 * lower_right.mean()
    assert picture[:18, 24:].mean() > 1.2 * lower_right.mean()


def test_the_refined_picture_shows_what_the_first_leaves_out():
    """A mirror in an even environment; and where there is nothing more, both agree."""
    scene = edits.start_scene()
    rough, fine = LiveScene().picture(scene, 0, **SIZE), refined(scene, 0)
    inside = np.minimum(rough, fine).min(-1) > 0.05
    assert np.median(np.abs(rough - fine)[inside] / fine[inside]) < 0.02
    mirror = edits.with_environment(
        edits.with_material(scene, "matte", Conductor("none", 0.0)), ambient=(0.3, 0.2, 0.1)
    )
    assert LiveScene().picture(mirror, 0, **SIZE).max() == 0
    middle = refined(mirror, 0)[18, 24]
    np.testing.assert_allclose(middle, [0.3, 0.2, 0.1], rtol=1e-3)


def test_only_the_newest_wish_is_refined_and_a_fault_is_told():
    preview, shown, done = Preview(), [], threading.Event()
    try:
        scene = edits.start_scene()
        small = edits.with_camera(scene, width=48, height=36, focal_px=120.0, orthographic=False)
        # A texture on a mesh that has nowhere to put it.
        bare = ObjectMesh(built_in("sphere").vertices, built_in("sphere").faces)
        broken = edits.with_material(edits.added(small, "bare", bare), "matte", Diffuse(Texture(np.ones((2, 2, 3)))))

        def show(name):
            def add(drawn):
                shown.append((name, drawn))
                if drawn.is_refined:
                    done.set()

            return add

        for _ in range(5):
            preview.request(1, small, 0, show("first"))
        preview.request(1, broken, 0, show("broken"))
        assert done.wait(120)
        assert [name for name, drawn in shown if drawn.is_refined] == ["broken"]
        assert "has no texture coordinates" in shown[-1][1].fault
        done.clear()
        preview.request(1, small, 0, show("mended"))
        assert done.wait(120)
        assert shown[-1][0] == "mended"
        assert shown[-1][1].picture.max() > 0.1
    finally:
        preview.close()


def test_the_display_mesh_has_few_triangles_the_same_outline_and_the_same_colours():
    sphere = built_in("sphere")
    whole = ObjectMesh(sphere.vertices * [60, 40, 20], sphere.faces, colours=sphere.vertices / 4 + 0.5)
    few = clustered(whole, 5000)
    assert 1500 < len(few.faces) <= 5000
    radii = np.linalg.norm(few.vertices / [60, 40, 20], axis=1)
    assert abs(radii - 1).max() < 0.05
    np.testing.assert_allclose(few.colours, few.vertices / [60, 40, 20] / 4 + 0.5, atol=1e-9)
    a, b, c = (few.vertices[few.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 60 * 40 * 20, rel=0.05), "closed, and turned outward"
    assert display_mesh(whole) is display_mesh(whole)
    assert display_mesh(sphere) is not display_mesh(whole)


def test_the_first_picture_of_a_large_mesh_is_that_of_the_whole_but_for_its_grain(monkeypatch):
    scene = edits.added(edits.start_scene(), "ball", built_in("sphere"))
    whole = LiveScene().picture(scene, 0, **SIZE)
    monkeypatch.setattr("studio.display_mesh.MOST_FACES", 8000)
    coarse = LiveScene().picture(scene, 0, **SIZE)
    assert not np.array_equal(coarse, whole)
    seen = (coarse > 0) & (whole > 0)
    assert seen.sum() > 0.97 * (whole > 0).sum()
    assert np.median(abs(coarse - whole)[seen]) < 0.02 * whole.max()
