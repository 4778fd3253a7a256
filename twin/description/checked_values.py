"""Kinds of values in a description's tables: a dataclass whose fields are of them is read from a table, and checked.

Values are taken as they are written: no text becomes a number. What is built in Python is not checked here.
"""

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    Strict,
    ValidationInfo,
    with_config,
)

from scene.errors import SceneError

checked = with_config(ConfigDict(extra="forbid", allow_inf_nan=False))
"""For dataclasses: unknown keys are faults."""


class Table(BaseModel):
    """A TOML table that is no dataclass of the scene's: unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def three(value: Any) -> Any:
    """Take one number for all three channels, or axes."""
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def as_fault(value: Any, read: Callable[[Any], Any]) -> Any:
    """Turn what a reader says of its input into one of pydantic's faults, which are told together."""
    try:
        return read(value)
    except SceneError as error:
        raise ValueError(str(error)) from error


def named(kind: str) -> PlainValidator:
    """Put what a file holds in the place of its name: what the method `kind` of pydantic's context makes of it."""

    def read(value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, str):
            raise ValueError("expected a file's name")
        return as_fault(value, getattr(info.context, kind))

    return PlainValidator(read)


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
