"""The normals of a method beside the photograph, and how far each method is from the truth."""

from compare.report.facts import read_optional
from compare.report.pictures import normal_picture
from compare.report.registration_pictures import WIDTH
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
