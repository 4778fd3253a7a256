"""Which photographs of a folder are whole: whatever happens in it and to its clocks, at rest it is the best of each."""

from pathlib import PurePath

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.survey.hot_folder import HotFolder, WholeFile, list_photographs, photograph_of
from scene.current import FileLook


def look(size, mtime=0, inode=1):
    return FileLook(size, mtime, mtime, inode)


def names(wholes):
    return [whole.name for whole in wholes]


def test_photographs_alone_are_listed_and_nothing_hidden(tmp_path):
    for name in ("a.dng", "b.txt", ".c.dng", "sub/d.DNG", ".sub/e.dng"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    assert set(list_photographs(tmp_path)) == {"a.dng", "sub/d.DNG"}
    assert list_photographs(tmp_path / "none") is None


@pytest.mark.parametrize("other", [look(20), look(10, mtime=-(10**18)), look(10, inode=2)])
def test_a_file_is_whole_when_it_has_stood_still(other):
    """What the files' own clock says is only another look."""
    hot = HotFolder()
    assert hot.see({"a.dng": look(10)}, 0.0) == []
    assert hot.see({"a.dng": other}, 0.4) == []
    assert hot.see({"a.dng": other}, 0.8) == []
    assert hot.is_growing
    assert hot.see({"a.dng": other}, 0.9) == [WholeFile("a.dng", other)]
    assert not hot.is_growing


def test_raw_and_jpeg_are_one_photograph_whichever_comes_first():
    hot, jpeg, raw = HotFolder(), {"a.jpg": look(1)}, {"a.dng": look(5)}
    assert hot.see(jpeg, 0.0) == hot.see(jpeg, 2.9) == [], "its RAW file may still come"
    assert names(hot.see(jpeg, 3.0)) == ["a.jpg"]
    assert names(hot.see(jpeg | raw, 4.0)) == ["a.jpg"], "its RAW file comes, and is not whole yet"
    assert names(hot.see(jpeg | raw | {"b.jpg": look(2)}, 4.5)) == ["a.dng"]
    assert names(hot.see(jpeg | raw | {"b.jpg": look(2)}, 7.5)) == ["a.dng", "b.jpg"]
    alone = HotFolder()
    alone.see(jpeg, 0.0)
    alone.see(jpeg, 3.0)
    alone.see(jpeg | {"b.jpg": look(2)}, 3.1)
    assert names(alone.see(jpeg | {"b.jpg": look(2)}, 3.6)) == ["a.jpg", "b.jpg"], "where pictures come alone"


def test_a_folder_that_is_gone_says_nothing_of_its_files():
    hot = HotFolder()
    hot.see({"a.dng": look(10)}, 0.0)
    assert names(hot.see(None, 0.5)) == ["a.dng"]
    assert not hot.is_there
    assert hot.see({}, 1.0) == []
    assert hot.is_there


NAMES = st.sampled_from(["a.dng", "a.jpg", "b.dng", "b.jpg", "c.dng", "sub/a.dng"])
ACTIONS = st.one_of(
    st.tuples(st.just("write"), NAMES, st.integers(1, 4)),
    st.tuples(st.just("delete"), NAMES, st.just(0)),
    st.tuples(st.just("rename"), NAMES, NAMES),
    st.tuples(st.just("wall clock"), st.just(""), st.integers(-(10**12), 10**12)),
    st.tuples(st.just("vanish"), st.just(""), st.just(0)),
    st.tuples(st.just("restart"), st.just(""), st.just(0)),
    st.tuples(st.just("wait"), st.just(""), st.sampled_from([0.0, 0.1, 0.3, 0.6, 5.0])),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(ACTIONS, max_size=40))
def test_at_rest_the_best_file_of_every_photograph_is_whole_as_it_stands(actions):
    files: dict[str, FileLook] = {}
    hot, wall, now = HotFolder(), 0, 0.0
    for inode, (what, name, value) in enumerate(actions):
        now += 0.05
        if what == "write":
            files[name] = look(value, wall + inode, inode)
        elif what == "delete":
            files.pop(name, None)
        elif what == "rename" and name in files and value != name:
            files[value] = files.pop(name)
        elif what == "wall clock":
            wall += value
        elif what == "restart":
            hot = HotFolder()
        elif what == "wait":
            now += value
        found = hot.see(None if what == "vanish" else dict(files), now)
        assert len({photograph_of(one.name) for one in found}) == len(found)
        if what != "vanish":
            assert {photograph_of(one.name) for one in found} <= {photograph_of(one) for one in files}
    for _ in range(2):
        now += 10
        found = hot.see(dict(files), now)
    best = {}
    for name in sorted(files, key=lambda one: PurePath(one).suffix != ".dng"):
        best.setdefault(photograph_of(name), WholeFile(name, files[name]))
    assert sorted(found) == sorted(best.values())
    assert not hot.is_growing
