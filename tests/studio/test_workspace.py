"""What is listed in the page, and what is written by it, lies in the workspace."""

import pytest

from scene.errors import SceneError
from studio import workspace
from studio.workspace import Listing, Workspace


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
    "name", ["../secret.ply", "models/../../secret.ply", "/etc/passwd", "link.ply", "", " ", "a\0b", 5000 * "a"]
)
def test_nothing_outside_is_reached(place, name):
    with pytest.raises(SceneError, match=r"outside of the workspace|names no file"):
        place.path(name)


def test_what_is_inside_is_found(place):
    (place.root / "models" / "b.PNG").touch()
    (place.root / "models" / "lights.json").touch()
    (place.root / "s.toml").touch()
    assert place.listing() == Listing(("models/a.ply",), ("models/b.PNG",), ("models",)), "neither hidden nor links"
    assert place.path("models/../models/a.ply").read_text() == "ply"


@pytest.mark.parametrize(
    ("sent", "kept"),
    [("a b.ply", "uploads/a_b.ply"), ("../../x.PNG", "uploads/x.png"), ("/etc/y.exr", "uploads/y.exr")],
)
def test_uploads_are_kept_under_a_plain_name(place, sent, kept):
    assert place.keep_upload(sent, b"content") == kept
    assert place.keep_upload(sent, b"content") == kept, "the same again is there already"
    assert place.keep_upload(sent, b"another") == kept.replace(".", "_2."), "another takes no other's name"
    assert (place.root / kept).read_bytes() == b"content"


@pytest.mark.parametrize(("sent", "content"), [("a.exe", b"1"), (".ply", b"1"), ("x.toml", b"1"), ("b.ply", b"")])
def test_other_uploads_are_refused(place, sent, content):
    with pytest.raises(SceneError, match="expected one of"):
        place.keep_upload(sent, content)
    assert not (place.root / "uploads").exists()


def test_a_folder_for_a_scene_is_in_the_workspace(place):
    assert place.folder_for("new/scene") == place.root / "new" / "scene"
    for name, fault in ((".", "itself"), ("models/a.ply", "is a file"), ("..", "outside")):
        with pytest.raises(SceneError, match=fault):
            place.folder_for(name)
    with pytest.raises(SceneError, match="not a folder"):
        Workspace.at(place.root / "models" / "a.ply")


def test_lists_end(place, monkeypatch):
    for number in range(4):
        (place.root / f"{number}.ply").touch()
    for name, most, is_cut in (("MOST_FILES", 5, False), ("MOST_FILES", 4, True), ("MOST_WALKED", 3, True)):
        monkeypatch.setattr(workspace, name, most)
        found = place.listing()
        assert len(found.models) <= 5
        assert found.is_cut is is_cut, "a large folder is not walked to its end"
