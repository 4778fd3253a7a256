"""The preview's one thread: it draws the newest request of each browser, rough at once and refined when still."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from scene.errors import SceneError
from studio.editor.live_scene import LiveScene, Picture, refining
from twin.description.description import TwinScene

WIDTH, HEIGHT = 320, 240
STILL_S = 0.4
"""So long after the last change the picture is refined."""


@dataclass(frozen=True)
class Drawn:
    """A picture, or why there is none.

    picture (h, w, 3): Linear.
    seconds: From the request to the picture.
    light: Name of the light that shines in it.
    fault: Empty where there is a picture.
    """

    picture: Picture | None
    is_refined: bool
    seconds: float
    light: str
    fault: str = ""

    @property
    def stage(self) -> str:
        """In words, with the seconds."""
        return f"{'refined' if self.is_refined else 'first picture'}, {self.seconds:.2f} s"


@dataclass
class _Request:
    """What a browser wants to see."""

    scene: TwinScene
    light: int
    show: Callable[[Drawn], Any]
    at: float
    is_rough_done: bool = False
    slices: Iterator[Picture | None] | None = None
    """Of the refined picture, once it is begun."""


@dataclass
class _Client:
    """What is kept of a browser."""

    live: LiveScene = field(default_factory=LiveScene)
    request: _Request | None = None


class Preview:
    """Draws the previews of all browsers in one thread until it is closed.

    A refined picture is drawn in slices: first pictures, of whichever browser, come between them, and one that is no
    longer wanted is dropped.
    """

    def __init__(self) -> None:
        self._windows: dict[int, _Client] = {}
        self._change = threading.Condition()
        self._open = True
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)
        self._thread.start()

    def request(self, window: int, scene: TwinScene, light: int, show: Callable[[Drawn], Any]) -> None:
        """Ask for a picture; a request of the same window that is not yet met is forgotten.

        window: Whose request. show: Called in the preview's thread with each `Drawn`: the rough one, then the refined.
        """
        with self._change:
            self._windows.setdefault(window, _Client()).request = _Request(scene, light, show, time.monotonic())
            self._change.notify()

    def forget(self, window: int) -> None:
        """Let go what is kept for a browser that went away."""
        with self._change:
            self._windows.pop(window, None)

    def close(self) -> None:
        """Stop the thread, after the picture that it is at."""
        with self._change:
            self._open = False
            self._change.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._change:
                found = self._next()
                while self._open and found is None:
                    self._change.wait(self._until_still())
                    found = self._next()
                if not self._open:
                    self._windows.clear()
                    return
            assert found is not None
            window, request = found
            drawn = self._drawn(window, request)
            if drawn is None:
                continue
            with self._change:
                is_newest = window.request is request
                if is_newest and drawn.is_refined:
                    window.request = None
                request.is_rough_done = True
                is_here = window in self._windows.values()
            # While something is dragged there is always a newer request: an older first picture is better than none.
            # And one that failed says nothing yet: the refined one tells all that is at fault.
            wanted = is_newest if drawn.is_refined else drawn.picture is not None
            if is_here and wanted:
                try:
                    request.show(drawn)
                except Exception:
                    traceback.print_exc()

    def _next(self) -> tuple[_Client, _Request] | None:
        """Return the oldest request for a rough picture, else one that has been still."""
        requests = [(window, window.request) for window in self._windows.values() if window.request is not None]
        rough = [pair for pair in requests if not pair[1].is_rough_done]
        still = [pair for pair in requests if pair[1].at + STILL_S <= time.monotonic()]
        return min(rough or still, key=lambda pair: pair[1].at, default=None)

    def _until_still(self) -> float | None:
        times = [window.request.at + STILL_S for window in self._windows.values() if window.request is not None]
        return max(0.01, min(times) - time.monotonic()) if times else None

    def _drawn(self, window: _Client, request: _Request) -> Drawn | None:
        """Return the next picture of a request; None: a slice of it was drawn."""
        scene, second, fault, picture = request.scene, request.is_rough_done, "", None
        try:
            if second:
                request.slices = request.slices or refining(scene, request.light, width=WIDTH, height=HEIGHT)
                picture = next(request.slices)
                if picture is None:
                    return None
            else:
                picture = window.live.picture(scene, request.light, width=WIDTH, height=HEIGHT)
        except SceneError as error:
            fault = str(error)
        except Exception as error:
            # Whatever a strange mesh does to a renderer, the studio lives on.
            traceback.print_exc()
            fault, window.live = f"the preview failed ({type(error).__name__}: {error}).", LiveScene()
        return Drawn(picture, second, time.monotonic() - request.at, scene.lights.names[request.light], fault)
