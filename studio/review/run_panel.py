"""The panel that runs the session's steps, as the command line does, and reads the folder again."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from compare.report.facts import read_optional
from scene.errors import SceneError
from studio.background_process import BackgroundProcess
from studio.review.corrected_session import forget_kept, write_amended
from studio.review.folder import is_kept
from studio.review.review_window import ReviewWindow
from studio.widgets import code, plain

LINES = 8


class RunPanel:
    """Run, stop, read again."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._run: BackgroundProcess | None = None
        self._said: list[str] = []
        self._what = gui.add_markdown("")
        self._start_button = window.on_click(gui.add_button("Run the steps", color="green"), self._start)
        self._stop_button = window.on_click(gui.add_button("Stop", color="red", disabled=True), self._stop)
        self._lines = gui.add_markdown("")
        window.on_click(gui.add_button("Read the folder again"), window.read_again)
        self._forget_button = window.on_click(gui.add_button("Forget what was kept"), self._forget)
        window.on_close(lambda: self._run and self._run.stop())

    def refresh(self) -> None:
        """Say what would be run."""
        review, is_running = self._window.review, self._run is not None
        self._start_button.disabled = is_running or review.session is None
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

    def _check_idle(self) -> None:
        if self._run is not None:
            raise SceneError("the steps are running. Stop them first, or wait.")

    def _forget(self) -> None:
        self._check_idle()
        forget_kept(self._window.review)
        self._window.read_again()

    def _start(self) -> None:
        window, review = self._window, self._window.review
        self._check_idle()
        review.need("session")
        options = self._options()
        # The session's own file may have changed since something was kept.
        session = write_amended(review) if is_kept(review.store) else review.session_path
        assert session is not None
        self._said = []
        self._stop_button.disabled, self._start_button.disabled = False, True
        self._run = run_steps(
            session,
            review.store.folder,
            lambda line: window.post(lambda: self._tell(line)),
            lambda fault: window.post(lambda: self._end(fault)),
            options,
        )

    def _tell(self, line: str) -> None:
        self._said.append(line)
        self._lines.content = "\n".join(f"- {plain(text)}" for text in self._said[-LINES:])

    def _end(self, fault: str) -> None:
        self._idle()
        if fault:
            self._lines.content = f"**Stopped by a fault.** {plain(fault)}"
            self._window.show_fault(fault)
        else:
            self._window.notify("The steps have ended", "The folder was read again.")

    def _stop(self) -> None:
        if self._run is not None:
            self._run.stop()
            self._idle()
            self._lines.content = "Stopped. What is done is kept; **Run the steps** goes on from there."

    def _idle(self) -> None:
        self._run = None
        self._stop_button.disabled, self._start_button.disabled = True, False
        self._window.read_again()


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


def run_steps(
    session: Path, out: Path, tell: Callable[[str], Any], ended: Callable[[str], Any], options: Sequence[str] = ()
) -> BackgroundProcess:
    """Run `rgbn process SESSION --out OUT` with more options; `tell` is called with each line that it says."""
    command = [
        "-c",
        "from rgbn.cli import main; main()",
        "process",
        str(session.resolve()),
        "--out",
        str(out.resolve()),
    ]
    return BackgroundProcess([*command, *options], tell, ended)
