"""The twin beside the photograph, under the same flash."""

from dataclasses import replace

import numpy as np

from compare.report.pictures import Exposure, Image, thumbnail
from compare.report.registration_pictures import WIDTH
from scene.errors import SceneError
from studio.review.folder import Review
from studio.review.review_window import Beside, ReviewWindow


class TwinPanel:
    """The rendered frame of the same flash, and by how much it differs."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._drawn: tuple | None = None
        self._facts = gui.add_markdown("")

    def refresh(self) -> None:
        """Let the twin follow the frame."""
        window, review = self._window, self._window.review
        wanted = (window.reading, window.frame, window.shown.brightness)
        if window.tab != "Twin" or "twin" in review.missing or review.material.exposure is None:
            self._drawn = None
            self._facts.content = f"**No twin**: {review.missing.get('twin', '')}"
        elif self._drawn != wanted:
            self._drawn, exposure = wanted, review.material.exposure
            exposure = replace(exposure, white=exposure.white / window.shown.brightness)
            picture, difference = twin_picture(review, window.frame, exposure)
            told = "" if np.isnan(difference) else f"; differs by {difference:.1%} of the object's brightness (median)"
            self._facts.content = f"Right: the rendered frame of the same flash{told}."
            window.beside = Beside(picture, "twin")


def twin_picture(review: Review, index: int, exposure: Exposure) -> tuple[Image, float]:
    """Return the twin's frame in the photograph's tones, and how far the two differ on the object.

    The difference is the median over the mask's pixels of abs(photograph - twin), in units of the photograph's median
    there; NaN without a mask. Raises SceneError: there is no twin, or it has no such frame.
    """
    twin, frames = review.need("twin", "frames")
    name = frames.names[index]
    if name not in twin.names or (twin.width, twin.height) != (frames.width, frames.height):
        raise SceneError(
            f"twin: it has {len(twin)} frames of {twin.width} x {twin.height} px and none that is {name}; the "
            f"session's have {frames.width} x {frames.height} px. Run the step `twin` again."
        )
    place, mask = twin.names.index(name), review.material.mask
    picture = exposure.develop(thumbnail(twin, place, WIDTH))
    if mask is None or not mask.any():
        return picture, float("nan")
    v, u = np.nonzero(mask)
    some = slice(None, None, max(1, len(v) // 100_000))
    real, clipped = frames.read_pixels(index, v[some], u[some])
    made, _ = twin.read_pixels(place, v[some], u[some])
    usual = float(np.median(real[~clipped])) if (~clipped).any() else 0.0
    return picture, float(np.median(np.abs(real - made)[~clipped]) / usual) if usual > 0 else float("nan")
