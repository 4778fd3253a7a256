"""What counts as a photograph that was taken: by content, through renames, copies, and a run that is killed."""

import pytest

from capture.hot_folder.ledger import Ledger
from capture.hot_folder.tracker import Look, Whole
from scene.errors import SceneError


@pytest.fixture
def ledger(tmp_path):
    return Ledger(tmp_path / "ledger.json")


def take(ledger, digest, name, files, *, mtime=0):
    """Take a file with some content; `files` is how all files of the folder look now."""
    files[name] = Look(len(digest), mtime, hash(digest) % 1000)
    whole = Whole(name, files[name])
    event = ledger.event(digest, whole, files.get)
    ledger.take(digest, whole, event)
    return event


def counted(ledger):
    return [(entry.digest, entry.name) for entry in ledger.entries]


def test_what_was_taken_is_read_again_from_the_file(ledger):
    files = {}
    assert take(ledger, "aa", "a.dng", files) == "new"
    assert take(ledger, "bb", "b.dng", files) == "new"
    again = Ledger(ledger.path)
    assert counted(again) == counted(ledger) == [("aa", "a.dng"), ("bb", "b.dng")]
    assert again.whole == [Whole("a.dng", files["a.dng"]), Whole("b.dng", files["b.dng"])]


def test_a_renamed_file_is_the_same_photograph_and_a_copy_is_none(ledger):
    files = {}
    take(ledger, "aa", "a.dng", files)
    assert take(ledger, "aa", "b.dng", files) == "copy"
    assert counted(ledger) == [("aa", "a.dng")]
    del files["a.dng"]
    assert take(ledger, "aa", "c.dng", files) == "moved"
    assert counted(ledger) == [("aa", "c.dng")]


def test_two_files_that_exchange_their_names_are_still_two(ledger):
    files = {}
    take(ledger, "aa", "a.dng", files, mtime=1)
    take(ledger, "bb", "b.dng", files, mtime=2)
    files["a.dng"], files["b.dng"] = files["b.dng"], files["a.dng"]
    for digest, name in (("bb", "a.dng"), ("aa", "b.dng")):
        whole = Whole(name, files[name])
        ledger.take(digest, whole, ledger.event(digest, whole, files.get))
    assert sorted(counted(ledger)) == [("aa", "b.dng"), ("bb", "a.dng")]


def test_other_content_takes_the_place_and_a_raw_file_that_of_its_jpeg(ledger):
    files = {}
    take(ledger, "half", "a.jpg", files)
    take(ledger, "whole", "a.jpg", files)
    assert counted(ledger) == [("whole", "a.jpg")]
    take(ledger, "raw", "a.dng", files)
    assert counted(ledger) == [("raw", "a.dng")]
    assert take(ledger, "half", "b.jpg", files) == "known", "it comes back: it is not decoded a second time"
    assert counted(Ledger(ledger.path)) == [("half", "b.jpg"), ("raw", "a.dng")]


def test_a_damaged_ledger_is_one_message(tmp_path):
    path = tmp_path / "ledger.json"
    path.write_text('{"taken": [{"digest": 3}]}')
    with pytest.raises(SceneError, match=r"ledger.json: is no ledger of photographs.*Remove it"):
        Ledger(path)
