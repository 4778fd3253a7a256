"""A dataset rendered in a process of its own: it can be stopped, and what breaks it spares the studio.

    python -m studio.editor.rendering SCENE.toml OUT

is `rgbn twin SCENE.toml --out OUT`, with its progress as JSON lines on standard output.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from scene.rooms import ROOT


@dataclass(frozen=True)
class Progress:
    """How far a rendering is.

    Parameters
    ----------
    label : str
        What is at work: `twin`, `write`; or a line that the renderer says.
    done, total : int
        Pieces; 0 of 0 where only something is said.
    """

    label: str
    done: int = 0
    total: int = 0


class Rendering:
    """A rendering that runs.

    Parameters
    ----------
    description : Path
    out : Path
    tell : callable
        Called with each `Progress`, from a thread of this.
    ended : callable
        Called at the end with an empty text, or with what was at fault; not after `stop`.
    """

    def __init__(
        self, description: Path, out: Path, tell: Callable[[Progress], None], ended: Callable[[str], None]
    ) -> None:
        command = [sys.executable, "-m", "studio.editor.rendering", str(description), str(out)]
        self._process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._tell, self._ended, self._stopped = tell, ended, False
        self._said: list[str] = []
        # The one that tells the end waits for the other, which must have begun by then.
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._hear, self._listen)]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the process; what it has rendered is kept, and the same rendering goes on from there."""
        self._stopped = True
        self._process.terminate()
        self.wait()

    def wait(self) -> None:
        """Return when the process has ended and everything was told."""
        self._process.wait()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()

    def _hear(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            for line in lines:
                self._said.append(line.rstrip())
                self._tell(Progress(line.strip()))

    def _listen(self) -> None:
        assert self._process.stdout is not None
        try:
            with self._process.stdout as lines:
                for line in lines:
                    self._tell(_progress(line))
        finally:
            code = self._process.wait()
            self._threads[0].join()
            if not self._stopped:
                self._ended("" if code == 0 else "\n".join(self._said[-12:]) or f"the renderer ended with code {code}.")


def _progress(line: str) -> Progress:
    """Return what a line says; one that is no progress, which some library printed, is shown as it is."""
    try:
        return Progress(**json.loads(line))
    except (ValueError, TypeError):
        return Progress(line.strip())


@contextmanager
def _as_lines(label: str) -> Iterator[Callable[[int, int], None]]:
    def report(done: int, total: int) -> None:
        print(json.dumps({"label": label, "done": done, "total": total}), file=sys.__stdout__, flush=True)

    yield report


def main() -> int:
    """Render; return the exit code."""
    from experiments.scene_twin import render_description
    from lab.options import AS_GIVEN
    from scene.errors import SceneError

    description, out = map(Path, sys.argv[1:])
    try:
        # Whatever else prints must not come between the lines of progress.
        with redirect_stdout(sys.stderr):
            render_description(description, out, AS_GIVEN, bar=_as_lines)
    except SceneError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
