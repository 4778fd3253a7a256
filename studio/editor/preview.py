"""The preview of a scene, drawn in a thread of its own: small and rough at once, refined when nothing changes."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from studio.display_mesh import display_mesh
from twin.description.description import TwinScene

Picture = NDArray[np.float32]
WIDTH, HEIGHT = 320, 240
"""Of the refined picture; the rough one is half as large."""
ROUGH, REFINED = 4, 16
"""Paths a pixel, where any are needed."""
SLICES = 4
"""In which the refined picture is rendered: between them one that is no longer wanted is dropped."""
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


@dataclass(frozen=True, eq=False)
class _Request:
    scene: TwinScene
    light: int
    show: Callable[[Drawn], Any]
    at: float


class Preview:
    """Draws in one thread until it is closed; only the newest request counts."""

    def __init__(self) -> None:
        self._request: _Request | None = None
        self._change, self._open = threading.Condition(), True
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)
        self._thread.start()

    def request(self, scene: TwinScene, light: int, show: Callable[[Drawn], Any]) -> None:
        """Ask for a picture.

        show: Called in the preview's thread with each `Drawn`: the rough one, then the refined.
        """
        with self._change:
            self._request = _Request(scene, light, show, time.monotonic())
            self._change.notify()

    def forget(self) -> None:
        """Let go what was asked for."""
        with self._change:
            self._request = None

    def close(self) -> None:
        """Stop the thread, after the slice that it is at."""
        with self._change:
            self._open, self._request = False, None
            self._change.notify()
        self._thread.join()

    def _run(self) -> None:
        done: _Request | None = None
        while True:
            with self._change:
                self._change.wait_for(lambda: not self._open or self._request not in (None, done))  # noqa: B023
                if not self._open:
                    return
                done = request = self._request
            assert request is not None
            rough = _drawn(request, False, lambda: True)
            # While something is dragged there is always a newer request: an older first picture is better than none.
            # And one that failed says nothing yet: the refined one tells all that is at fault.
            if self._request is not None and rough is not None and rough.picture is not None:
                _show(request, rough)
            with self._change:
                left_s = request.at + STILL_S - time.monotonic()
                self._change.wait_for(lambda: self._request is not request, max(left_s, 0))  # noqa: B023
            refined = _drawn(request, True, lambda: self._request is request)  # noqa: B023
            if refined is not None and self._request is request:
                _show(request, refined)


def _show(request: _Request, drawn: Drawn) -> None:
    try:
        request.show(drawn)
    except Exception:
        traceback.print_exc()


def _drawn(request: _Request, is_refined: bool, is_wanted: Callable[[], bool]) -> Drawn | None:
    """Return a picture of a request; None: it is no longer wanted."""
    scene, light, fault, picture = request.scene, request.light, "", None
    try:
        for drawn in rendering(scene, light, is_refined=is_refined):
            picture = drawn
            if not is_wanted():
                return None
    except SceneError as error:
        fault = str(error)
    except Exception as error:
        # Whatever a strange mesh does to a renderer, the studio lives on.
        traceback.print_exc()
        fault = f"the preview failed ({type(error).__name__}: {error})."
    return Drawn(picture, is_refined, time.monotonic() - request.at, scene.lights.names[light], fault)


def fitted(scene: TwinScene, light: int, width: int, height: int) -> TwinScene:
    """Return the scene under one light, before a camera of at most width x height pixels that sees the same."""
    camera = scene.camera
    scale = min(1.0, width / camera.width, height / camera.height)
    across, down = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    small = camera.scaled(across, down, across / camera.width, down / camera.height)
    return replace(scene, camera=small, lights=scene.lights.only([light]), radii_mm=scene.radii_mm[[light]])


def rendering(scene: TwinScene, light: int, *, is_refined: bool) -> Iterator[Picture | None]:
    """Render everything under one light: interreflection, environment, mirrors, discs, wax.

    A rough picture has large meshes coarse. Yields None before each slice, and the picture (h, w, 3), linear, in the
    end. What stock Mitsuba must render is one slice. Raises RenderError: the scene is at fault, all faults told.
    """
    from twin.description.description_check import check_scene
    from twin.engines.engine_choice import choose_engine
    from twin.engines.layers import Piece, PieceRenderer, standing_light

    yield None
    if is_refined:
        check_scene(scene)
    else:
        scene = replace(scene, objects=tuple(replace(one, mesh=display_mesh(one.mesh)) for one in scene.objects))
    parts = 1 if is_refined else 2
    lit = fitted(scene, light, WIDTH // parts, HEIGHT // parts)
    film, (engine, _) = lit.film(), choose_engine(lit)
    renderer, rows = PieceRenderer(lit, film, engine), film.size[0]
    step = -(-rows // SLICES) if is_refined and engine != "mitsuba" else rows
    bands = []
    for row in range(0, rows, step):
        yield None
        piece = Piece(slice(0, 1), slice(row, min(row + step, rows)))
        bands.append(renderer.render(piece, REFINED if is_refined else ROUGH).frames()[0])
    frame, standing = np.concatenate(bands), standing_light(lit, film)
    yield film.whole(np.asarray(frame if standing is None else frame + standing, np.float32))
