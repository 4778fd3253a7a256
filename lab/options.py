"""How the steps of an output folder run: what the command line says, and what the folder's record keeps of it."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import Parameter
from cyclopts.validators import Number

from scene.errors import SceneError
from scene.method_names import METHODS, UNCALIBRATED

if TYPE_CHECKING:
    from scene.record import Record
    from solve.external import External
    from twin.description.description import Sampling

DEFAULT_METHODS = "ls,iterative"
DEFAULT_PROFILE = "default"
TIMEOUT_S = 3600.0
NOTE = "settings"
"""Of a record."""
Engine = Literal["auto", "many", "mitsuba"]
GreenAxis = Literal["opengl", "directx"]
Staging = Literal["one-factor", "benchmark"]
"""Of the sweeps, see `experiments.stagings`."""
Out = Annotated[Path | None, Parameter(alias="-o", help="Output folder. Default: out/NAME, by the session's name.")]
Json = Annotated[bool, Parameter(help="Print the results as JSON.", negative="")]
Jobs = Annotated[int, Parameter(help="How many sessions run at a time.", validator=Number(gte=1))]
Scheduler = Annotated[str | None, Parameter(help="Address of a Dask scheduler. Default: this machine's cores.")]
Processes = Annotated[int | None, Parameter(help="How many run at a time. Default: one per core.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Place:
    """Where a verb writes its results, and how it prints them."""

    out: Out = None
    json: Json = False


BY_NAME = Place()


def named(option: str, text: str, known: Iterable[str]) -> tuple[str, ...]:
    """Return the names that a text with commas gives, in any case, each once, as they are known.

    Raises SceneError: one is not known, or there is none; `option` is what the message begins with.
    """
    spelt = {name.casefold(): name for name in known}
    words = [word.strip() for word in text.split(",") if word.strip()]
    unknown = [word for word in words if word.casefold() not in spelt]
    if unknown or not words:
        raise SceneError(
            f"{option} {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(spelt.values())}."
        )
    return tuple(dict.fromkeys(spelt[word.casefold()] for word in words))


def degrees_of(_: Any, tokens: Sequence[Any]) -> float:
    """Return an angle of the command line, as 3, 3deg or 3°, of `none` 0; SceneError for what no error can be."""
    text = tokens[0].value
    if text.strip().casefold() == "none":
        return 0.0
    with suppress(ValueError):
        if 0 < (value := float(text.strip().removesuffix("deg").removesuffix("°"))) < 90:
            return value
    raise SceneError(f"--tolerance {text}: expected degrees above 0 and below 90, such as 3deg, or none.")


@Parameter(name="*")
@dataclass(frozen=True)
class Solving:
    """Which methods solve, and how; its help, or what stands below it, says what a field is.

    None: as the output folder was made before; of a new one the default.
    """

    method: Annotated[
        str | None,
        Parameter(
            alias="-m",
            help=f"Photometric-stereo methods, with commas: {', '.join(METHODS)}. Default: {DEFAULT_METHODS}. "
            f"Default without lights: {','.join(UNCALIBRATED)}. Default of two folders compared: all.",
        ),
    ] = None
    profile: str | None = None
    """Settings of the methods: default; or seed, which follows the benchmark to the letter."""
    external: Annotated[
        tuple[str, ...] | None,
        Parameter(
            help="Another program as a method; may be given several times. A published one that you downloaded is "
            "NAME=PRESET:FOLDER, PRESET one of lino-unips, sdm-unips, geo-unips, uni-ms-ps. Any other is NAME=COMMAND "
            "with {data} to read and {out} to write a normal map into. See docs/guide/methods.md.",
            negative="--no-external",
            consume_multiple=False,
        ),
    ] = None
    external_timeout_s: Annotated[
        float | None, Parameter(help=f"Seconds after which such a program is stopped. Default: {TIMEOUT_S:g}.")
    ] = None
    trust: Annotated[
        bool | None,
        Parameter(
            help="Judge the methods by how well they explain the photographs; all where none is named. Default: yes "
            "for process without a scan and without given normals."
        ),
    ] = None

    def methods(self) -> tuple[str, ...]:
        """Return the names of the methods of ours.

        Raises SceneError: there is no such method, or it has no such profile.
        """
        from solve.methods import method_of

        usual = ",".join(METHODS) if self.trust else DEFAULT_METHODS
        names = named("--method", usual if self.method is None else self.method, METHODS)
        for name in names:
            method_of(name).settings(self.profile or DEFAULT_PROFILE)
        return names

    def programs(self) -> "dict[str, External]":
        """Return the other programs by name.

        Raises SceneError: a text is no NAME=COMMAND, a preset's program is not there, or a name is given twice.
        """
        from solve.external import External

        found: dict[str, External] = {}
        timeout_s = TIMEOUT_S if self.external_timeout_s is None else self.external_timeout_s
        for text in self.external or ():
            program = External.parse(text, timeout_s)
            if program.name in found:
                raise SceneError(f"--external {program.name}: given twice. Give each program its own name.")
            found[program.name] = program
        return found


@Parameter(name="*")
@dataclass(frozen=True)
class TwinSettings:
    """How a twin is rendered.

    None: as the output folder was made before. Of a new one, engine and error: as the scene description says; of a
    session's twin `auto`, and 0.01 or half of what its material leaves unexplained where that is more.
    """

    engine: Engine | None = None
    """The twin's engine. auto is many where it can render the scene."""
    error: float | None = None
    """Relative error that the twin's rendering aims at; 0.01 is 1 %."""
    layers: bool | None = None
    """Also keep the twin's direct and indirect light, as truth_*.npy."""
    photograph: bool | None = None
    """Give a session's twin the noise and the mosaic of the photographs."""
    held_out: bool | None = None
    """Also fit the twin's material to every second frame, and predict the others. Default: yes."""

    def __post_init__(self) -> None:
        if self.engine is not None:
            named("--engine", self.engine, get_args(Engine))
        if self.error is not None and not 0 < self.error < 1:
            raise SceneError(f"--error {self.error:g}: expected between 0 and 1; 0.01 is 1 %.")

    def sampling(self, given: "Sampling") -> "Sampling":
        """Return a scene's sampling with what the command line says of it."""
        known = {"engine": self.engine, "error": self.error}
        return replace(given, **{name: value for name, value in known.items() if value is not None})


@Parameter(name="*")
@dataclass(frozen=True)
class Settings(TwinSettings, Solving):
    """All of them. An output folder's record keeps them: what a later run does not say stays as it was.

    `truth`: folder of a known truth (truth.json, truth.npz) to judge the results by.
    """

    normals: GreenAxis | None = None
    """Pictures of normals in results/: opengl has green up, directx green down. Default: opengl."""
    tolerance_deg: Annotated[
        float | None,
        Parameter(
            name="--tolerance",
            help="Error of the normals that your purpose allows, such as 3deg. The verdict is then pass or fail, until "
            "you say none. Default: tolerance_deg of session.toml.",
            converter=degrees_of,
        ),
    ] = None
    truth: Annotated[Path | None, Parameter(parse=False)] = None

    @classmethod
    def of(cls, record: "Record | None") -> "Settings":
        """Return those by which a folder was made, if it was; what an earlier version had beside them is left."""
        known = {field.name for field in fields(cls)}
        notes = {} if record is None else record.notes.get(NOTE, {})
        kept = {name: value for name, value in notes.items() if name in known}
        external, truth = kept.get("external"), kept.get("truth")
        lists = {"external": None if external is None else tuple(external), "truth": truth and Path(truth)}
        return cls(**{**kept, **lists})

    def but(self, *others: Solving | TwinSettings | None) -> "Settings":
        """Return these with what others say."""
        said = {field.name: getattr(other, field.name) for other in others if other for field in fields(other)
                if getattr(other, field.name) is not None}  # fmt: skip
        return replace(self, **said)


BY_DEFAULT, AS_BEFORE = Solving(), Settings()
