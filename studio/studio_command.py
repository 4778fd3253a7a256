"""`rgbn studio` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def studio(
    source: Annotated[
        Path | None,
        Parameter(
            help="A folder of photographs, a session, a folder of sessions, an output folder, a scene description "
            "or a model in the workspace. Default: a page on which one is chosen."
        ),
    ] = None,
    /,
    *,
    out: Annotated[Path | None, Parameter(alias="-o", help="Output folder of a session. Default: out/NAME.")] = None,
    workspace: Annotated[Path, Parameter(help="Folder that is listed, and that results go into.")] = Path("."),
    port: Annotated[int, Parameter(help="Port on this machine; 0 takes a free one.")] = 8080,
    browser: Annotated[bool, Parameter(help="Open the page in the system's browser.")] = True,
) -> None:
    """Work in the browser, from a folder of photographs to the verdict, or from models to a dataset."""
    import threading
    import warnings
    import webbrowser

    from lab.progress import say
    from studio.opening import open_path
    from studio.server import Studio
    from studio.studio_state import StudioState
    from studio.workspace import Workspace

    # viser's, of each place that still writes when its window is closed.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    place = Workspace.at(workspace)
    state = StudioState()
    if source is not None:
        open_path(state, place, source, out)
    running = Studio(place, port=port, state=state)
    say(f"studio: {running.address}   workspace {place.root}   Ctrl-C ends it")
    if browser:
        # Where the system has none, the address that was printed does.
        webbrowser.open(running.address)
    try:
        threading.Event().wait()
    finally:
        running.close()
