"""What a session shows on its photograph: the balls by how they are known, highlights, pixels that are picked."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.map_pictures import Image
from studio.photograph.photograph_window import Shown
from studio.photograph.plane import ROOT, Plane, add_lines, add_numbered
from studio.review.photograph_picture import Look, frame_strip, photograph

if TYPE_CHECKING:
    from studio.review.review_window import ReviewWindow

FITTED, MOVED, WAITING = (60, 220, 90), (255, 150, 0), (170, 170, 170)
"""Of a ball that was found; that a hand has moved; that was not found, and waits to be put in its place."""
SEEN, NOW = (255, 235, 60), (60, 170, 255)
"""Highlights; that of the frame that is chosen, and pixels that are picked."""
OUTLINE = (255, 0, 190)
"""Of the scan at the pose that the picks give."""


def shown_of(window: "ReviewWindow") -> Shown | None:
    """Return what a session's window shows; None: no photograph can be shown, or a shoot is."""
    review, material, first = window.review, window.review.material, window.review.first_look
    frames, exposure = material.frames, material.exposure
    if window.is_alone or (frames is None and first is None):
        return None
    size = (frames.width, frames.height) if frames is not None else first.shape[1::-1] if first is not None else (1, 1)
    plane = Plane(*size)
    found = FITTED if review.spheres else WAITING if window.tab == "Balls" else None
    is_scan = window.tab == "Scan"
    pixels, strokes = (window.picks.pixels, window.strokes) if is_scan else ((), window.strokes[:0])
    places = [tuple(plane.place(pixel, lift=0.003)) for pixel in pixels]
    return Shown(
        plane,
        None if frames is None else material.camera,
        ((window.reading, window.frame, window.how), lambda: _picture(window)),
        (window.reading, lambda: frame_strip(review)),
        window.frame,
        None if frames is None or exposure is None else (frames, exposure, 1),
        tuple(found if window.is_found(ball) else MOVED for ball in window.outlines),
        {
            "highlights": (window.frame, lambda: _add_highlights(window, plane)),
            "picks": (pixels, lambda: add_numbered(window.client.scene, f"{ROOT}/pick", places, 0.04, NOW)),
            "picked": (strokes.tobytes(), lambda: _add(window, "picked", plane.place(strokes, lift=0.002), OUTLINE, 2)),
        },
    )


def _picture(window: "ReviewWindow") -> Image:
    try:
        return photograph(window.review, window.frame, window.how)
    except SceneError as error:
        # What was to lie over it is not there: the frame as it is.
        window.show_fault(str(error))
        return photograph(window.review, window.frame, Look(brightness=window.how.brightness))


def _add(window: "ReviewWindow", name: str, strokes: NDArray[np.float64], colour: Any, width_px: float) -> list[Any]:
    return [add_lines(window.client.scene, name, strokes, colour, width_px)] if len(strokes) else []


def _add_highlights(window: "ReviewWindow", plane: Plane) -> list[Any]:
    """Mark the chosen ball's highlights by crosses."""
    seen, index = window.review.highlights_px, window.ball
    if index is None or seen is None or index >= len(seen):
        return []
    arm = 0.03 * (window.outlines[index].radius_px or 0) * plane.per_px
    crosses = arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
    crosses = plane.place(seen[index], lift=0.0024)[:, None, None] + crosses
    known = np.isfinite(seen[index]).all(-1)
    is_now = known & (np.arange(len(known)) == window.frame)
    handles = _add(window, "seen", crosses[known].reshape(-1, 2, 3), SEEN, 2)
    return handles + _add(window, "this_frame", crosses[is_now].reshape(-1, 2, 3), NOW, 4)
