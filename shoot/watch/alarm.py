"""Warnings for who stands at the tripod: the terminal's bell, and a command of the user's."""

import queue
import shlex
import subprocess
import sys
import threading

from lab.progress import say
from scene.errors import SceneError

LONGEST_S = 60.0
"""That a command may take for one warning."""


class Alarm:
    """Rings and runs a command for each warning, one after the other, while the watch goes on.

    Parameters
    ----------
    command : str, optional
        Words as a shell reads them; no shell runs it. The warning is put behind them as one more word.
    bell : bool
        Ring the terminal's bell.

    Raises
    ------
    SceneError
        The command cannot be read.
    """

    def __init__(self, command: str | None = None, *, bell: bool = True) -> None:
        # The terminal itself: a screen that is drawn anew takes the place of standard error.
        self._terminal = sys.stderr if bell and sys.stderr.isatty() else None
        self._words: list[str] = []
        if command is not None:
            try:
                self._words = shlex.split(command)
            except ValueError as error:
                raise SceneError(f"--on-warning {command}: cannot be read ({error}). Close its quotation.") from None
            if not self._words:
                raise SceneError("--on-warning: is empty. Give a command, as in --on-warning 'say'.")
        self._waiting: queue.Queue[str | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        if self._words:
            self._thread.start()

    def __enter__(self) -> "Alarm":
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join(LONGEST_S)

    def warn(self, text: str) -> None:
        """Ring, and hand the warning to the command."""
        if self._terminal is not None:
            print("\a", end="", file=self._terminal, flush=True)
        # A word that begins with a dash would be an option.
        self._waiting.put(f"rgbn: {text}")

    def _run(self) -> None:
        while (text := self._waiting.get()) is not None:
            try:
                done = subprocess.run(
                    [*self._words, text], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE, timeout=LONGEST_S, check=False,
                )  # fmt: skip
                fault = done.stderr.decode(errors="replace").strip() if done.returncode else ""
                fault = fault or (f"ended with {done.returncode}" if done.returncode else "")
            except (OSError, ValueError, subprocess.TimeoutExpired) as error:
                fault = str(error)
            if fault:
                say(f"warning: --on-warning {shlex.join(self._words)}: {fault}", always=True)
