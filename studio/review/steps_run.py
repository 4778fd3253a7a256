"""The session's steps run from the studio: the command line in a process of its own."""

import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from scene.rooms import ROOT


def options_of(summary: dict[str, Any]) -> list[str]:
    """Return the options of `rgbn process` with which a folder was made, so that what is current stays.

    summary: Of summary.json; empty: the command line's own options. Raises SceneError: the results were judged by a
    known truth, which `rgbn process` is not given.
    """
    if summary.get("truth_check"):
        raise SceneError(
            "summary.json: the results here were judged by a known truth, which a run from here would drop. Run the "
            "command that made them again: `rgbn demo --out OUT` for the demo."
        )
    arguments = summary.get("arguments") or {}
    programs, twin = arguments.get("external") or {}, arguments.get("twin") or {}
    methods = [name for name in arguments.get("methods") or () if name not in programs]
    said = {"method": ",".join(methods), "profile": arguments.get("profile"), **twin}
    options = [f"--{name}" if value is True else f"--{name}={value}" for name, value in said.items() if value]
    return options + [f"--external={name}={command}" for name, command in programs.items()]


class StepsRun:
    """`rgbn process SESSION --out OUT` that runs.

    tell: Called with each line that it says, from a thread of this.
    ended: Called at the end with an empty text, or with what stopped it; not after `stop`.
    options: More of the command line.
    """

    def __init__(
        self,
        session: Path,
        out: Path,
        tell: Callable[[str], None],
        ended: Callable[[str], None],
        options: Sequence[str] = (),
    ) -> None:
        command = [sys.executable, "-c", "from rgbn.cli import main; main()", "process"]
        self._process = subprocess.Popen(
            [*command, str(session.resolve()), "--out", str(out.resolve()), *options],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._tell, self._ended, self._stopped = tell, ended, False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the process; what is done is kept, and the same steps go on from there."""
        self._stopped = True
        self._process.terminate()
        self._process.wait()

    def wait(self) -> None:
        """Return when the process has ended and everything was told."""
        self._process.wait()
        self._thread.join()

    def _listen(self) -> None:
        assert self._process.stderr is not None
        said: list[str] = []
        with self._process.stderr as lines:
            for line in lines:
                said.append(line.rstrip())
                self._tell(line.strip())
        code = self._process.wait()
        if not self._stopped:
            self._ended("" if code == 0 else _fault(said) or f"the run ended with code {code}.")


def _fault(said: list[str]) -> str:
    """Return the message that ended a run: from the line that the command line begins with its name."""
    starts = [number for number, line in enumerate(said) if line.startswith("rgbn: ")]
    return "\n".join(said[starts[-1] :] if starts else said[-12:]).removeprefix("rgbn: ")
