"""What was found, in a few lines above all tabs; what session.toml would say and assume; the button that writes it."""

import os
import re
from pathlib import Path

from lab.session_place import MANIFEST
from shoot.init.draft import Draft
from shoot.init.draft_notes import notes_of
from shoot.init.session_text import facts_of
from studio.new_session.new_session_window import NewSessionWindow
from studio.widgets import code, fenced, plain


class FoundPanel:
    """The folder, how far it was looked at, and what it holds."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, gui = window, window.client.gui
        self._names = {_name(files.folder, window): files for files in window.looking.folders}
        if len(self._names) > 1:
            gui.add_markdown("Several objects: each gets a session of its own.")
        self._object = gui.add_dropdown("object", tuple(self._names), visible=len(self._names) > 1)
        self._state = gui.add_markdown("")
        self._bar = gui.add_progress_bar(0, visible=False, animated=True)
        self._open = window.button("Open its session", window.open_session, kind="main", visible=False)
        window.on_input(self._object, lambda name: window.open(self._names[name]))

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        self._object.value = next(name for name, files in self._names.items() if files is window.files)
        self._bar.visible, self._bar.value = window.is_looking, 100 * window.share
        self._open.visible = window.capture is None and window.manifest.exists()
        if window.capture is None:
            told = "has a session.toml, which stays as it is." if self._open.visible else window.state
            self._state.content = f"{code(str(window.files.folder))}\n\n**{plain(told)}**"
        else:
            self._state.content = found_text(window.capture)


def _name(folder: Path, window: NewSessionWindow) -> str:
    if len(window.looking.folders) == 1:
        return folder.name
    there = " (has a session.toml)" if (folder / MANIFEST).exists() else ""
    top = os.path.commonpath([files.folder.parent for files in window.looking.folders])
    return f"{folder.relative_to(top)}{there}"


def found_text(draft: Draft) -> str:
    """Return what was found, as Markdown."""
    lines = [code(str(draft.folder)), ""]
    # No table: its first column would be as wide as the longest key, and the panel is narrow.
    lines += [f"- **{plain(what)}**: {plain(text)}" for what, text in facts_of(draft)]
    count = len(notes_of(draft))
    notes = f"⚠ {count} missing or assumed: see **session.toml**." if count else "Nothing is missing, nothing assumed."
    return "\n".join([*lines, "", notes])


class TextPanel:
    """What would be written; what is assumed stands above it, in the file as here."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window, self._text = window, window.client.gui.add_markdown("")

    def refresh(self) -> None:
        """Follow the window."""
        if self._window.capture is not None:
            # The columns of comments would be cut off here.
            self._text.content = fenced(re.sub(r"(?<=\S) {2,}#", "  #", self._window.text), "toml")


class WritePanel:
    """Write session.toml; what is run then, the session's own tabs have."""

    def __init__(self, window: NewSessionWindow) -> None:
        self._window = window
        self._write = window.button("Write session", window.write, kind="main", visible=False)
        self._where = window.client.gui.add_markdown("")

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        self._write.visible = window.capture is not None
        if window.capture is not None:
            out = window.workspace.name(window.out)
            self._where.content = f"Writes {code(str(window.manifest))}. Results go to {code(out)}."
