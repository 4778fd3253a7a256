"""A real folder: listed, woken by events, gone and back again."""

import threading
import time

from capture.hot_folder.hot_folder import HotFolder, list_photographs


def wait_for(hot, count, limit_s=10.0):
    """Return the files that are whole, once there are so many."""
    end = time.monotonic() + limit_s
    while len(found := hot.whole()) < count:
        assert time.monotonic() < end
        hot.wait()
    return [whole.name for whole in found]


def test_photographs_alone_are_listed_and_nothing_hidden(tmp_path):
    for name in ("a.dng", "b.txt", ".c.dng", "sub/d.DNG", ".sub/e.dng"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    assert set(list_photographs(tmp_path)) == {"a.dng", "sub/d.DNG"}
    assert list_photographs(tmp_path / "none") is None


def test_a_file_is_seen_with_events_and_without(tmp_path, monkeypatch):
    with HotFolder(tmp_path) as hot:
        assert hot.whole() == []
        threading.Timer(0.1, (tmp_path / "a.dng").write_bytes, [b"x"]).start()
        assert wait_for(hot, 1) == ["a.dng"]
    # As on a network drive that tells nothing.
    monkeypatch.setattr(HotFolder, "_observe", lambda self: None)
    with HotFolder(tmp_path) as hot:
        assert wait_for(hot, 1) == ["a.dng"]


def test_a_folder_may_vanish_and_return(tmp_path):
    root, away = tmp_path / "hot", tmp_path / "away"
    root.mkdir()
    (root / "a.dng").write_bytes(b"x")
    with HotFolder(root) as hot:
        (whole,) = [one for _ in range(50) if not time.sleep(0.05) for one in hot.whole()][:1]
        hot.tracker.took(whole)
        root.rename(away)
        assert hot.whole() == []
        assert not hot.is_there
        away.rename(root)
        (root / "b.dng").write_bytes(b"y")
        assert wait_for(hot, 1) == ["b.dng"], "what was taken stays taken, and events come again"
        assert hot.is_there


def test_a_folder_that_is_slow_to_list_is_listed_less_often(tmp_path, monkeypatch):
    from capture.hot_folder import hot_folder

    def slow(folder):
        end = time.thread_time() + 0.05
        while time.thread_time() < end:
            pass
        return {}

    monkeypatch.setattr(hot_folder, "list_photographs", slow)
    with HotFolder(tmp_path) as hot:
        hot.whole()
        assert hot._every_s >= 0.05 / hot_folder.SHARE
