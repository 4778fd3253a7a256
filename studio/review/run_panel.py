"""The panel that runs the session's steps, as the command line does, and reads the folder again."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from compare.report.facts import read_optional
from scene.errors import SceneError
from studio.background_process import WorkButtons
from studio.review.corrected_session import forget_kept, write_amended
from studio.review.folder import is_kept
from studio.review.review_window import ReviewWindow
from studio.widgets import code, plain


class RunPanel:
    """Run, stop, read again."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._what = gui.add_markdown("")
        self.work = WorkButtons(window, {"Run the steps": self._arguments}, self._ended, window.read_again)
        window.button("Read the folder again", window.read_again)
        self._forget_button = window.button("Forget what was kept", self._forget)

    def refresh(self) -> None:
        """Say what would be run."""
        review, is_running = self._window.review, self.work.is_busy
        self.work.disable(is_running or review.session is None)
        self._forget_button.disabled = is_running or not is_kept(review.store)
        if review.session is None:
            self._what.content = plain(review.why_no_session)
            return
        note = "as the session says; nothing was corrected"
        if is_kept(review.store):
            note = "with the balls and picks that were kept; for the rest as its own session.toml says"
        text = (
            f"Session **{plain(review.session.name)}**, {note}. What is done and current is not done again; a step "
            "whose input changed is, and its results are replaced.\n\n"
        )
        try:
            options = self._options()
        except SceneError as error:
            text += f"**Cannot be run here.** {plain(str(error))}"
        else:
            text += f"As before: {code(' '.join(options))}" if options else "How it was run before is not known here."
        self._what.content = text

    def _options(self) -> list[str]:
        summary = read_optional(self._window.review.store, "summary.json")
        return options_of(summary if isinstance(summary, dict) else {})

    def _forget(self) -> None:
        self.work.check_idle()
        forget_kept(self._window.review)
        self._window.read_again()

    def _arguments(self) -> list[str]:
        review = self._window.review
        review.need("session")
        options = self._options()
        # The session's own file may have changed since something was kept.
        session = write_amended(review) if is_kept(review.store) else review.session_path
        assert session is not None
        return process_arguments(session, review.store.folder, options)

    def _ended(self) -> None:
        self._window.notify("The steps have ended", "The folder was read again.")


def options_of(summary: dict[str, Any]) -> list[str]:
    """Return the options of `rgbn process` with which a folder was made, so that what is current stays.

    summary: Of summary.json; empty: the command line's own options. Raises SceneError: the results were judged by a
    known truth, which `rgbn process` is not given.
    """
    if summary.get("truth_check"):
        raise SceneError(
            "summary.json: the results here were judged by a known truth, which a run from here would drop. Run the "
            "command that made them again: `rgbn demo --out OUT` for the demo."
        )
    arguments = summary.get("arguments") or {}
    programs, twin = arguments.get("external") or {}, arguments.get("twin") or {}
    methods = [name for name in arguments.get("methods") or () if name not in programs]
    said = {"method": ",".join(methods), "profile": arguments.get("profile"), **twin}
    options = [f"--{name}" if value is True else f"--{name}={value}" for name, value in said.items() if value]
    return options + [f"--external={name}={command}" for name, command in programs.items()]


def process_arguments(session: Path, out: Path, options: Sequence[str] = (), *, verb: str = "process") -> list[str]:
    """Return Python's arguments for `rgbn VERB SESSION --out OUT` with more options."""
    program = ["-c", "from rgbn.cli import main; main()", verb]
    return [*program, str(session.resolve()), "--out", str(out.resolve()), *options]
