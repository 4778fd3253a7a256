"""`rgbn watch` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from rgbn.init_command import NOTHING
from scene.errors import SceneError
from shoot.init.answers import Answers


def watch(
    folder: Annotated[Path, Parameter(help="Folder that the camera's program writes into.")],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(alias="-o", help="Output folder. Default: out/NAME here, by the folder's name.")
    ] = None,
    until_idle: Annotated[
        float | None, Parameter(help="Seconds without a new photograph after which the shoot is over. Default: Ctrl-C.")
    ] = None,
    on_warning: Annotated[
        str | None,
        Parameter(help="Command that is run for each warning, with the warning as its last word; no shell runs it."),
    ] = None,
    bell: Annotated[bool, Parameter(help="Ring the terminal's bell at each warning.")] = True,
    wanted_deg: Annotated[float, Parameter(help="Sigma of the normals, degrees, that is good enough.")] = 1.0,
    told: Answers = NOTHING,
) -> None:
    """Judge each photograph of a shoot within seconds of its coming, and write the session in the end."""
    from shoot.watch.alarm import Alarm
    from shoot.watch.watch_folder import watch_folder

    for option, value in (("--until-idle", until_idle), ("--wanted-deg", wanted_deg)):
        if value is not None and not 0 < value < 1e7:
            raise SceneError(f"{option} {value:g}: expected a number above 0.")
    alarm = Alarm(on_warning, bell=bell)
    folder = folder.resolve()
    watch_folder(
        folder,
        out,
        told,
        alarm,
        until_idle_s=until_idle,
        wanted_deg=wanted_deg,
    )
