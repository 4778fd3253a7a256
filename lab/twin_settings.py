"""How the twin is to be rendered: what the command line says of it."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scene.errors import SceneError

if TYPE_CHECKING:
    from twin.description.description import Sampling


@Parameter(name="*")
@dataclass(frozen=True)
class TwinSettings:
    """The twin's options.

    Parameters
    ----------
    engine : {"auto", "direct", "many", "mitsuba"} or None
        None: as the scene description says; of a session's twin `auto`.
    error : float or None
        Relative root-mean-square error that is aimed at; None: as the scene description says, of a session's twin
        0.01, or half of what its material leaves unexplained where that is more.
    layers : bool
        Keep direct and indirect light apart too.
    photograph : bool
        Of a session's twin: photograph it by a sensor as noisy as the session's.
    """

    engine: Annotated[
        Literal["auto", "direct", "many", "mitsuba"] | None,
        Parameter(help="The twin's engine; auto: the smallest that holds the error, found by a pilot rendering."),
    ] = None
    error: Annotated[float | None, Parameter(help="The twin's error that is aimed at, relative: 0.01 is 1 %.")] = None
    layers: Annotated[
        bool, Parameter(help="Keep the twin's direct and indirect light as truth_*.npy too.", negative="")
    ] = False
    photograph: Annotated[
        bool,
        Parameter(help="Give the twin of a session a noise like the photographs', Bayer and all.", negative=""),
    ] = False

    def __post_init__(self) -> None:
        if self.error is not None and not 0 < self.error < 1:
            raise SceneError(f"--error {self.error:g}: expected between 0 and 1; 0.01 is 1 %.")

    def sampling(self, given: "Sampling") -> "Sampling":
        """Return a scene's sampling with what the command line says of it."""
        said = {"engine": self.engine, "error": self.error}
        return replace(given, **{key: value for key, value in said.items() if value is not None})


AS_GIVEN = TwinSettings()
