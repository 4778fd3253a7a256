"""Work of the command line in a process of its own: it can be stopped, and what breaks it spares the studio."""

import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any

from scene.rooms import ROOT


class BackgroundProcess:
    """Python at work with these arguments. All that is told comes from threads of this.

    said, printed: called with each line of the standard error and of the standard output.
    ended: called at the end with an empty text, or with what was at fault; not after `stop`.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        said: Callable[[str], Any],
        ended: Callable[[str], Any],
        printed: Callable[[str], Any] | None = None,
    ) -> None:
        self._process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL if printed is None else subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._said, self._ended, self._is_stopped = [], ended, False
        streams = ((self._process.stderr, lambda line: self._keep(line, said)), (self._process.stdout, printed))
        readers = [threading.Thread(target=_read, args=pair, daemon=True) for pair in streams if pair[0] is not None]
        self._end = threading.Thread(target=self._tell_the_end, args=(readers,), daemon=True)
        for thread in (*readers, self._end):
            thread.start()

    def stop(self) -> None:
        """End the process; what it has done is kept, and the same work goes on from there."""
        self._is_stopped = True
        self._process.terminate()
        self.wait()

    def wait(self) -> None:
        """Return when the process has ended and everything was told."""
        self._process.wait()
        self._end.join()

    def _keep(self, line: str, said: Callable[[str], Any]) -> None:
        self._said.append(line)
        said(line.strip())

    def _tell_the_end(self, readers: list[threading.Thread]) -> None:
        for reader in readers:
            reader.join()
        code = self._process.wait()
        if not self._is_stopped:
            self._ended("" if code == 0 else self._fault() or f"the process ended with code {code}.")

    def _fault(self) -> str:
        """Return the message that ended the process: from the line that the command line begins with its name."""
        starts = [number for number, line in enumerate(self._said) if line.startswith("rgbn: ")]
        return "\n".join(self._said[starts[-1] :] if starts else self._said[-12:]).removeprefix("rgbn: ")


def _read(stream: Any, use: Callable[[str], Any]) -> None:
    with stream as lines:
        for line in lines:
            use(line.rstrip())
