"""What stands in the browser's view: each part is sent again only when what it shows has changed."""

from collections.abc import Callable
from typing import Any


class Shown:
    """Parts of a view by name, each with its handles."""

    def __init__(self) -> None:
        self._keys: dict[str, Any] = {}
        self._handles: dict[str, list[Any]] = {}

    def once(self, name: str, key: Any, add: Callable[[], list[Any]]) -> None:
        """Put a part in place of what it was, unless it has this key already.

        key: Compared by equality. add: Adds the part; returns the handles of all that it added.
        """
        if name in self._keys and self._keys[name] == key:
            return
        for handle in self._handles.pop(name, []):
            handle.remove()
        # Kept first: what fails once would fail again at each refresh.
        self._keys[name] = key
        self._handles[name] = add()
