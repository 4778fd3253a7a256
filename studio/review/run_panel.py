"""The button that runs the session's steps up to the open tab, and shows what comes of it."""

from pathlib import Path

from lab.options import Settings
from scene.output_folder import read_record
from studio.review.folder import is_kept
from studio.review.review_window import STEPS, ReviewWindow
from studio.widgets import code, plain
from studio.work_buttons import WorkButtons


class RunPanel:
    """Run up to the step of the tab; under Verdict all of them."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window = window
        self._what = window.client.gui.add_markdown("")
        self.work = WorkButtons(window, "Run", lambda: window.folder, self._arguments, window.read_again)
        if run := window.desk.to_run:
            window.desk.to_run = ""
            window.post(lambda: self.work.is_busy or self.work.start() if run else None)

    def refresh(self) -> None:
        """Say what would be run."""
        window, review = self._window, self._window.review
        label = "Run everything" if window.tab == "Verdict" else f"Run up to {window.tab}"
        self.work.refresh(label, disabled=review.session is None)
        if review.session is None:
            self._what.content = plain(review.why_no_session)
            return
        note = "as its session.toml says"
        if not window.is_kept_so:
            note = "with what you corrected, which is kept first"
        elif is_kept(review.store):
            note = "with the balls and picks that were kept"
        text = f"**{plain(review.session.name)}**, {note}. What is done and current is not done again."
        programs = _programs(review.store.folder)
        if programs:
            text += f" Other programs, as before: {', '.join(map(code, programs))}."
        self._what.content = text

    def _arguments(self) -> list[str]:
        window = self._window
        session = window.session_to_run()
        return ["-m", "studio.studio_run", STEPS[window.tab], str(session.resolve()), str(window.folder)]


def _programs(folder: Path) -> tuple[str, ...]:
    """Return the command lines of other programs that a run would start: a folder from elsewhere may name any."""
    record = read_record(folder)
    return () if record is None else Settings.of(record).external or ()
