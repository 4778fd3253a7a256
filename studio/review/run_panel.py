"""The panel that runs the session's steps, as the command line does, and reads the folder again."""

from typing import Any

from compare.report.facts import read_optional
from scene.errors import SceneError
from studio.markdown import code, plain
from studio.review.corrected_session import forget_kept, write_amended
from studio.review.folder import is_kept
from studio.review.review_desk import ReviewDesk
from studio.review.steps_run import StepsRun, options_of

LINES = 8


class RunPanel:
    """Run, stop, read again."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._run: StepsRun | None = None
        self._said: list[str] = []
        self._what = gui.add_markdown("")
        self._start_button = desk.on_click(gui.add_button("Run the steps", color="green"), self._start)
        self._stop_button = desk.on_click(gui.add_button("Stop", color="red", disabled=True), self._stop)
        self._lines = gui.add_markdown("")
        desk.on_click(gui.add_button("Read the folder again"), desk.read_again)
        self._forget_button = desk.on_click(gui.add_button("Forget what was kept"), self._forget)
        desk.on_close(self._close)

    def refresh(self) -> None:
        """Say what would be run."""
        review = self._desk.review
        self._start_button.disabled = self._run is not None or review.session is None
        self._forget_button.disabled = self._run is not None or not is_kept(review.store)
        if review.session is None:
            self._what.content = plain(review.why_no_session)
            return
        note = "as the session says; nothing was corrected"
        if is_kept(review.store):
            note = "with the balls and picks that were kept; for the rest as its own session.toml says"
        text = (
            f"Session **{plain(review.session.name)}**, {note}. What is done and current is not done again; a step "
            "whose input changed is, and its results are replaced."
        )
        try:
            options = options_of(self._summary())
        except SceneError as error:
            text += f"\n\n**Cannot be run here.** {plain(str(error))}"
        else:
            said = f"As before: {code(' '.join(options))}" if options else "How it was run before is not known here."
            text += f"\n\n{said}"
        self._what.content = text

    def _summary(self) -> dict[str, Any]:
        found = read_optional(self._desk.review.store, "summary.json")
        return found if isinstance(found, dict) else {}

    def _forget(self) -> None:
        if self._run is not None:
            raise SceneError("the steps are running. Stop them first, or wait.")
        forget_kept(self._desk.review)
        self._desk.read_again()

    def _start(self) -> None:
        desk, review = self._desk, self._desk.review
        if self._run is not None or review.session_path is None:
            raise SceneError("the steps are running. Stop them first, or wait.")
        options = options_of(self._summary())
        # The session's own file may have changed since something was kept.
        session = write_amended(review) if is_kept(review.store) else review.session_path
        self._said = []
        self._stop_button.disabled, self._start_button.disabled = False, True
        self._run = StepsRun(
            session,
            review.store.folder,
            lambda line: desk.post(lambda: self._tell(line)),
            lambda fault: desk.post(lambda: self._end(fault)),
            options,
        )

    def _tell(self, line: str) -> None:
        self._said.append(line)
        self._lines.content = "\n".join(f"- {plain(text)}" for text in self._said[-LINES:])

    def _end(self, fault: str) -> None:
        self._idle()
        self._desk.read_again()
        if fault:
            self._lines.content = f"**Stopped by a fault.** {plain(fault)}"
            self._desk.tell_fault(fault)
        else:
            self._desk.tell("The steps have ended", "The folder was read again.")

    def _stop(self) -> None:
        if self._run is not None:
            self._run.stop()
            self._idle()
            self._lines.content = "Stopped. What is done is kept; **Run the steps** goes on from there."
            self._desk.read_again()

    def _idle(self) -> None:
        self._run = None
        self._stop_button.disabled, self._start_button.disabled = True, False

    def _close(self) -> None:
        if self._run is not None:
            self._run.stop()
