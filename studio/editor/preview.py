"""The preview's one thread: it draws the newest request of each browser, rough at once and refined when still."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from scene.errors import SceneError
from studio.editor.preview_pictures import Picture, first_picture, refining
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


@dataclass(eq=False)
class _Request:
    """What a browser wants to see.

    slices: Of the refined picture, once it is begun.
    """

    scene: TwinScene
    light: int
    show: Callable[[Drawn], Any]
    at: float
    is_rough_done: bool = False
    slices: Iterator[Picture | None] | None = None


class Preview:
    """Draws the previews of all browsers in one thread until it is closed.

    A refined picture is drawn in slices: first pictures, of whichever browser, come between them, and one that is no
    longer wanted is dropped.
    """

    def __init__(self) -> None:
        self._requests: dict[int, _Request] = {}
        self._change = threading.Condition()
        self._open = True
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)
        self._thread.start()

    def request(self, window: int, scene: TwinScene, light: int, show: Callable[[Drawn], Any]) -> None:
        """Ask for a picture; a request of the same window that is not yet met is forgotten.

        window: Whose request. show: Called in the preview's thread with each `Drawn`: the rough one, then the refined.
        """
        with self._change:
            self._requests[window] = _Request(scene, light, show, time.monotonic())
            self._change.notify()

    def forget(self, window: int) -> None:
        """Let go what a browser asked for that went away."""
        with self._change:
            self._requests.pop(window, None)

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
                    self._requests.clear()
                    return
            assert found is not None
            window, request = found
            drawn = self._drawn(request)
            if drawn is None:
                continue
            with self._change:
                newest = self._requests.get(window)
                if newest is request and drawn.is_refined:
                    del self._requests[window]
                request.is_rough_done = True
            # While something is dragged there is always a newer request: an older first picture is better than none.
            # And one that failed says nothing yet: the refined one tells all that is at fault.
            wanted = newest is request if drawn.is_refined else newest is not None and drawn.picture is not None
            if wanted:
                try:
                    request.show(drawn)
                except Exception:
                    traceback.print_exc()

    def _next(self) -> tuple[int, _Request] | None:
        """Return the oldest request for a rough picture, else one that has been still."""
        rough = [pair for pair in self._requests.items() if not pair[1].is_rough_done]
        still = [pair for pair in self._requests.items() if pair[1].at + STILL_S <= time.monotonic()]
        return min(rough or still, key=lambda pair: pair[1].at, default=None)

    def _until_still(self) -> float | None:
        times = [request.at + STILL_S for request in self._requests.values()]
        return max(0.01, min(times) - time.monotonic()) if times else None

    def _drawn(self, request: _Request) -> Drawn | None:
        """Return the next picture of a request; None: a slice of it was drawn."""
        scene, second, fault, picture = request.scene, request.is_rough_done, "", None
        size = {"width": WIDTH, "height": HEIGHT}
        try:
            if second:
                request.slices = request.slices or refining(scene, request.light, **size)
                picture = next(request.slices)
                if picture is None:
                    return None
            else:
                picture = first_picture(scene, request.light, **size)
        except SceneError as error:
            fault = str(error)
        except Exception as error:
            # Whatever a strange mesh does to a renderer, the studio lives on.
            traceback.print_exc()
            fault = f"the preview failed ({type(error).__name__}: {error})."
        return Drawn(picture, second, time.monotonic() - request.at, scene.lights.names[request.light], fault)
