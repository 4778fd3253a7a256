"""The report, and what concerns the whole folder."""

from html import escape

from studio.review.folder import is_kept
from studio.review.review_window import ReviewWindow


class VerdictPanel:
    """The report lies over the view; here it can be opened alone, and the folder read again."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._link, self._lacks = gui.add_html(""), gui.add_markdown("")
        window.button("Read the folder again", window.read_again)
        self._forget = window.button("Forget what was kept", window.forget, kind="danger")

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
