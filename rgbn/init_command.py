"""`rgbn init` as the command line has it."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from shoot.init.answers import Answers

if TYPE_CHECKING:
    from shoot.init.draft import Draft

NOTHING = Answers()


def init(
    folder: Annotated[Path, Parameter(help="Folder with the photographs; or with a folder of them for each object.")],
    /,
    *,
    yes: Annotated[
        bool, Parameter(name=["--yes", "-y"], help="Ask nothing: what is not known is assumed, and said.", negative="")
    ] = False,
    told: Answers = NOTHING,
) -> None:
    """Look at a folder of photographs, show what it holds, ask what no file tells, and write its session.toml."""
    from shoot.init.init_session import init_sessions

    made = init_sessions(folder, told, silent=yes, shown=_show)
    for one in made:
        print(f"written  {one.manifest}")
        print(f"         {one.sheet}: the balls in circles; look whether all are found")
    for one in made:
        place = shlex.quote(str(one.draft.folder))
        unknown = sorted({f" --{ball.kind} MM" for ball in one.draft.manifest.spheres if ball.diameter_mm is None})
        if unknown:
            print(f"tell     rgbn init {place}{''.join(unknown)}: diameters, for the lights' positions")
        print(f"next     rgbn process {place}")


def _show(draft: "Draft") -> None:
    """Print what was found, and what was assumed."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from shoot.init.draft_notes import notes_of
    from shoot.init.session_text import facts_of

    table = Table(title=Text(f"{draft.folder}"), show_header=False, title_justify="left", box=None)
    table.add_column(style="bold")
    table.add_column()
    for label, text in facts_of(draft):
        table.add_row(label, Text(text))
    console = Console()
    console.print(table)
    for note in notes_of(draft):
        console.print(Text("note ", style="yellow") + Text(note))
