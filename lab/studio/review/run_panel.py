"""The panel that runs the session's steps, as the command line does, and reads the folder again."""

from compare.facts import read_optional
from lab.studio.review.amended import FOLDER
from lab.studio.review.desk import ReviewDesk
from lab.studio.review.steps_run import StepsRun
from scene.errors import SceneError

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
        desk.on_close(self._close)

    def refresh(self) -> None:
        """Say what would be run."""
        desk = self._desk
        if desk.review.session is None:
            self._what.content = desk.review.why_no_session
        else:
            corrected = self._session() != desk.review.session_path
            note = (
                "with the balls and picks that were kept" if corrected else "as the session says; nothing was corrected"
            )
            self._what.content = (
                f"Session **{desk.review.session.name}**, {note}. What is done and current is not done again; a step "
                "whose input changed is, and its results are replaced."
            )
        self._start_button.disabled = self._run is not None or desk.review.session is None

    def _session(self):
        amended = self._desk.review.store.path(FOLDER)
        return amended if (amended / "session.toml").exists() else self._desk.review.session_path

    def _start(self) -> None:
        from solve.solve import METHODS

        desk, session = self._desk, self._session()
        if self._run is not None or session is None:
            raise SceneError("the steps are running. Stop them first, or wait.")
        arguments = (read_optional(desk.review.store, "summary.json") or {}).get("arguments") or {}
        methods = tuple(name for name in arguments.get("methods") or () if name in METHODS)
        self._said = []
        self._stop_button.disabled, self._start_button.disabled = False, True
        self._run = StepsRun(
            session,
            desk.review.store.folder,
            lambda line: desk.post(lambda: self._tell(line)),
            lambda fault: desk.post(lambda: self._end(fault)),
            methods,
        )

    def _tell(self, line: str) -> None:
        self._said.append(line)
        self._lines.content = "\n".join(f"- {text}" for text in self._said[-LINES:])

    def _end(self, fault: str) -> None:
        self._idle()
        self._desk.read_again()
        if fault:
            self._lines.content = f"**Stopped by a fault.** {fault}"
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
