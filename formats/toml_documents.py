"""Documents, session.toml or a scene's: their tables, what is wrong in one in a line, and TOML as text."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from scene.errors import SceneError
from scene.files import plain
from scene.reading import shortened

Location = Sequence[str | int]
COLUMN = 44
"""Where comments begin."""
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
    path = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).lstrip(".")
    kind, cause = fault["type"], fault.get("ctx", {}).get("error")
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


def toml_text(data: Mapping[str, Any], comments: Mapping[str, str] | None = None) -> str:
    """Return tables as TOML, which `tomllib` reads back the same.

    Arrays and dataclasses are written as `scene.files.plain` has them; what is None is left out.

    comments: By key path, as in frames.flash and spheres[0].
    """
    return "\n".join([*_lines(plain(data), comments or {}), ""])


def _lines(table: Mapping[str, Any], comments: Mapping[str, str], above: str = "", path: str = "") -> Iterator[str]:
    """Yield a table's plain keys, then its tables and lists of tables, of names that begin with `above`."""
    for key, value in table.items():
        if value is not None and not _is_table(value):
            line, comment = f"{_key(key)} = {toml_value(value)}", comments.get(f"{path}{key}")
            yield f"{line:{COLUMN}}# {comment}" if comment and "\n" not in line else line
    for key, value in table.items():
        if _is_table(value):
            name, is_list = f"{above}{_key(key)}", isinstance(value, list)
            for number, one in enumerate(value if is_list else [value]):
                here = f"{path}{key}[{number}]" if is_list else f"{path}{key}"
                head = f"[[{name}]]" if is_list else f"[{name}]"
                yield from ["", f"{head}  # {comments[here]}" if comments.get(here) else head]
                yield from _lines(one, comments, f"{name}.", f"{here}.")


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else toml_value(key)


def toml_value(value: Any) -> str:
    """Return a text, a number, a truth value or a list of them as TOML."""
    # Files' names: one a line.
    is_long = isinstance(value, list) and len(value) > 4 and isinstance(value[0], str)
    # JSON writes these as TOML does, but for one letter; in ASCII it would write surrogates, which TOML has not.
    return json.dumps(value, ensure_ascii=False, indent=2 if is_long else None).replace("\x7f", "\\u007f")
