"""What the studio's windows may say: which of viser's messages, and which values their inputs may have."""

from typing import Any

import msgspec

MOST_TEXT, MOST_ITEMS, MOST_NUMBER = 10_000, 100, 1e9
"""Of one value: characters, parts, and how large a number may be."""
HEARD = (
    "ViewerCameraMessage",
    "GuiUpdateMessage",
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "TransformControlsDragStartMessage",
    "TransformControlsUpdateMessage",
    "TransformControlsDragEndMessage",
    "FileTransferStartUpload",
    "FileTransferPart",
)
"""What the studio's windows say. Other messages of viser's are not waited for, and some are kept for ever."""


class Unfit(Exception):
    """A message that does not fit."""


class Kind(msgspec.Struct):
    """Of a message its kind alone."""

    type: str


def fits(value: Any) -> bool:
    """Whether numbers are finite and of a size that things have, and texts and lists short."""
    if isinstance(value, str):
        return len(value) <= MOST_TEXT
    if isinstance(value, dict | list | tuple):
        inside = value.values() if isinstance(value, dict) else value
        return len(value) <= MOST_ITEMS and all(map(fits, inside))
    return value is None or (isinstance(value, bool | int | float) and abs(value) <= MOST_NUMBER)


def check_value(handle: Any, value: Any) -> None:
    """Raise where an input cannot have a value; one that is not there any more has none to check."""
    if handle is None:
        return
    label = getattr(handle, "label", "")
    if not handle.visible or getattr(handle, "disabled", False):
        raise Unfit(f"the input {label!r} is not to be changed now")
    options = getattr(handle, "options", None)
    if value not in options if options is not None else not _is_like(handle.value, value):
        raise Unfit(f"{str(value)[:40]!r} is no value of the input {label!r}")


def _is_like(now: Any, value: Any) -> bool:
    """Whether a value is of the kind that an input has now."""
    if isinstance(now, tuple):
        return isinstance(value, list) and len(value) == len(now) and all(map(_is_like, now, value))
    if isinstance(now, bool | str):
        return type(value) is type(now)
    return isinstance(now, int | float) and isinstance(value, int | float) and not isinstance(value, bool)
