"""What the command line says of the methods and of the twin, as two objects that every verb takes."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scene.errors import SceneError

if TYPE_CHECKING:
    from solve.external import External
    from twin.description.description import Sampling

DEFAULT_METHODS = "ls,iterative"


@Parameter(name="*")
@dataclass(frozen=True)
class Solving:
    """Which methods solve, and how; each field's help says what it is."""

    method: Annotated[
        str | None,
        Parameter(
            help="Photometric-stereo methods, with commas: ls, iterative, position, l1, sbl, hsh, rpca, "
            "semicalibrated, near, reflectance, ldr, entropy, tv. Default: ls,iterative; of two folders compared, all."
        ),
    ] = None
    profile: Annotated[
        str, Parameter(help="Settings of the methods: default, or seed, the plain reading of the benchmark.")
    ] = "default"
    external: Annotated[
        tuple[str, ...],
        Parameter(
            help="Another program as a method, NAME=COMMAND: it reads {data}, the photographs in the DiLiGenT layout, "
            "and writes a normal map into {out}. May be given again. See docs/learned-methods.md.",
            negative="",
            consume_multiple=False,
        ),
    ] = ()
    external_timeout_s: Annotated[float, Parameter(help="Seconds after which such a program is ended.")] = 3600.0

    def methods(self) -> tuple[str, ...]:
        """Return the names of the methods of ours.

        Raises
        ------
        SceneError
            There is no such method, or it has no such profile.
        """
        from solve.methods import METHODS, method_of

        text = DEFAULT_METHODS if self.method is None else self.method
        names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
        unknown = [name for name in names if name not in METHODS]
        if unknown or not names:
            raise SceneError(
                f"--method {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(METHODS)}."
            )
        for name in names:
            method_of(name).settings(self.profile)
        return names

    def programs(self) -> "dict[str, External]":
        """Return the other programs by name.

        Raises
        ------
        SceneError
            A text is no NAME=COMMAND, or a name is given twice.
        """
        from solve.external import External

        found: dict[str, External] = {}
        for text in self.external:
            program = External.parse(text, self.external_timeout_s)
            if program.name in found:
                raise SceneError(f"--external {program.name}: given twice. Give each program its own name.")
            found[program.name] = program
        return found


@Parameter(name="*")
@dataclass(frozen=True)
class TwinSettings:
    """How a twin is rendered.

    engine, error: None: as the scene description says; of a session's twin `auto`, and 0.01 or half of what its
    material leaves unexplained where that is more.
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


BY_DEFAULT, AS_GIVEN = Solving(), TwinSettings()
