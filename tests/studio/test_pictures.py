"""The preview's pictures: the one at once agrees with the renderer's, in what it has of it."""

import threading

import numpy as np
import pytest

from studio.display_mesh import clustered, display_mesh
from studio.editor import edits
from studio.editor.edits import with_value
from studio.editor.preview import Preview
from studio.editor.preview_pictures import first_picture, refining
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Texture
from twin.description.object_mesh import ObjectMesh, built_in

pytestmark = pytest.mark.render
SIZE = {"width": 48, "height": 36}


def refined(scene, light=0):
    return list(refining(scene, light, **SIZE))[-1]


def made_of(material, **around):
    document = with_value(edits.start_document(), ("materials", "matte"), material)
    return with_value(document, ("environment", "ambient"), around.get("ambient", (0.0, 0.0, 0.0))).scene()


def test_a_light_shines_from_where_its_arrow_stands():
    """From the upper left: the ball is bright there, dark at the lower right; no speck within what is lit."""
    document = edits.start_document()
    reference = document.scene().lights.reference_point_mm
    scene = edits.moved_light(document, 0, reference + [-200, 200, 60]).scene()
    picture = first_picture(scene, 0, width=320, height=240).mean(-1)
    assert picture[:120, :160].mean() > 5 * picture[120:, 160:].mean()
    facing = edits.moved_light(document, 0, reference + [0, 0, 200]).scene()
    picture = first_picture(facing, 0, width=320, height=240).mean(-1)
    assert picture[80:160, 120:200].min() > 0.3


@pytest.mark.parametrize(
    ("material", "misses"),
    [
        (Diffuse((0.7, 0.3, 0.1)), 0.005),
        (RoughPlastic((0.6, 0.1, 0.3), 0.2), 0.3),
        (Conductor("Al", 0.3), 0.3),
    ],
)
def test_the_first_picture_is_about_the_refined_one(material, misses):
    scene = made_of(material)
    rough, fine = first_picture(scene, 20, **SIZE), refined(scene, 20)
    inside = np.minimum(rough, fine).min(-1) > 0.05
    assert np.median(np.abs(rough - fine)[inside] / fine[inside]) < misses
    assert np.corrcoef(rough.ravel(), fine.ravel())[0, 1] > 0.95


def test_the_refined_picture_shows_what_the_first_leaves_out():
    """A mirror in an even environment."""
    mirror = made_of(Conductor("none", 0.0), ambient=(0.3, 0.2, 0.1))
    np.testing.assert_allclose(refined(mirror)[18, 24], [0.3, 0.2, 0.1], rtol=1e-3)


def test_only_the_newest_wish_is_refined_and_a_fault_is_told():
    preview, shown, done = Preview(), [], threading.Event()
    try:
        small = made_of(Diffuse((0.5, 0.5, 0.5)))
        # A texture on a mesh that has nowhere to put it.
        bare = ObjectMesh(built_in("sphere").vertices, built_in("sphere").faces)
        broken = edits.added(edits.start_document(), "bare", mesh=bare)
        broken = with_value(broken, ("materials", "matte"), Diffuse(Texture(np.ones((2, 2, 3))))).scene()

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
    scene = edits.added(edits.start_document(), "ball", shape="sphere").scene()
    whole = first_picture(scene, 0, **SIZE)
    monkeypatch.setattr("studio.display_mesh.MOST_FACES", 8000)
    coarse = first_picture(scene, 0, **SIZE)
    assert not np.array_equal(coarse, whole)
    seen = (coarse > 0) & (whole > 0)
    assert seen.sum() > 0.97 * (whole > 0).sum()
    assert np.median(abs(coarse - whole)[seen]) < 0.02 * whole.max()
