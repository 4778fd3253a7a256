"""What a scene's files name, put beside them: each file or array once."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any


class KeptFiles:
    """Copies files into folders below one, and writes what is in memory there."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._made: dict[int, tuple[Any, str]] = {}

    def made(self, below: str, suffix: str, content: Any, write: Callable[[Path, Any], Any]) -> str:
        """Return the name of a file of what is in memory: the same content, the same file."""
        if id(content) not in self._made:
            # With the content: no other gets its identity while it is here.
            self._made[id(content)] = content, f"{below}/{len(self._made):02d}{suffix}"
            write(self._folder / self._made[id(content)][1], content)
        return self._made[id(content)][1]

    def copy(self, below: str, path: Path) -> str:
        """Return the name of a file's copy."""
        name = f"{below}/{path.name}"
        (self._folder / below).mkdir(parents=True, exist_ok=True)
        if os.path.realpath(path) != os.path.realpath(self._folder / name):
            shutil.copyfile(path, self._folder / name)
        return name
