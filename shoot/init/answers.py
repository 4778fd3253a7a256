"""What no file tells: given on the command line, said before, asked on a terminal, or assumed and said."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scene.errors import SceneError, SessionError
from scene.length_units import Unit

if TYPE_CHECKING:
    from capture.session.manifest import Manifest

LENS = {
    "focal_mm": "Focal length engraved on the lens, mm",
    "sensor_mm": "Width of the sensor, mm: 36 for full frame, 23.5 or 22.3 for APS-C",
}
"""What is asked of the lens, by the keys of [camera]."""


def lengths_of(text: str) -> tuple[float, ...]:
    """Return lengths in mm, with commas or blanks between; ValueError for another text."""
    parts = text.replace(",", " ").replace("mm", " ").split() or [text]
    try:
        return tuple(map(float, parts))
    except ValueError:
        raise ValueError(f"{text}: expected millimetres, as in 76") from None


def _given_lengths(_: Any, tokens: Iterable[Any]) -> tuple[float, ...]:
    return lengths_of(" ".join(token.value for token in tokens))


Diameters = Annotated[tuple[float, ...], Parameter(converter=_given_lengths, n_tokens=-1, consume_multiple=True)]
"""One or several."""


@Parameter(name="*")
@dataclass(frozen=True)
class Answers:
    """What no photograph tells of a capture; None and empty: nothing is said. The help is what stands below each.

    Raises SceneError: a value that session.toml may not have.
    """

    chrome: Diameters = ()
    """Diameter of the chrome balls, mm. One for all, or one for each, largest in the picture first."""
    white: Diameters = ()
    """Diameter of the white balls, mm."""
    unit: Unit | None = None
    """Unit of the scan. Default: found from the object's size in the picture."""
    focal_mm: float | None = None
    """Focal length engraved on the lens, mm. Default: EXIF's."""
    sensor_mm: float | None = None
    """Width of the sensor, mm; 36 for full frame."""
    linear: bool | None = None
    """Values of 8-bit files are proportional to light. Default: they are sRGB."""

    def __post_init__(self) -> None:
        said = [(key, "camera", {key: float(value)}) for key, value in self.camera.items()]
        balls = [(kind, mm) for kind in ("chrome", "white") for mm in getattr(self, kind)]
        for key, table, data in said + [(kind, "spheres", {"kind": kind, "diameter_mm": mm}) for kind, mm in balls]:
            from capture.session.manifest_file import table_of

            try:
                table_of(table, data)
            except SessionError as error:
                told = str(error).partition(": ")[2]
                raise SceneError(f"--{key.replace('_', '-')}: {told}") from error

    @property
    def camera(self) -> dict[str, Any]:
        """What is said of the lens, by its keys in session.toml."""
        return {key: value for key in LENS if (value := getattr(self, key)) is not None}

    @classmethod
    def said_in(cls, manifest: "Manifest") -> "Answers":
        """Return what an earlier session.toml says already."""
        balls: dict[str, Any] = {}
        for kind in ("chrome", "white"):
            known = [ball.diameter_mm for ball in manifest.spheres if ball.kind == kind]
            balls |= {kind: tuple(known if len(set(known)) > 1 else known[:1])} if None not in known else {}
        camera, unit = manifest.camera, manifest.object.scan_unit if manifest.object.scan else "unknown"
        lens = camera.model_dump(include=set(LENS), exclude_none=True) if camera else {}
        return cls(**balls, **lens, unit=None if unit == "unknown" else unit, linear=manifest.frames.linear)


NOTHING = Answers()


@dataclass
class Asking:
    """Asks on the terminal, each question once for all objects of a folder, unless told not to.

    Parameters
    ----------
    answers : Answers
        Given, and what was answered so far.
    silent : bool
        Nothing is asked: what is not known is assumed.
    earlier : Answers
        What the session.toml that is written anew says: it holds where nothing else is said.
    """

    answers: Answers
    silent: bool = False
    earlier: Answers = field(default_factory=Answers)
    _asked: set[str] = field(default_factory=set)

    def diameters(self, kind: str, places: Sequence[Sequence[float]], balls: int) -> tuple[float | None, ...]:
        """Return the diameters of balls that stand at `places`, mm; None where they are not known."""
        what = f"Diameter in mm of the {balls} {kind} balls" if balls > 1 else f"Diameter in mm of the {kind} ball"
        what += f" at {', '.join(f'({u:.0f}, {v:.0f})' for u, v in places)} px" if places else ""
        more = "; where they differ, one for each, in this order" if balls > 1 else ""
        if len(getattr(self.earlier, kind)) not in (1, balls):
            # Said of other balls.
            self.earlier = replace(self.earlier, **{kind: ()})
        given = self._once(kind, f"{what}{more}") or (None,)
        if len(given) not in (1, balls):
            raise SessionError(
                f"--{kind} {' '.join(f'{one:g}' for one in given)}: {len(given)} diameters, but {balls} {kind} balls "
                "were found. Give one for all, or one for each."
            )
        return given * balls if len(given) == 1 else given

    def said(self, what: str) -> Any:
        """Return what is said of a field of `Answers`, now or earlier; None where nothing is."""
        known = (getattr(answers, what) for answers in (self.answers, self.earlier))
        return next((value for value in known if value not in (None, ())), None)

    def camera(self, *, is_known: bool) -> dict[str, float]:
        """Return what is said of the lens, by its keys in session.toml; asked for where nothing else tells it."""
        said = self.answers.camera or self.earlier.camera
        if is_known or said:
            return said
        for key, question in LENS.items():
            if self._once(key, question) is None:
                # Without the sensor's width a focal length tells nothing: of the next object neither.
                self.answers = replace(self.answers, **dict.fromkeys(LENS))
                return {}
        return self.answers.camera

    def _once(self, what: str, question: str) -> Any:
        """Return what was given, said earlier, or asked for once; None where nobody answers."""
        if self.said(what) is None and not self.silent and what not in self._asked:
            self._asked.add(what)
            self._ask(what, question)
        return self.said(what)

    def _ask(self, what: str, question: str) -> None:
        """Ask for a field of `Answers`, until its answer may stand in session.toml, or there is none."""
        while True:
            print(f"{question} (Enter: not known): ", end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            self.silent |= not line
            if not line.strip():
                return
            try:
                found = lengths_of(line.strip())
                self.answers = replace(self.answers, **{what: found[0] if what in LENS else found})
                return
            except (ValueError, SceneError) as error:
                print(f"  {error}", file=sys.stderr)
