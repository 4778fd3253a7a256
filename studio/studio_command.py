"""`rgbn studio` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

M_ARENA_MAX = -8
"""Of glibc's malloc.h."""


def studio(
    source: Annotated[
        Path | None,
        Parameter(
            help="A folder of photographs, a session, what `rgbn process` has made of one, or a scene description, "
            ".toml, in the workspace. Default: a page on which one is chosen."
        ),
    ] = None,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(alias="-o", help="Output folder of a session. Default: out/NAME here.")
    ] = None,
    workspace: Annotated[Path, Parameter(help="Folder that the studio reads and writes, and no other.")] = Path("."),
    port: Annotated[int, Parameter(help="0: one that is free.")] = 8080,
    host: Annotated[str, Parameter(help="Who can reach it; 127.0.0.1: this machine alone.")] = "127.0.0.1",
    browser: Annotated[bool, Parameter(help="Open it in the system's browser.")] = True,
) -> None:
    """In the browser, from a folder of photographs to the verdict; or from models to a dataset."""
    import ctypes
    import threading
    import warnings
    import webbrowser

    from lab.progress import say
    from studio.desk import Desk
    from studio.guarded_server import LOOPBACK
    from studio.opening import lay
    from studio.server import Studio
    from studio.workspace import Workspace

    # viser's, of each place that still writes when its window is closed.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    # A window's thread would else get memory of its own from glibc, which keeps most of it when the window is closed.
    if hasattr(ctypes.CDLL(None), "mallopt"):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 2)
    place = Workspace.at(workspace)
    desk = Desk()
    if source is not None:
        lay(desk, place, source, out)
    running = Studio(place, host=host, port=port, desk=desk)
    say(f"studio: {running.address}   workspace {place.root}   Ctrl-C ends it")
    if host not in LOOPBACK:
        say(
            "warning: whoever reaches this address can read and write the workspace; there is no password.", always=True
        )
    if browser:
        # Where the system has none, the address that was printed does.
        webbrowser.open(running.address)
    try:
        threading.Event().wait()
    finally:
        running.close()
