"""The preview of a scene, drawn in a thread of its own: small and rough at once, then refined; and its panel."""

import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Exposure
from scene.errors import SceneError
from studio.widgets import Panel, Row, plain, text
from twin.description.description import TwinScene

Picture = NDArray[np.float32]
WIDTH, HEIGHT = 320, 240
"""Of the refined picture; the rough one is half as large."""
PATHS = {"first picture": 4, "refined": 16}
"""Stages of a picture: paths a pixel, where any are needed."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture (h, w, 3), linear, under the light of this name; or None and why there is none.

    stage: A key of `PATHS`.
    """

    picture: Picture | None
    stage: str
    light: str
    fault: str = ""

    @property
    def is_refined(self) -> bool:
        """Whether nothing better comes."""
        return self.stage == "refined"


class Preview:
    """Draws in one thread until it is closed; only the newest request counts."""

    def __init__(self) -> None:
        self._newest: object = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="preview")

    def request(self, scene: TwinScene, light: int, show: Callable[[Drawn], Any]) -> None:
        """Ask for a picture; `show` is called in the preview's thread with each `Drawn`: the rough one, the refined."""
        self._newest = asked = object()
        self._thread.submit(self._draw, asked, scene, light, show)

    def close(self) -> None:
        """Stop the thread, after the picture that it is at."""
        self._newest = None
        self._thread.shutdown(cancel_futures=True)

    def _draw(self, asked: object, scene: TwinScene, light: int, show: Callable[[Drawn], Any]) -> None:
        for stage in PATHS if self._newest is asked else ():
            drawn, newest = _drawn(scene, light, stage), self._newest
            # While something is dragged there is always a newer request: an older first picture is better than none.
            # And one that failed says nothing yet: the refined one tells all that is at fault.
            if newest is asked if drawn.is_refined else newest is not None and drawn.picture is not None:
                show(drawn)
            if newest is not asked:
                break


def _drawn(scene: TwinScene, light: int, stage: str) -> Drawn:
    fault, picture = "", None
    try:
        picture = rendered(scene, light, stage)
    except SceneError as error:
        fault = str(error)
    except Exception as error:
        # Whatever a strange mesh does to a renderer, the studio lives on.
        traceback.print_exc()
        fault = f"the preview failed ({type(error).__name__}: {error})."
    return Drawn(picture, stage, scene.lights.names[light], fault)


def fitted(scene: TwinScene, light: int, width: int, height: int) -> TwinScene:
    """Return the scene under one light, before a camera of at most width x height pixels that sees the same."""
    camera = scene.camera
    scale = min(1.0, width / camera.width, height / camera.height)
    across, down = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    small = camera.scaled(across, down, across / camera.width, down / camera.height)
    return replace(scene, camera=small, lights=scene.lights.only([light]), radii_mm=scene.radii_mm[[light]])


def rendered(scene: TwinScene, light: int, stage: str) -> Picture:
    """Render everything under one light, (h, w, 3) linear: interreflection, environment, mirrors, discs, wax.

    Raises RenderError: the scene is at fault; refined, all faults are told.
    """
    from twin.description.description_check import check_scene
    from twin.engines.engine_choice import choose_engine
    from twin.engines.light_layers import Piece, PieceRenderer, standing_light

    if stage == "refined":
        check_scene(scene)
    part = 1 if stage == "refined" else 2
    lit = fitted(scene, light, WIDTH // part, HEIGHT // part)
    film, (engine, _) = lit.film(), choose_engine(lit)
    piece = Piece(slice(0, 1), slice(0, film.size[0]))
    frame = PieceRenderer(lit, film, engine).render(piece, PATHS[stage]).frames()[0]
    standing = standing_light(lit, film)
    return film.whole(np.asarray(frame if standing is None else frame + standing, np.float32))


PANEL_PX = 380
"""Width."""


def _status(window: Any) -> str:
    drawn = window.drawn
    if drawn is None:
        return "drawing ..."
    if drawn.picture is None:
        return f"**No preview.** {plain(drawn.fault)}"
    return f"{plain(drawn.light)}: {drawn.stage}"


ROWS = (
    text(_status),
    Row("slider", "light", lambda window: {
        "max": max(len(window.scene.lights), 2), "disabled": len(window.scene.lights) == 1, "value": window.light + 1},
        lambda window, value: window.select("light", int(value) - 1),
        {"min": 1, "max": 2, "step": 1, "initial_value": 1, "hint": "Which light shines"}),
    Row("slider", "brightness", lambda window: window.gain, lambda window, value: window.choose(gain=value),
        {"min": 0.1, "max": 8.0, "step": 0.1, "initial_value": 1.0}),
)  # fmt: skip


class PreviewPanel:
    """The picture beside the 3-D view, with its rows."""

    def __init__(self, window: Any) -> None:
        import cv2

        self._window, self._shown, gui = window, None, window.client.gui
        panel = gui.add_panel()
        with panel.add_tab("Preview"):
            self._picture = gui.add_image(np.full((HEIGHT, WIDTH, 3), 40, np.uint8), format="png")
            self._panel = Panel(window, ROWS)
        panel.dock_left()
        panel.set_width(PANEL_PX)
        self._resize = lambda image: cv2.resize(image, (WIDTH, round(WIDTH * image.shape[0] / image.shape[1])))
        window.show_preview = self.show

    def show(self, drawn: Drawn) -> None:
        """Show a picture, or what is at fault."""
        self._window.drawn = drawn
        self.refresh()

    def refresh(self) -> None:
        """Follow the number of lights, which one is looked at, and what was drawn."""
        drawn, window = self._window.drawn, self._window
        if drawn is not None and drawn.picture is not None and self._shown != (id(drawn), window.gain):
            self._shown = id(drawn), window.gain
            self._picture.image = self._resize(Exposure(1 / window.gain, np.ones(3)).develop(drawn.picture))
        self._panel.refresh()
