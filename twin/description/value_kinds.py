"""Kinds of values in a scene description: each key is declared once, with type, range, unit, default and what it is.

Reader, faults, writer, the studio's inputs and the reference page are made from these declarations. Values are taken as
they are written: no text becomes a number. What is built in Python is not checked.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    Strict,
    ValidationInfo,
    with_config,
)

from scene.errors import SceneError

checked = with_config(ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True))
"""For dataclasses: unknown keys are faults."""


@dataclass(frozen=True)
class Around:
    """What a table is read in.

    folder: That names of files start from.
    materials: That an object may be of; None: not looked at.
    """

    folder: Path = Path()
    materials: tuple[str, ...] | None = None


def key(what: str, unit: str = "", **look: Any) -> Any:
    """Return a key's description for people: what it is, its unit; `look`: how the studio shows it."""
    return Field(description=what, json_schema_extra={"unit": unit, **look})


def three(value: Any) -> Any:
    """Take one number for all three channels, or axes."""
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def as_fault(value: Any, read: Callable[[Any], Any]) -> Any:
    """Turn what a reader says of its input into one of pydantic's faults, which are told together."""
    try:
        return read(value)
    except SceneError as error:
        raise ValueError(str(error)) from error


def file_of(kind: type, read: Callable[[Path], Any]) -> PlainValidator:
    """Put what a file holds in the place of its name; what is of the kind already stays."""

    def found(value: Any, info: ValidationInfo) -> Any:
        # TOML has no None: the studio says that there is none.
        if value is None or isinstance(value, kind):
            return value
        if not isinstance(value, str):
            raise ValueError("expected a file's name")
        return as_fault((info.context or Around()).folder / value, read)

    return PlainValidator(found)


MOST = 1e6
"""Of a scene's lengths in mm, angles, factors and radiances: with squares of it, single precision still counts."""
LEAST = 1e-6
"""Of what must be positive."""
Level = Annotated[int, Strict(), Field(ge=0, le=65535)]
Number = Annotated[float, Strict(), Field(ge=-MOST, le=MOST)]
Positive = Annotated[float, Strict(), Field(ge=LEAST, le=MOST)]
NotNegative = Annotated[float, Strict(), Field(ge=0, le=MOST)]
Share = Annotated[float, Strict(), Field(ge=0, le=1)]
AboveNone = Annotated[float, Strict(), Field(ge=LEAST, le=1)]
Count = Annotated[int, Strict(), Field(ge=1, le=1 << 20)]
Three = tuple[Number, Number, Number]
Factors = Annotated[Three, BeforeValidator(three)]
Rgb = Annotated[tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(three)]
Shares = Annotated[tuple[Share, Share, Share], BeforeValidator(three)]
