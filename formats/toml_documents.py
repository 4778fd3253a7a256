"""A table of a document, session.toml or a scene's; what is wrong in one, in a line: key path, found, expected."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from scene.errors import SceneError
from scene.reading import shortened

Location = Sequence[str | int]
EXPECTED = {
    "float_type": "expected a number, without quotation marks and unit",
    "int_type": "expected a whole number, without quotation marks and unit",
    "int_from_float": "expected a whole number",
    "bool_type": "expected true or false, without quotation marks",
    "string_type": "expected a text between quotation marks",
    "list_type": "expected a list between [ and ]",
    "tuple_type": "expected a list between [ and ]",
}
"""What pydantic's kinds of faults ask for, in the words of TOML."""


class TomlTable(BaseModel):
    """A TOML table: unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True)


def key_path(location: Location) -> str:
    """Return where a key stands, as in spheres[0].kind."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def fault_line(
    fault: Mapping[str, Any],
    hint: Callable[[Location], str],
    *,
    missing: Mapping[str, str] | None = None,
    expected: Mapping[str, str] | None = None,
) -> str:
    """Return one of pydantic's faults as "key.path: what was found; what is expected."

    hint: Says what an unknown key may mean.
    missing: By key path, what to do where it is absent. expected: By key path without numbers, what list or which words
    are expected there, instead of pydantic's words.
    """
    # Validators appear in the path, and no file holds them.
    parts = [part for part in fault["loc"] if isinstance(part, int) or not part.startswith("function-")]
    path, kind, cause = key_path(parts), fault["type"], fault.get("ctx", {}).get("error")
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{path}: unknown key. {hint(parts)}"
    if kind == "missing":
        return f"{path}: missing. {(missing or {}).get(path.split('[')[0], 'Add it.')}"
    if isinstance(getattr(cause, "__cause__", None), SceneError):
        return f"{path}: {cause}"
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be ", "expected ").rstrip(".")
    message = f"{message[0].lower()}{message[1:]}"
    if kind.startswith("union_tag"):
        message = message.replace("_kind()", "'kind'")
        return f"{path}.kind: {message}."
    found = fault["input"]
    shown = f"a table with {', '.join(found) or 'nothing'}" if isinstance(found, dict) else repr(found)
    place = re.sub(r"\[\d+\]", "", path)
    wanted = (expected or {}).get(place) if kind in ("list_type", "tuple_type", "literal_error") else None
    return f"{path}: found {shortened(shown, 80)}; {wanted or EXPECTED.get(kind, message)}."
