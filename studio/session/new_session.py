"""The window in which a session is begun: what no file tells is typed, then `rgbn init` looks at the folder."""

from typing import Any, get_args, get_origin, get_type_hints

from docstring_parser import parse_from_object

from capture.survey.folder_files import FolderFiles, survey
from lab.session_place import MANIFEST
from shoot.init.answers import Answers
from studio.session.ball_rows import MILLIMETRES
from studio.session.folder import first_look
from studio.studio_state import Edits, History, RunningJob
from studio.tabs import WORK_ROWS
from studio.widgets import Row, code, plain, text
from studio.window import Window

UNSAID = "(not said)"


class NewWindow(Window):
    """What a browser begins a session in: the state is what was typed, by the options of `rgbn init`."""

    area = "Session"

    def __init__(self, *window: Any) -> None:
        super().__init__(*window)
        assert self.state.session is not None
        self.out, place = self.state.session
        assert place is not None
        self.edited = self.place = place
        self.found: list[FolderFiles] = []
        self.state.edits.setdefault(place, Edits(History({})))

    @property
    def said(self) -> dict[str, Any]:
        """What was typed so far."""
        return self.history.state if self.history else {}

    def begin(self) -> None:
        """Sort the folder's files by their names; where each subfolder is an object's, each gets a session."""
        self.found = survey(self.place)

    def answer(self, name: str, value: Any) -> None:
        """Say what no file tells; 0 is not known."""
        self.did(name, {**self.said, name: 0 if value == UNSAID else value})
        self.refresh()

    def job(self) -> RunningJob:
        """Have the folder looked at, and session.toml written."""
        said = {f"--{name.replace('_', '-')}": value for name, value in self.said.items() if value}
        options = [name if value is True else f"{name}={value}" for name, value in said.items()]
        return RunningJob(f"Write {MANIFEST}", self.place, lambda: ["init", str(self.place), "--yes", *options])

    def work_ended(self) -> None:
        """Go on with the session; of several, to where one is chosen."""
        self.state.edits.pop(self.place)
        if len(self.found) == 1:
            self.state.edits.pop(self.out, None)
            self.state.show_session(self.out, self.found[0].folder, tab="Verdict")
        else:
            self.state.area, self.state.folder = "Open", self.place
        self.turn()


def _found(window: NewWindow) -> str:
    """Return what the names of the folder's files tell, as Markdown."""
    lines = [code(str(window.place)), ""]
    for one in window.found:
        counts = ", ".join(f"{len(files)} {kind}" for kind, files in one.by_role.items() if files)
        lines.append(f"- **{plain(one.folder.name)}**, by the names: {counts}")
    told = "What no file tells, in mm; 0: not known. Balls, camera and scan are then looked for."
    return "\n".join([*lines, "", told])


def _first(window: NewWindow) -> list[Row]:
    image = first_look(window.found[0].by_role["flash"][0]) if window.found else None
    return [] if image is None else [Row("image", start={"image": image, "format": "jpeg"})]


def _answer(name: str, hint: Any, told: str) -> Row:
    """Return the input of an option of `rgbn init`, by its type and its help."""
    kinds = get_args(hint)
    choices = next((get_args(one) for one in kinds if get_origin(one) is not None), ())
    kind = "checkbox" if bool in kinds else "dropdown" if choices else "number"
    nothing = {"checkbox": False, "dropdown": UNSAID, "number": 0.0}[kind]
    start = {"checkbox": {"value": False}, "dropdown": {"options": (UNSAID, *choices)}, "number": MILLIMETRES}[kind]
    label = f"{name.removesuffix('_mm')}, mm" if kind == "number" else name
    return Row(kind, label, lambda window: window.said.get(name) or nothing,
               lambda window, value: window.answer(name, value), {**start, "hint": told})  # fmt: skip


_HINTS = get_type_hints(Answers)
NEW_ROWS = (
    text(_found),
    *(_answer(one.arg_name, _HINTS[one.arg_name], one.description or "") for one in parse_from_object(Answers).params),
    *WORK_ROWS,
    Row("folder", "The first photograph", rows=_first),
)
"""What was found, what is asked, and the button that writes session.toml."""
