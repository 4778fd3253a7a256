"""`rgbn studio` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def studio(
    source: Annotated[
        Path | None, Parameter(help="A scene description, .toml, in the workspace. Default: a new scene.")
    ] = None,
    /,
    *,
    workspace: Annotated[Path, Parameter(help="Folder that the studio reads and writes, and no other.")] = Path("."),
    port: Annotated[int, Parameter(help="0: one that is free.")] = 8080,
    host: Annotated[str, Parameter(help="Who can reach it; 127.0.0.1: this machine alone.")] = "127.0.0.1",
) -> None:
    """Make datasets in the browser: models, materials, lights, a preview, then Mitsuba's files or the frames."""
    import threading

    from lab.progress import say
    from lab.studio.server import LOOPBACK, Studio
    from lab.studio.workspace import Workspace
    from twin.description_file import read_scene

    place = Workspace.at(workspace)
    scene = folder = None
    if source is not None:
        path = place.description(str(source.resolve()))
        scene, folder = read_scene(path), path.parent if path.name == "scene.toml" else None
    running = Studio(place, host=host, port=port, scene=scene, folder=folder)
    say(f"studio: {running.address}   workspace {place.root}   Ctrl-C ends it")
    if host not in LOOPBACK:
        say("warning: whoever reaches this address can read and write the workspace; there is no password.")
    try:
        threading.Event().wait()
    finally:
        running.close()
