"""The panel of the results: what stands side by side, the cursor, its charts and numbers, the histograms."""

import textwrap
from dataclasses import replace
from typing import Any, cast

import numpy as np

from scene.errors import SceneError
from studio.photograph.plane import add_picture
from studio.results.pixel import lit_from, numbers_at, read_pixel
from studio.results.pixel_charts import error_chart, notes_of, numbers_table, pixel_chart
from studio.results.result_maps import SIDES, Results, Side, Source
from studio.results.side_by_side import PALE, WHATS, Choice, key_of, map_picture, viewport_of
from studio.results.viewport import LARGEST, ZOOMS
from studio.review.review_window import ReviewWindow, View
from studio.widgets import Layers, plain

ROOT = "/results"
VIEW: View = "Results"
WIDE, GAP, BELOW = 4.0, 0.1, 1.0
"""Width of a picture, way between both, and room below them, in the view's units."""
MIDDLES = (-(WIDE + GAP) / 2, (WIDE + GAP) / 2)
PLOT: dict[str, Any] = {"aspect": 0.75, "config": {"displayModeBar": False}}
STEPS = {"left": (-0.5, 0.0), "right": (0.5, 0.0), "up": (0.0, -0.5), "down": (0.0, 0.5)}


class ResultsPanel:
    """Maps side by side in the view, and what is known of the pixel that is clicked."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._layers = Layers()
        self._root = window.client.scene.add_frame(ROOT, show_axes=False, visible=False)
        self._pictures: list[Any] = []
        self._read()
        self.choice = Choice("normals", *self._results.first_pair)
        window.button("Show side by side", self._look)
        self._lacks = gui.add_markdown("")
        self._what = gui.add_dropdown("map", WHATS)
        self._left, self._right = gui.add_dropdown("left", ("",)), gui.add_dropdown("right", ("",))
        self._zoom = gui.add_dropdown("zoom", tuple(f"{zoom} x" for zoom in ZOOMS), hint="About the cursor")
        pan = gui.add_button_group("move", tuple(STEPS))
        window.on(pan.on_click, self._move, lambda event: STEPS[event.target.value])
        self._cursor = gui.add_vector2("cursor, px", (0, 0), step=1, hint="Column and row; or click either picture")
        with gui.add_folder("Pixel"):
            self._side = gui.add_dropdown("samples of", SIDES)
            self._by = gui.add_dropdown("n · l by", ("truth",), hint="Whose normal: the x axis of the second chart")
            self._pixel_folder = gui.add_folder("Samples and fits")
        self._error_folder = gui.add_folder("Errors")
        window.on_input(self._what, lambda value: self._choose(what=value))
        window.on_input(self._left, lambda value: self._choose(left=self._source(value)))
        window.on_input(self._right, lambda value: self._choose(right=self._source(value)))
        window.on_input(self._zoom, lambda value: self._take(self.choice.zoomed(int(value.split()[0]))))
        window.on_input(self._cursor, lambda value: self.point(round(value[0]), round(value[1])))
        for handle in (self._side, self._by):
            window.on_input(handle, lambda value: window.refresh())

    def _read(self) -> None:
        """Begin anew with the folder as it was read last."""
        self._reading, self._results = self._window.reading, Results(self._window.review)
        self._lit: dict[Side, float] = {}

    def point(self, u: int, v: int) -> None:
        """Put the cursor on a pixel, or on the nearest one of the picture."""
        width, height = self._results.size
        self._choose(cursor=(int(np.clip(u, 0, width - 1)), int(np.clip(v, 0, height - 1))))

    def refresh(self) -> None:
        """Follow the window: only what changed is sent."""
        window = self._window
        if self._reading != window.reading:
            self._read()
            if not {self.choice.left, self.choice.right} <= set(self._results.sources):
                # A method that the folder no longer has.
                left, right = self._results.first_pair
                self.choice = replace(self.choice, left=left, right=right)
        results, choice = self._results, self.choice
        self._root.visible = window.view == VIEW
        self._lacks.content = "\n".join(f"- **no {part}**: {why}" for part, why in lacks(results).items())
        labels = tuple(source.label for source in results.sources)
        for handle, source in ((self._left, choice.left), (self._right, choice.right)):
            if handle.options != labels:
                handle.options = labels
            handle.value = source.label
        references = (*results.methods, "truth")
        if self._by.options != references:
            self._by.options = references
            self._by.value = references[0]
        self._what.value, self._zoom.value = choice.what, f"{choice.zoom} x"
        if choice.cursor is not None:
            self._cursor.value = choice.cursor
        self._layers.draw("face", (window.view, self._reading, window.looks), self._face)
        if window.view != VIEW:
            return
        self._layers.draw("frame", self._reading, self._add_pictures)
        self._layers.draw("pictures", (self._reading, choice), self._draw)
        methods = [source.method for source in (choice.left, choice.right) if source.method in results.methods]
        self._layers.draw("errors", (self._reading, tuple(methods)), lambda: self._add_errors(methods))
        key = (self._reading, choice.cursor, self._side.value, self._by.value)
        self._layers.draw("pixel", key, self._add_pixel)

    def _source(self, label: str) -> Source:
        return next(source for source in self._results.sources if source.label == label)

    def _choose(self, **changes: Any) -> None:
        self._take(replace(self.choice, **changes))

    def _take(self, choice: Choice) -> None:
        self.choice = choice
        self._look()

    def _move(self, across: float, down: float) -> None:
        self._take(self.choice.moved(self._results, across, down))

    def _look(self) -> None:
        self._window.choose(view=VIEW)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of each picture in the view's units."""
        viewport = viewport_of(self._results, self.choice)
        return WIDE, WIDE * viewport.high / viewport.wide

    def _face(self) -> None:
        """Look straight at both pictures when they are first shown."""
        if self._window.view == VIEW:
            wide, high = self.size
            self._window.look_straight([0.0, -BELOW / 2, 0.0], 2 * wide + GAP, high + BELOW + 0.5)

    def _add_pictures(self) -> list[Any]:
        """Add both pictures, in which what has changed is drawn anew: nothing flickers."""
        # Without loss: a colour is a value.
        blank, look = np.full((2, 2, 3), PALE, np.uint8), {"use": self._clicked, "lossless": True}
        places = [(f"{ROOT}/{side}", blank, self.size, (x, 0.0, 0.0)) for side, x in enumerate(MIDDLES)]
        self._pictures = [add_picture(self._window, *place, **look) for place in places]
        return self._pictures

    def _clicked(self, across: float, down: float) -> None:
        pixel = viewport_of(self._results, self.choice).pixel(across, down)
        if pixel is not None:
            self.point(*pixel)

    def _draw(self) -> list[Any]:
        """Draw both maps, with their names above, the key below, and in the place of one that is not there, why."""
        results, choice, view, (wide, high) = self._results, self.choice, self._window.client.scene, self.size
        labels = []
        for picture, x, source in zip(self._pictures, MIDDLES, (choice.left, choice.right), strict=True):
            labels.append((f"{choice.what}: {source.label}", (x - wide / 2, high / 2 + 0.1), "bottom-left"))
            try:
                picture.image = map_picture(results, choice, source)
            except SceneError as error:
                picture.image = np.full((2, 2, 3), PALE, np.uint8)
                labels.append((textwrap.fill(str(error), 36), (x, 0.0), "center-center"))
        key, words = key_of(results, choice)
        left, handles = -wide - GAP / 2, []
        if key is not None:
            broad, low = wide * key.shape[1] / LARGEST, wide * key.shape[0] / LARGEST
            place = (left + broad / 2, -high / 2 - 0.1 - low / 2, 0)
            handles.append(add_picture(self._window, f"{ROOT}/key", key, (broad, low), place))
            left += broad + 0.1
        labels.append((textwrap.fill(words, 36), (left, -high / 2 - 0.15), "top-left"))
        for number, (text, place, anchor) in enumerate(labels):
            handles.append(view.add_label(f"{ROOT}/words_{number}", text, position=(*place, 0.0), anchor=anchor))
        return handles

    def _add_errors(self, methods: list[str]) -> list[Any]:
        gui = self._window.client.gui
        with self._error_folder:
            if not self._results.known_errors:
                why = "there is no ground truth" if self._results.review.truth is None else "no normals are known"
                return [gui.add_markdown(f"No errors: {why}.")]
            figure, words = error_chart(self._results, methods)
            return [gui.add_plotly(figure, **PLOT), gui.add_markdown(words)]

    def _add_pixel(self) -> list[Any]:
        gui, cursor = self._window.client.gui, self.choice.cursor
        with self._pixel_folder:
            if cursor is None:
                return [gui.add_markdown("Click a pixel of either picture.")]
            handles: list[Any] = [gui.add_html(numbers_table(numbers_at(self._results, *cursor)))]
            try:
                side = cast(Side, self._side.value)
                if side not in self._lit:
                    self._lit[side] = lit_from(self._results, side)
                pixel = read_pixel(self._results, side, *cursor, lit_from=self._lit[side])
            except SceneError as error:
                return [*handles, gui.add_markdown(f"**No samples**: {plain(str(error))}")]
            handles.append(gui.add_markdown(f"**{side}, pixel {pixel.u}, {pixel.v}**"))
            handles += [gui.add_plotly(pixel_chart(pixel), **PLOT), gui.add_markdown(notes_of(pixel))]
            try:
                handles.append(gui.add_plotly(pixel_chart(pixel, self._by.value), **PLOT))
            except SceneError as error:
                handles.append(gui.add_markdown(plain(str(error))))
            return handles


def lacks(results: Results) -> dict[str, str]:
    """Return what results cannot be shown, and why."""
    missing = results.review.missing
    parts = {"ground truth": missing.get("scan"), "twin": missing.get("twin"), "frames": missing.get("frames"),
             "lights": missing.get("lights")}  # fmt: skip
    found = {part: why for part, why in parts.items() if why}
    return found if results.methods else {"normals": "the step `solve` has left none here."} | found
