"""A photograph large, or the mean of the flash frames, with the balls that were found; all of them as a strip below."""

from typing import Any

from compare.report.picture_strip import INK, PictureStrip
from shoot.init.contact_sheet import COLOURS
from studio.new_session.found_capture import FoundCapture
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photograph_roles import UNUSED, role_of
from studio.photograph.outline_marks import OutlineMarks, add_crop
from studio.photograph.plane import ROOT, Plane
from studio.photograph.shown_photograph import add_photograph, add_strip, look_at_photograph
from studio.widgets import Layers

LEFT_OUT, OTHER = (255, 120, 110), (255, 210, 90)


class PhotographsView:
    """What stands in the view."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, self._layers = window, Layers()
        window.client.scene.add_frame(ROOT, show_axes=False)
        self._marks = OutlineMarks(window, lambda ball: COLOURS[ball.kind])
        self._strip: PictureStrip | None = None

    def refresh(self) -> None:
        """Show the photograph that is chosen; only what changed is sent."""
        window, draft, found, draw = self._window, self._window.capture, self._window.found, self._layers.draw
        plane = window.plane
        if draft is None or found is None or plane is None:
            self._layers.keep_only(set())
            return
        roles, shown = tuple(role_of(draft, path) for path in found.photographs), window.photograph
        now = (window.reading, window.ball)
        draw("small pictures", (window.reading, roles), lambda: self._make_strip(found, roles))
        draw("strip", (window.reading, roles, shown), lambda: self._add_strip(found, plane))
        draw("picture", (window.reading, shown), lambda: add_photograph(window, plane, found.picture(shown)))
        draw("crop", (now, shown), lambda: self._add_crop(found, plane))
        draw("face", (now, window.looks), lambda: look_at_photograph(window, plane, self._strip))
        self._marks.refresh(plane)

    def _make_strip(self, found: FoundCapture, roles: tuple[str, ...]) -> None:
        colours = {"flash": INK, UNUSED: LEFT_OUT}
        labels = [
            (path.stem if role == "flash" else f"{role}: {path.stem}", colours.get(role, OTHER))
            for path, role in zip(found.photographs, roles, strict=True)
        ]
        dimmed = [
            picture // (3 if role == UNUSED else 1) for picture, role in zip(found.thumbnails, roles, strict=True)
        ]
        self._strip = PictureStrip.of(dimmed, labels)

    def _add_strip(self, found: FoundCapture, plane: Plane) -> list[Any]:
        window, paths, strip = self._window, found.photographs, self._strip
        if strip is None:
            return []
        chosen = None if window.photograph is None else paths.index(window.photograph)

        def use(index: int) -> None:
            # A second click goes back to all of them together.
            again = window.photograph == paths[index]
            window.choose(photograph=None if again else paths[index], ball=None, looks=window.looks + 1)

        return add_strip(window, plane, strip, chosen, use)

    def _add_crop(self, found: FoundCapture, plane: Plane) -> list[Any]:
        """Show the chosen ball by all frames together, unless one of them is looked at."""
        window, draft = self._window, found.draft
        if window.ball is None or window.photograph is not None:
            return []
        ball = window.outlines[window.ball]
        return [add_crop(window, plane, draft.small, found.exposure, ball, step=draft.step)]
