"""The panel that writes session.toml, and goes on from there."""

import re

from lab.init.draft_notes import notes_of
from studio.background_process import WorkButtons
from studio.new_session.new_session_window import NewSessionWindow
from studio.review.run_panel import process_arguments
from studio.widgets import code, fenced, plain


class WritePanel:
    """What is assumed, what would be written; write it, calibrate, go the whole way."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        self._notes = gui.add_markdown("")
        self._where = gui.add_markdown("")
        self._write = window.button("Write session.toml", window.write, color="green")
        works = {"Calibrate": lambda: self._run("calibrate"), "Go the whole way": lambda: self._run("process")}
        self._work = WorkButtons(window, works, window.open_review, window.refresh)
        self._open = window.button("Open the review", window.open_review)
        with gui.add_folder("session.toml"):
            self._text = gui.add_markdown("")

    def refresh(self) -> None:
        """Follow the window."""
        window, is_ready = self._window, self._window.capture is not None
        self._write.disabled = not is_ready or window.is_written
        self._work.disable(not is_ready or self._work.is_busy)
        self._open.disabled = not window.is_written or self._work.is_busy
        if not is_ready:
            return
        notes = [f"- ⚠ {plain(note)}" for note in notes_of(window.draft)]
        self._notes.content = "\n".join(["**What is missing or assumed**", "", *notes] if notes else [])
        # The columns of comments would be cut off here.
        self._text.content = fenced(re.sub(r" {2,}#", "  #", window.text), "toml")
        state = "Is written to" if window.is_written else "Will be written to"
        out = window.workspace.name(window.out)
        self._where.content = (
            f"{state} {code(str(window.manifest))}. **Calibrate** finds the lights, **Go the whole way** makes the "
            f"report too; each writes session.toml first, works in {code(out)}, and then shows the review."
        )

    def _run(self, verb: str) -> list[str]:
        window = self._window
        out = window.out  # Outside of the workspace nothing is begun.
        if not window.is_written:
            window.write()
        return process_arguments(window.files.folder, out, verb=verb)
