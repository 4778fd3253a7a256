"""What session.toml would say and what it would assume; and the button that writes it."""

import re

from lab.init.draft_notes import notes_of
from studio.new_session.new_session_window import NewSessionWindow
from studio.widgets import code, fenced, plain


class TextPanel:
    """What is assumed, and what would be written."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        self._notes, self._text = gui.add_markdown(""), gui.add_markdown("")

    def refresh(self) -> None:
        """Follow the window."""
        if self._window.capture is None:
            return
        notes = [f"- ⚠ {plain(note)}" for note in notes_of(self._window.draft)]
        self._notes.content = "\n".join(["**What is missing or assumed**", "", *notes] if notes else [])
        # The columns of comments would be cut off here.
        self._text.content = fenced(re.sub(r" {2,}#", "  #", self._window.text), "toml")


class WritePanel:
    """Write session.toml; what is run then, the session's own tabs have."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window = window
        self._write = window.button("Write session", window.write, kind="main")
        self._where = window.client.gui.add_markdown("")

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        self._write.visible = window.capture is not None
        if window.capture is not None:
            out = window.workspace.name(window.out)
            self._where.content = f"Writes {code(str(window.manifest))}. Results go to {code(out)}."
