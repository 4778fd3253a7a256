"""A file of JSON lines that grows line by line: a killed run or a full disk leaves whole lines."""

import errno
import json
import os
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from scene.errors import SceneError

Line = dict[str, Any]


class Journal:
    """Lines on disk.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    count : int
        Lines that were read or written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.count, self._new = path, 0, path.with_suffix(".new")
        self._guard = threading.Lock()

    def append(self, line: Line) -> None:
        """Add a line, whole or not at all.

        Raises
        ------
        SceneError
            The disk is full, or the file cannot be written.
        """
        data = json.dumps(line, allow_nan=False).encode() + b"\n"
        with self._guard, self._writing(), self._own() as file:
            end = file.tell()
            try:
                if file.write(data) < len(data):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            except OSError:
                # No torn line before the next one.
                file.truncate(end)
                raise
            self.count += 1

    def _own(self) -> BinaryIO:
        """Open the file at its end; a copy takes the place of one that has other names too (`cp -l`)."""
        if self.path.exists() and self.path.stat().st_nlink > 1:
            shutil.copyfile(self.path, self._new)
            os.replace(self._new, self.path)
        return open(self.path, "ab", buffering=0)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise SceneError(
                f"{self.path}: cannot be written ({error.strerror}). Free some space or choose another folder with "
                "--out; what is done is kept."
            ) from error

    def read(self, use: Callable[[Line], None]) -> bool:
        """Give each line to a function; return whether the last one is torn.

        Raises
        ------
        SceneError
            It cannot be read, or a line is damaged: no JSON, or the function raised ValueError, KeyError, TypeError or
            AttributeError.
        """
        try:
            lines = self.path.read_bytes().split(b"\n")
        except OSError as error:
            raise SceneError(
                f"{self.path}: cannot be read ({error.strerror}). Choose another folder with --out."
            ) from error
        # A line without its end was being written when a run was killed.
        torn = bool(lines.pop())
        try:
            for line in lines:
                use(json.loads(line))
                self.count += 1
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise SceneError(
                f"{self.path}: line {self.count + 1} cannot be read ({error}). Without it rgbn cannot tell which files "
                "here are its own. Choose another folder with --out, or move this one away."
            ) from error
        return torn

    def rewrite(self, lines: Iterable[Line]) -> None:
        """Replace all lines at once."""
        data = [json.dumps(line, allow_nan=False) + "\n" for line in lines]
        with self._writing():
            self._new.write_text("".join(data))
            os.replace(self._new, self.path)
        self.count = len(data)
