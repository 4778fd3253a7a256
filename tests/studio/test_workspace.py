"""What the browser asks for stays in the workspace."""

import pytest

from scene.errors import SceneError
from studio import workspace
from studio.workspace import PICTURES, Listing, Workspace


@pytest.fixture
def place(tmp_path):
    root = tmp_path / "bench"
    (root / "models").mkdir(parents=True)
    (root / "models" / "a.ply").write_text("ply")
    (root / ".hidden").mkdir()
    (root / ".hidden" / "b.ply").write_text("ply")
    (tmp_path / "secret.ply").write_text("ply")
    (root / "link.ply").symlink_to(tmp_path / "secret.ply")
    return Workspace.at(root)


@pytest.mark.parametrize(
    "name", ["../secret.ply", "models/../../secret.ply", "/etc/passwd", "link.ply", "", " ", "a\0b"]
)
def test_nothing_outside_is_reached(place, name):
    with pytest.raises(SceneError, match="outside of the workspace"):
        place.path(name)


def test_what_is_inside_is_found(place):
    (place.root / "models" / "b.PNG").touch()
    (place.root / "models" / "lights.json").touch()
    (place.root / "s.toml").touch()
    found = Listing(("models/a.ply",), ("models/b.PNG",), ("models",))
    assert place.listing() == found, "neither hidden files nor links"
    assert place.path("models/a.ply").read_text() == "ply"
    assert place.path("models/../models/a.ply") == place.path("models/a.ply")


@pytest.mark.parametrize("file", ["../secret.ply", "/etc/passwd", "sub/../../secret.ply"])
def test_a_description_may_not_name_files_outside(place, file):
    """A scene that came from elsewhere must not make the studio read what its author likes."""
    inside = place.root / "scene.toml"
    for text in (
        f'[[objects]]\nmesh = "{file}"',
        f'[environment]\nmap = "{file}"',
        f'[materials.m]\nkind = "diffuse"\nreflectance = {{ file = "{file}" }}',
        f'[[objects]]\npose = "{file}"',
    ):
        inside.write_text(text)
        with pytest.raises(SceneError, match="outside of the workspace"):
            place.description("scene.toml")
    inside.write_text('[[objects]]\nmesh = "models/a.ply"')
    assert place.description("scene.toml") == inside


@pytest.mark.parametrize(
    ("sent", "kept"),
    [("a b.ply", "uploads/a_b.ply"), ("../../x.PNG", "uploads/x.png"), ("/etc/y.exr", "uploads/y.exr")],
)
def test_uploads_are_kept_under_a_plain_name(place, sent, kept):
    assert place.keep_upload(sent, b"content") == kept
    assert (place.root / kept).read_bytes() == b"content"


@pytest.mark.parametrize("sent", ["a.exe", "a", ".ply", "x.toml", "a.pkl"])
def test_other_uploads_are_refused(place, sent):
    before = sorted(place.root.rglob("*"))
    with pytest.raises(SceneError, match="expected one of"):
        place.keep_upload(sent, b"content")
    assert sorted(place.root.rglob("*")) == before


def test_a_folder_for_a_scene_is_in_the_workspace(place):
    assert place.folder_for("new/scene") == place.root / "new" / "scene"
    for name, fault in ((".", "itself"), ("models/a.ply", "is a file"), ("..", "outside")):
        with pytest.raises(SceneError, match=fault):
            place.folder_for(name)
    with pytest.raises(SceneError, match="not a folder"):
        Workspace.at(place.root / "models" / "a.ply")
    assert ".npy" in PICTURES


def test_lists_end(place, monkeypatch):
    for number in range(4):
        (place.root / f"{number}.ply").touch()
    assert not place.listing().is_cut
    monkeypatch.setattr(workspace, "MOST_FILES", 5)
    assert (len(place.listing().models), place.listing().is_cut) == (5, False)
    monkeypatch.setattr(workspace, "MOST_FILES", 4)
    assert (len(place.listing().models), place.listing().is_cut) == (4, True)
    monkeypatch.setattr(workspace, "MOST_WALKED", 3)
    assert (len(place.listing().models), place.listing().is_cut) == (3, True), "a large folder is not walked to its end"
