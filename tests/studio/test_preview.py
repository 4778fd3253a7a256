"""The order in which previews are drawn: without a renderer."""

import threading

import numpy as np
import pytest

from studio.editor import edits, preview
from studio.editor.preview import Preview

PICTURE = np.zeros((2, 2, 3), np.float32)


@pytest.fixture
def slowly(monkeypatch):
    """A preview whose refined pictures are of four slices, each of which ends when it is let."""
    began, let = threading.Semaphore(0), threading.Semaphore(0)

    def refining(scene, light, **_):
        for _ in range(4):
            began.release()
            assert let.acquire(timeout=60)
            yield None
        yield PICTURE

    monkeypatch.setattr(preview, "refining", refining)
    monkeypatch.setattr(preview, "first_picture", lambda scene, light, **_: PICTURE)
    monkeypatch.setattr(preview, "STILL_S", 0.0)
    running = Preview()
    running.began, running.let = began, let
    yield running
    let.release(100)
    running.close()


class Shown:
    """What a browser was shown, in the order of all."""

    def __init__(self):
        self.rows, self._change = [], threading.Condition()

    def by(self, name):
        def show(drawn):
            with self._change:
                self.rows.append((name, drawn.light, drawn.is_refined))
                self._change.notify_all()

        return show

    def until(self, row):
        with self._change:
            assert self._change.wait_for(lambda: row in self.rows, 60), self.rows


def test_first_pictures_come_between_the_slices_of_a_refined_one(slowly):
    scene, shown = edits.start_document().scene(), Shown()
    slowly.request(1, scene, 3, shown.by("one"))
    assert slowly.began.acquire(timeout=60)
    slowly.request(2, scene, 5, shown.by("two"))
    slowly.let.release()
    shown.until(("two", "light_005", False))
    slowly.let.release(100)
    shown.until(("two", "light_005", True))
    assert shown.rows == [
        ("one", "light_003", False),
        ("two", "light_005", False),
        ("one", "light_003", True),
        ("two", "light_005", True),
    ]


def test_a_refined_picture_that_is_no_longer_wanted_is_dropped(slowly):
    """Not shown under the light that is chosen now, and not drawn to its end."""
    scene, shown = edits.start_document().scene(), Shown()
    slowly.request(1, scene, 3, shown.by("first"))
    assert slowly.began.acquire(timeout=60)
    slowly.request(1, scene, 4, shown.by("second"))
    slowly.let.release(5)
    shown.until(("second", "light_004", True))
    assert ("first", "light_003", True) not in shown.rows
    assert shown.rows.count(("second", "light_004", False)) == 1


def test_a_forgotten_browser_is_shown_nothing(slowly):
    scene, shown = edits.start_document().scene(), Shown()
    slowly.request(1, scene, 0, shown.by("gone"))
    assert slowly.began.acquire(timeout=60)
    slowly.forget(1)
    slowly.request(2, scene, 1, shown.by("here"))
    slowly.let.release(100)
    shown.until(("here", "light_001", True))
    assert ("gone", "light_000", True) not in shown.rows
