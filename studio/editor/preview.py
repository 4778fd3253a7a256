"""The preview's one thread: it draws the newest wish of each browser, rough at once and refined when still."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

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
    seconds: From the wish to the picture.
    light: Name of the light that shines in it.
    fault: Empty where there is a picture.
    """

    picture: Picture | None
    is_refined: bool
    seconds: float
    light: str
    fault: str = ""


@dataclass
class _Wish:
    """What a browser wants to see."""

    scene: TwinScene
    light: int
    show: Callable[[Drawn], None]
    at: float
    is_rough_done: bool = False
    slices: Iterator[Picture | None] | None = None
    """Of the refined picture, once it is begun."""


@dataclass
class _Desk:
    """What is kept of a browser."""

    live: LiveScene = field(default_factory=LiveScene)
    wish: _Wish | None = None


class Preview:
    """Draws the previews of all browsers in one thread until it is closed.

    A refined picture is drawn in slices: first pictures, of whichever browser, come between them, and one that is no
    longer wanted is dropped.
    """

    def __init__(self) -> None:
        self._desks: dict[int, _Desk] = {}
        self._change = threading.Condition()
        self._open = True
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)
        self._thread.start()

    def wish(self, desk: int, scene: TwinScene, light: int, show: Callable[[Drawn], None]) -> None:
        """Ask for a picture; a wish of the same desk that is not yet met is forgotten.

        desk: Whose wish. show: Called in the preview's thread with each `Drawn`: the rough one, then the refined one.
        """
        with self._change:
            self._desks.setdefault(desk, _Desk()).wish = _Wish(scene, light, show, time.monotonic())
            self._change.notify()

    def forget(self, desk: int) -> None:
        """Let go what is kept for a browser that went away."""
        with self._change:
            self._desks.pop(desk, None)

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
                    self._desks.clear()
                    return
            assert found is not None
            desk, wish = found
            drawn = self._drawn(desk, wish)
            if drawn is None:
                continue
            with self._change:
                is_newest = desk.wish is wish
                if is_newest and drawn.is_refined:
                    desk.wish = None
                wish.is_rough_done = True
                desk_is_here = desk in self._desks.values()
            # While something is dragged there is always a newer wish: an older first picture is better than none. And
            # one that failed says nothing yet: the refined one tells all that is at fault.
            wanted = is_newest if drawn.is_refined else drawn.picture is not None
            if desk_is_here and wanted:
                try:
                    wish.show(drawn)
                except Exception:
                    traceback.print_exc()

    def _next(self) -> tuple[_Desk, _Wish] | None:
        """Return the oldest wish for a rough picture, else one that has been still."""
        wishes = [(desk, desk.wish) for desk in self._desks.values() if desk.wish is not None]
        rough = [pair for pair in wishes if not pair[1].is_rough_done]
        still = [pair for pair in wishes if pair[1].at + STILL_S <= time.monotonic()]
        ready = rough or still
        return min(ready, key=lambda pair: pair[1].at) if ready else None

    def _until_still(self) -> float | None:
        times = [desk.wish.at + STILL_S for desk in self._desks.values() if desk.wish is not None]
        return max(0.01, min(times) - time.monotonic()) if times else None

    def _drawn(self, desk: _Desk, wish: _Wish) -> Drawn | None:
        """Return the next picture of a wish; None: a slice of it was drawn."""
        scene, second, fault, picture = wish.scene, wish.is_rough_done, "", None
        try:
            if second:
                wish.slices = wish.slices or refining(scene, wish.light, width=WIDTH, height=HEIGHT)
                picture = next(wish.slices)
                if picture is None:
                    return None
            else:
                picture = desk.live.picture(scene, wish.light, width=WIDTH, height=HEIGHT)
        except SceneError as error:
            fault = str(error)
        except Exception as error:
            # Whatever a strange mesh does to a renderer, the studio lives on.
            traceback.print_exc()
            fault, desk.live = f"the preview failed ({type(error).__name__}: {error}).", LiveScene()
        return Drawn(picture, second, time.monotonic() - wish.at, scene.lights.names[wish.light], fault)
