"""Sessions that break a parser, a file system or physics: one message, with the key where there is one."""

import copy
import glob
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from capture.session.globs import MOST_FOLDERS, expand
from capture.session.manifest import TABLES
from capture.session.manifest_file import parse
from capture.session.session import load_session
from scene.errors import SessionError
from scene.files import write_png
from tests.capture.test_session import FLASH, faults_of

CAMERA = "[camera]\nwidth = 60\nheight = 40\nfx = 70\nfy = 70\ncx = 30\ncy = 20\n"


@pytest.fixture
def folder(tmp_path):
    for index in range(7):
        write_png(tmp_path / f"flash_{index}.png", np.full((4, 6, 3), index, np.uint8))
    return tmp_path


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("[frames]\nflash = [" + '"*",' * 200_000 + "]", "frames.flash: found ["),
        ('[frames]\nflash = "' + "*a" * 5000 + '"', "frames.flash[0]: found '*a"),
        (FLASH + '[[spheres]]\nkind = "white"\n' * 2000, "spheres: found ["),
        ("a = " + "[" * 100_000, "nested too deeply"),
        (FLASH + "x = " + "[" * 300 + "]" * 300, "frames.x: unknown key"),
        ("# " + "x" * (2 << 20), "1 MB are the most"),
        (FLASH + "gamma = " + "9" * 5000, "is not TOML"),
        (FLASH + CAMERA.replace("fx = 70", "fx = 1e5"), "camera.fx: found 100000 px for a picture of 60 px"),
        (FLASH + CAMERA.replace("cx = 30", "cx = nan"), "camera.cx: found nan; expected a finite number"),
        (FLASH + "[object]\nbox = [9, 2, 3, 8]\n", "object.box: found [9.0, 2.0, 3.0, 8.0]; expected left"),
        (FLASH + CAMERA + "distortion = [900, 0, 0, 0, 0]", "camera.distortion: found [900.0"),
    ],
    ids=lambda value: value if len(value) < 60 else "",
)
def test_deep_and_huge_files_and_cameras_beyond_physics(folder, text, part):
    assert part in faults_of(folder, text)


def numbers(value, path=()):
    """Yield the path of each number in a document."""
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(part, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def test_every_number_has_bounds():
    """Of the keys to come, too; all that are at fault are told at once."""
    known = {name: {key: field.examples[0] for key, field in table.model_fields.items()} for name, table in
             TABLES.items() if name in ("frames", "camera", "lights", "object", "spheres")}  # fmt: skip
    whole = known | {"spheres": [known["spheres"]]}
    assert parse(whole)[1] == []
    for number in (1e300, -1e300, 10**30, -(10**30), 1e9, -1e9):
        data, paths = copy.deepcopy(whole), list(numbers(whole))
        for path in paths:
            holder = data
            for part in path[:-1]:
                holder = holder[part]
            holder[path[-1]] = number
        faults = parse(data)[1]
        assert len(faults) == len(paths) > 15
        for path in paths:
            where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")
            assert [fault for fault in faults if fault.startswith(f"{where}: found")], where


def test_a_link_to_its_own_folder_shows_each_photograph_once(folder, tmp_path_factory):
    """glob.glob went around it 40 times: 247 files for 7. A link to another folder is followed."""
    (folder / "sub").mkdir()
    (folder / "sub" / "up").symlink_to(folder)
    (folder / "again").symlink_to(folder / "sub")
    for pattern in ("**/*.png", "**/flash_*.png", "sub/up/**/*.png"):
        files, faults = expand([pattern], folder)
        assert sorted({path.resolve() for path in files}) == sorted(path.resolve() for path in files)
        assert (len(files), faults) == (7, [])
    assert expand(["**/*.png"], folder)[0][0] == folder / "flash_0.png"
    other = tmp_path_factory.mktemp("session")
    (other / "raw").symlink_to(folder)
    assert expand(["**/flash_0.png"], other) == ([other / "raw" / "flash_0.png"], [])


def test_globs_match_what_they_match_in_the_shell(tmp_path):
    """Without links the files are glob.glob's own."""
    root = tmp_path / "root"
    names = "f0.png a/f1.png a/b/f2.png a/b/c/g3.png b/f4.png .hidden/f5.png ab/f6.png a/.f7.png"
    for name in names.split():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(b"")
    patterns = "** **/* **/*.png a/**/*.png */**/f* a**/*.png **/b/*.png a/** ./**/*.png **/**/*.png *.png a/*"
    for pattern in [*patterns.split(), "[ab]/*.png", "gone/**/*.png", ".hidden/*.png", "../*/a/*.png", "**/.*"]:
        for absolute in ("", f"{root}/"):
            expected = {root / name for name in glob.glob(absolute + pattern, root_dir=root, recursive=True)}
            found, _ = expand([absolute + pattern], root)
            assert {path.resolve() for path in found} == {one.resolve() for one in expected if one.is_file()}, pattern


def test_a_glob_through_a_whole_disk_ends(tmp_path, monkeypatch):
    monkeypatch.setattr("capture.session.globs.MOST_FOLDERS", 20)
    for index in range(30):
        (tmp_path / f"folder_{index}").mkdir()
    assert MOST_FOLDERS > 1000
    assert "more than 20 folders" in expand(["**/*.png"], tmp_path)[1][0]


def test_a_looping_link(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(SessionError, match="session"):
        load_session(tmp_path / "a")
    (tmp_path / "flash_0.png").symlink_to(tmp_path / "a")
    assert "matches no file" in faults_of(tmp_path, FLASH)
    (tmp_path / "session.toml").unlink()
    (tmp_path / "session.toml").symlink_to(tmp_path / "a")
    with pytest.raises(SessionError, match="neither session"):
        load_session(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_a_name_that_is_no_text(folder):
    (folder / "flash_\udcff.png").write_bytes((folder / "flash_0.png").read_bytes())
    assert r"flash_\udcff.png' is a name that is not UTF-8. Rename the file." in faults_of(folder, FLASH)
    place = folder / "\udcfe"
    place.mkdir()
    with pytest.raises(SessionError, match="Give the folder"):
        load_session(place)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to become someone else")
def test_an_unreadable_folder(folder):
    """As somebody who may not look into it."""
    (folder / "session.toml").write_text(FLASH.replace("flash_*", "closed/*"))
    (folder / "closed").mkdir(mode=0o000)
    code = (
        "import os, sys; sys.path.insert(0, sys.argv[1])\n"
        "import capture.session.manifest_file, capture.session.resolve, capture.session.session as s\n"
        "from pathlib import Path; os.setgid(65534); os.setuid(65534)\n"
        "for place in sys.argv[2:]:\n"
        "    try: s.load_session(Path(place))\n"
        "    except s.SessionError as error: print('told', error)\n"
    )
    root = str(Path(__file__).parents[2])
    for above in (folder, *folder.parents[:3]):
        above.chmod(0o755)
    done = subprocess.run(
        [sys.executable, "-c", code, root, str(folder), str(folder / "closed" / "deeper")],
        capture_output=True, text=True, cwd="/tmp",
    )  # fmt: skip
    assert done.stderr == ""
    assert done.stdout.count("told") == 2
