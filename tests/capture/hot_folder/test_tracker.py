"""A pure tracker: whatever happens in a folder and to its clocks, each photograph is read, and none twice."""

import itertools
from pathlib import PurePath

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.hot_folder.tracker import PATIENCE_S, Look, Tracker, Whole, photograph_of


def look(size, mtime=0, inode=1):
    return Look(size, mtime, inode)


def names(wholes):
    return [whole.name for whole in wholes]


def test_a_file_is_whole_when_it_has_stood_still():
    tracker = Tracker(still_s=0.5)
    tracker.see({"a.dng": look(10)}, 0.0)
    assert tracker.whole(0.4) == []
    tracker.see({"a.dng": look(20)}, 0.4)
    assert tracker.whole(0.8) == [], "it has grown"
    assert tracker.next_s(0.8) == pytest.approx(0.1)
    tracker.see({"a.dng": look(20)}, 0.9)
    assert tracker.whole(0.9) == [Whole("a.dng", look(20))]
    tracker.took(Whole("a.dng", look(20)))
    assert tracker.whole(99.0) == []
    assert tracker.next_s(99.0) is None


def test_a_clock_on_the_wall_that_jumps_is_only_another_look():
    tracker = Tracker(still_s=0.5)
    tracker.see({"a.dng": look(10, mtime=10**18)}, 0.0)
    tracker.see({"a.dng": look(10, mtime=-(10**18))}, 1.0)
    assert tracker.whole(1.2) == []
    assert names(tracker.whole(1.5)) == ["a.dng"]


def test_raw_and_jpeg_are_one_photograph_whichever_comes_first():
    tracker = Tracker(still_s=0.5, alone_s=3)
    tracker.see({"a.jpg": look(1)}, 0.0)
    assert tracker.whole(1.0) == [], "its RAW file may still come"
    tracker.see({"a.jpg": look(1), "a.dng": look(5)}, 2.9)
    assert tracker.whole(3.1) == [], "and here it is, not whole yet"
    assert names(tracker.whole(3.4)) == ["a.dng"]
    tracker.took(Whole("a.dng", look(5)))
    assert tracker.whole(99) == []
    # Deleted, the RAW file leaves its JPEG, which was taken with it.
    tracker.see({"a.jpg": look(1)}, 100.0)
    assert tracker.whole(200) == []


def test_a_jpeg_that_was_taken_alone_makes_way_for_its_raw_file():
    tracker = Tracker(still_s=0.5, alone_s=3)
    tracker.see({"a.jpg": look(1)}, 0.0)
    assert names(tracker.whole(3.0)) == ["a.jpg"]
    tracker.took(Whole("a.jpg", look(1)))
    tracker.see({"a.jpg": look(1), "a.dng": look(5), "b.jpg": look(2)}, 4.0)
    assert names(tracker.whole(4.5)) == ["a.dng", "b.jpg"], "where pictures come alone, none waits for a RAW file"


def test_other_content_under_the_same_name_is_read_again():
    tracker = Tracker([Whole("a.dng", look(10))])
    tracker.see({"a.dng": look(10)}, 0.0)
    assert tracker.whole(9.0) == [], "an earlier run has taken it"
    tracker.see({"a.dng": look(10, inode=2)}, 9.0)
    assert names(tracker.whole(10.0)) == ["a.dng"]


def test_a_folder_that_is_gone_says_nothing_of_its_files():
    tracker = Tracker(still_s=0.5)
    tracker.see({"a.dng": look(10)}, 0.0)
    tracker.see(None, 0.2)
    assert names(tracker.whole(0.5)) == ["a.dng"]
    tracker.took(Whole("a.dng", look(10)))
    tracker.see({}, 1.0)
    tracker.see({"a.dng": look(10)}, 2.0)
    assert tracker.whole(9.0) == []


def test_what_cannot_be_read_is_tried_ever_more_seldom_and_then_no_more():
    tracker, now, tries = Tracker(still_s=0.5), 0.0, []
    tracker.see({"a.dng": look(10)}, now)
    while (wait := tracker.next_s(now)) is not None:
        now += wait
        (whole,) = tracker.whole(now)
        tries.append(now)
        again = tracker.refused(whole, now)
    assert not again
    waits = [b - a for a, b in itertools.pairwise(tries)]
    assert waits == sorted(waits)
    assert waits[-1] <= PATIENCE_S < 2 * waits[-1]
    tracker.see({"a.dng": look(11)}, now)
    assert names(tracker.whole(now + 1)) == ["a.dng"], "changed, it is another file"


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
def test_no_photograph_is_lost_and_none_is_read_twice_as_it_is(actions):
    """Law: at rest the best file of every photograph was read as it stands, or a better one was; and never twice."""
    files: dict[str, Look] = {}
    tracker, wall, now = Tracker(), 0, 0.0
    taken: dict[str, Whole] = {}

    def step(listing):
        tracker.see(listing, now)
        for whole in tracker.whole(now):
            assert files.get(whole.name) == whole.look or listing is None, "what is read is there as it was seen"
            if files.get(whole.name) == whole.look:
                tracker.took(whole)
                assert taken.get(photograph_of(whole.name)) != whole, "read twice as it is"
                taken[photograph_of(whole.name)] = whole

    for inode, (what, name, value) in enumerate(actions):
        now += 0.05
        if what == "write":
            files[name] = Look(value, wall + inode, inode)
        elif what == "delete":
            files.pop(name, None)
        elif what == "rename" and name in files and value != name:
            files[value] = files.pop(name)
        elif what == "wall clock":
            wall += value
        elif what == "restart":
            # The ledger knows what counts: of each photograph the file that was read last.
            tracker = Tracker(taken.values())
        elif what == "wait":
            now += value
        step(None if what == "vanish" else dict(files))
    for _ in range(3):
        now += 10
        step(dict(files))
    for key in {photograph_of(name) for name in files}:
        own = [name for name in files if photograph_of(name) == key]
        best = min(own, key=lambda name: PurePath(name).suffix != ".dng")
        last = taken[key]
        is_better = last.name.endswith(".dng") and best.endswith(".jpg")
        assert last == (best, files[best]) or is_better
