"""The preview's pictures, and the order in which they are drawn."""

import threading

import numpy as np
import pytest

from scene.mesh import Mesh
from studio.editor import edits
from studio.editor.edits import with_value
from studio.editor.preview import Preview, rendered
from studio.widgets import display_mesh
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Texture
from twin.description.object_mesh import built_in


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


MATTE = ("materials", "matte")


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
