"""TOML as text: what `tomllib` reads back the same."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from scene.files import plain

COLUMN = 44
"""Where comments begin."""


def toml_text(data: Mapping[str, Any], comments: Mapping[str, str] | None = None) -> str:
    """Return tables as TOML: arrays and dataclasses as `scene.files.plain` has them, without what is None.

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
    if isinstance(value, list):
        parts = [toml_value(part) for part in value]
        if len(value) > 4 and isinstance(value[0], str):
            # Files' names: one a line.
            return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"
        return f"[{', '.join(parts)}]"
    if isinstance(value, str):
        # JSON escapes what TOML does, but for this one; in ASCII it would write surrogates, which TOML has not.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)
