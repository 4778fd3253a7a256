"""The results in the browser: a method's normals and the twin beside the photograph; the report."""

from dataclasses import replace
from html import escape

import numpy as np

from compare.report.facts import read_optional
from compare.report.pictures import Exposure, Image, normal_picture, thumbnail
from compare.report.registration_pictures import WIDTH
from scene.errors import SceneError
from studio.review.folder import Review, is_kept
from studio.review.review_window import Beside, ReviewWindow
from studio.widgets import plain

NONE = "(no method has run)"


class SolvePanel:
    """Which method's normals are shown, and the median errors of all."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._drawn: tuple | None = None
        self._method = gui.add_dropdown("normals of", (NONE,))
        self._errors = gui.add_markdown("")
        window.on_input(self._method, lambda value: window.refresh())

    def refresh(self) -> None:
        """Show the normals of the method that is chosen."""
        window, material = self._window, self._window.review.material
        names = tuple(material.methods) or (NONE,)
        if self._method.options != names:
            self._method.options = names
        wanted = (window.reading, self._method.value)
        if window.tab != "Solve":
            self._drawn = None
        elif self._drawn != wanted:
            self._drawn = wanted
            self._errors.content = _errors_text(window)
            normals = None if self._method.value == NONE else material.map_of("normals", self._method.value)
            if normals is not None:
                # A map of 24 megapixels is shown by a part of its pixels.
                step = max(1, normals.shape[1] // (2 * WIDTH))
                picture = normal_picture(normals[::step, ::step], min(WIDTH, normals.shape[1]))
                window.beside = Beside(
                    picture, f"normals of {self._method.value}: red right, green up, blue toward you"
                )


def _errors_text(window: ReviewWindow) -> str:
    summary = read_optional(window.review.store, "summary.json")
    methods = ((summary if isinstance(summary, dict) else {}).get("compare") or {}).get("methods") or {}
    rows = [
        f"| {plain(name)} | {value:.2f} |"
        for name in window.review.material.methods
        if (value := ((methods.get(name) or {}).get("real") or {}).get("median_deg")) is not None
    ]
    if not rows:
        return "How far each method is from the truth is told once **Verdict** has run."
    return "\n".join(["| method | median error, ° |", "|---|---|", *rows])


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


class VerdictPanel:
    """The report lies over the view; here it can be opened alone, and the folder read again."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._link, self._lacks = gui.add_html(""), gui.add_markdown("")
        window.button("Read the folder again", window.read_again)
        self._forget = window.button("Forget what was kept", window.forget, kind="danger", visible=False)

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        address = escape(window.report)
        link = (
            f'<p class="studio-link"><a href="{address}" target="_blank" rel="noopener">Open the report alone</a></p>'
        )
        self._link.content = link if address else ""
        is_there = bool(address) or window.tab != "Verdict"
        self._lacks.content = "" if is_there else "There is no report yet: **Run everything** makes it."
        self._forget.visible = is_kept(window.review.store)
