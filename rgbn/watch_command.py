"""`rgbn watch` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from rgbn.init_command import NOTHING
from shoot.init.answers import Answers


def watch(
    folder: Annotated[Path, Parameter(help="Folder that the camera's program writes into.")],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(alias="-o", help="Output folder. Default: out/NAME here, by the folder's name.")
    ] = None,
    until_idle: Annotated[
        float | None,
        Parameter(
            help="Seconds without a new photograph after which the shoot is over. Default: Ctrl-C.",
            validator=Number(gt=0, lt=1e7),
        ),
    ] = None,
    wanted_deg: Annotated[
        float, Parameter(help="Sigma of the normals, degrees, that is good enough.", validator=Number(gt=0, lt=90))
    ] = 1.0,
    told: Answers = NOTHING,
) -> None:
    """Judge each photograph of a shoot within seconds of its coming, and write the session in the end."""
    from shoot.watch.watch_folder import watch_folder

    watch_folder(folder, out, told, until_idle_s=until_idle, wanted_deg=wanted_deg)
