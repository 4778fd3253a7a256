"""What no file tells: given on the command line, asked on a terminal, or assumed and said."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, get_args

from capture.session.session_types import Lens
from scene.errors import SessionError
from scene.length_units import Unit
from scene.spheres import Kind

T = TypeVar("T")


@dataclass(frozen=True)
class Answers:
    """What the user says of a capture; None and empty: nothing.

    Parameters
    ----------
    diameters_mm : dict of tuples of float
        Of the chrome and of the white balls: one for all, or one for each, largest in the picture first.
    unit : str or None
        The scan's.
    lens : Lens
    distance_mm : float or None
        From the camera to the balls.
    linear : bool or None
        Whether the values of 8-bit files are proportional to light.
    """

    diameters_mm: dict[Kind, tuple[float, ...]] = field(default_factory=dict)
    unit: Unit | None = None
    lens: Lens = field(default_factory=Lens)
    distance_mm: float | None = None
    linear: bool | None = None


@dataclass
class Asking:
    """Asks on the terminal, unless told not to.

    Parameters
    ----------
    answers : Answers
        Given, and what was answered so far: what is asked once holds for all objects of a folder.
    silent : bool
        Nothing is asked: what is not known is assumed.
    count : int
        Questions asked.
    """

    answers: Answers
    silent: bool = False
    count: int = 0

    def diameters(self, kind: Kind, places: Sequence[tuple[float, float]], balls: int) -> tuple[float, ...]:
        """Return the diameters of balls that stand at `places`, mm; empty where they are not known."""
        if kind not in self.answers.diameters_mm:
            what = f"Diameter in mm of the {balls} {kind} balls" if balls > 1 else f"Diameter in mm of the {kind} ball"
            what += f" at {', '.join(f'({u:.0f}, {v:.0f})' for u, v in places)} px" if places else ""
            more = "; where they differ, one for each, in this order" if balls > 1 else ""
            found = self._ask(f"{what}{more} (Enter: not known)", lengths_of, ())
            known = {**self.answers.diameters_mm, kind: found}
            self.answers = replace(self.answers, diameters_mm=known)
        given = self.answers.diameters_mm[kind]
        if len(given) not in (0, 1, balls):
            raise SessionError(
                f"--{kind} {' '.join(f'{one:g}' for one in given)}: {len(given)} diameters, but {balls} {kind} balls "
                "were found. Give one for all, or one for each."
            )
        return given * balls if len(given) == 1 else given

    def unit(self, scan: str, likely: Unit | None) -> Unit:
        """Return the scan's unit; `likely` tells it where the object's size in the picture does."""
        if self.answers.unit is None and likely is not None:
            return likely
        if self.answers.unit is None:
            found = self._ask(f"Unit of {scan}: m, cm, mm, inch or unknown (Enter: unknown)", _unit, "unknown")
            self.answers = replace(self.answers, unit=found)
        return self.answers.unit or "unknown"

    def is_linear(self, file: str) -> bool:
        """Return whether 8-bit values are proportional to light."""
        if self.answers.linear is None:
            what = f"{file} has 8 bits. Are its values proportional to light (not a camera's JPEG, not sRGB)? y or n"
            self.answers = replace(self.answers, linear=self._ask(f"{what} (Enter: n)", _yes, False))
        return bool(self.answers.linear)

    def _ask(self, question: str, read: Callable[[str], T], default: T) -> T:
        """Return an answer that can be read; the default where nobody answers."""
        if self.silent:
            return default
        self.count += 1
        while True:
            print(f"{question}: ", end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            if not line:
                self.silent = True
            if not line.strip():
                return default
            try:
                return read(line.strip())
            except ValueError as error:
                print(f"  {error}", file=sys.stderr)


def lengths_of(text: str) -> tuple[float, ...]:
    """Return lengths in mm, with commas or blanks between; ValueError for another text."""
    try:
        found = tuple(float(part) for part in text.replace(",", " ").replace("mm", " ").split())
    except ValueError:
        raise ValueError(f"{text}: expected millimetres, as in 76") from None
    if not found or not all(0.1 <= one <= 10_000 for one in found):
        raise ValueError(f"{text}: expected millimetres from 0.1 to 10000")
    return found


def _unit(text: str) -> Unit:
    names: dict[str, Unit] = {**{unit: unit for unit in get_args(Unit)}, "in": "inch", "inches": "inch"}
    if text.lower() not in names:
        raise ValueError(f"{text}: expected one of {', '.join(get_args(Unit))}")
    return names[text.lower()]


def _yes(text: str) -> bool:
    if text.lower() not in ("y", "yes", "n", "no"):
        raise ValueError(f"{text}: expected y or n")
    return text.lower().startswith("y")
