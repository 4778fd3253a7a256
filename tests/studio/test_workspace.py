"""What is listed in the page, and what is written by it, lies in the workspace, and is the studio's own."""

import random
import signal
import subprocess
import sys
import time

import pytest

from scene.errors import SceneError
from studio.workspace import Workspace, put_own


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


def test_uploads_are_kept_under_a_plain_name_and_others_refused(place):
    for sent, content in (("a.exe", b"1"), (".ply", b"1"), ("x.toml", b"1"), ("b.ply", b"")):
        with pytest.raises(SceneError, match="expected one of"):
            place.keep_upload(sent, content)
    assert not (place.root / "uploads").exists()
    for sent, kept in (("a b.ply", "a_b.ply"), ("../../x.PNG", "x.png"), ("/etc/y.exr", "y.exr")):
        for content, name in ((b"1", kept), (b"1", kept), (b"2", kept.replace(".", "_2."))):
            assert place.keep_upload(sent, content) == f"uploads/{name}", "another takes no other's name"
        assert (place.root / "uploads" / kept).read_bytes() == b"1"


def test_a_folder_for_a_scene_is_in_the_workspace(place):
    assert place.folder_for("new/scene") == place.root / "new" / "scene"
    for name, fault in ((".", "itself"), ("models/a.ply", "is a file"), ("..", "outside")):
        with pytest.raises(SceneError, match=fault):
            place.folder_for(name)
    with pytest.raises(SceneError, match="not a folder"):
        Workspace.at(place.root / "models" / "a.ply")


NOT_OURS = "rgbn did not write it|was changed after rgbn wrote it"


def put(folder, **files):
    def write(place):
        for name, text in files.items():
            path = place / name.replace("__", "/").replace("_toml", ".toml")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    put_own(folder, write)


def held(folder):
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and ".rgbn" not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_its_own_files_are_written_over(tmp_path):
    folder = tmp_path / "new"
    put(folder, scene_toml="1", meshes__a="1")
    put(folder, scene_toml="2", meshes__a="1", meshes__b="2")
    assert held(folder) == {"scene.toml": b"2", "meshes/a": b"1", "meshes/b": b"2"}


@pytest.mark.parametrize("foreign", ["scene.toml", "meshes/a"])
@pytest.mark.parametrize("was_own", [False, True])
def test_a_foreign_file_stays_and_so_does_all_else(tmp_path, foreign, was_own):
    """One that the studio wrote and somebody changed since is foreign too."""
    if was_own:
        put(tmp_path, scene_toml="1", meshes__a="1")
    (tmp_path / foreign).parent.mkdir(exist_ok=True)
    (tmp_path / foreign).write_text("mine")
    before = held(tmp_path)
    with pytest.raises(SceneError, match=f"{foreign}: (is there already, and rgbn did not|was changed after rgbn) w"):
        put(tmp_path, scene_toml="2", meshes__a="2")
    assert held(tmp_path) == before


def test_folders_and_links_in_the_way_stay(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "mine" / "scene.toml").mkdir(parents=True)
    (tmp_path / "mine" / "other").symlink_to(tmp_path / "out")
    (tmp_path / "mine" / "deep").symlink_to(tmp_path / "out")
    for files in ({"scene_toml": "1"}, {"other": "1"}, {"deep__file": "1"}):
        with pytest.raises(SceneError, match=f"{NOT_OURS}|a link leads out"):
            put(tmp_path / "mine", **files)
    assert not list((tmp_path / "out").iterdir())
    with pytest.raises(ZeroDivisionError):
        put_own(tmp_path / "new", lambda place: 1 / 0)
    assert not (tmp_path / "new").exists(), "a folder that nothing came into is not left"


SAVES = """
import sys
from pathlib import Path
from studio.workspace import put_own

def write(place, number):
    for name in ("a", "b", "scene.toml"):
        (place / name).write_text(f"{number}" * 300_000)

folder = Path(sys.argv[1])
print("begun", flush=True)
number = 0
while True:
    number = (number + 1) % 10
    put_own(folder, lambda place: write(place, number))
"""


@pytest.mark.full
def test_a_studio_that_is_killed_while_it_saves_leaves_whole_files(tmp_path):
    """Each file is the old or the new one, and the next save is not refused."""
    pick = random.Random(1)
    for _ in range(25):
        process = subprocess.Popen([sys.executable, "-c", SAVES, tmp_path], stdout=subprocess.PIPE)
        with process.stdout as said:
            assert said.readline() == b"begun\n"
            time.sleep(pick.uniform(0.005, 0.15))
            process.send_signal(signal.SIGKILL)
        process.wait()
        for name in ("a", "b", "scene.toml"):
            if (tmp_path / name).exists():
                text = (tmp_path / name).read_text()
                assert len(text) == 300_000, name
                assert set(text) == {text[0]}, name
        put(tmp_path, **dict.fromkeys(("a", "b", "scene_toml"), "x" * 300_000))
        assert (tmp_path / "scene.toml").read_text()[0] == "x"
