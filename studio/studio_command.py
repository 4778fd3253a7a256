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
            help="A scene description, .toml, in the workspace; what `rgbn process` has made of a session, or that "
            "session, to be reviewed; or a folder of photographs without session.toml, to begin a session. Default: a "
            "new scene."
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
) -> None:
    """In the browser: begin a session, review its frames, balls and lights; or make datasets from models."""
    import ctypes
    import threading
    import warnings

    from capture.survey.folder_files import survey
    from lab.progress import say
    from lab.session_place import is_output, is_session
    from studio.guarded_server import LOOPBACK
    from studio.new_session.looking import Looking
    from studio.server import Studio
    from studio.workspace import Workspace
    from twin.description.description_file import read_scene

    # viser's, of each place that still writes when its window is closed.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    # A window's thread would else get memory of its own from glibc, which keeps most of it when the window is closed.
    if hasattr(ctypes.CDLL(None), "mallopt"):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 2)
    place = Workspace.at(workspace)
    scene = folder = review = looking = None
    if source is not None and source.is_dir() and not is_output(source) and not is_session(source):
        looking = Looking(survey(source), out)
        for one in looking.folders:
            place.path(looking.out_of(one.folder))
    elif source is not None and source.is_dir():
        from studio.review.folder import found_at

        output, session = found_at(source, out)
        review = place.path(output), session
    elif source is not None:
        path = place.description(str(source.resolve()))
        scene, folder = read_scene(path), path.parent if path.name == "scene.toml" else None
    running = Studio(place, host=host, port=port, scene=scene, folder=folder, review=review, looking=looking)
    say(f"studio: {running.address}   workspace {place.root}   Ctrl-C ends it")
    if host not in LOOPBACK:
        say(
            "warning: whoever reaches this address can read and write the workspace; there is no password.", always=True
        )
    try:
        threading.Event().wait()
    finally:
        running.close()
