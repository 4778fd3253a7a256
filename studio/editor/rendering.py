"""A dataset rendered in a process of its own.

    python -m studio.editor.rendering SCENE.toml OUT

is `rgbn twin SCENE.toml --out OUT`, with its progress as JSON lines on standard output.
"""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio.background_process import BackgroundProcess


@dataclass(frozen=True)
class Progress:
    """How far a rendering is.

    label: What is at work: `twin`, `write`; or a line that the renderer says.
    done, total: Pieces; 0 of 0 where only something is said.
    """

    label: str
    done: int = 0
    total: int = 0


def start_rendering(
    description: Path, out: Path, tell: Callable[[Progress], Any], ended: Callable[[str], Any]
) -> BackgroundProcess:
    """Render a description; `tell` is called with each `Progress`, `ended` as in `BackgroundProcess`."""
    return BackgroundProcess(
        ["-m", "studio.editor.rendering", str(description), str(out)],
        lambda line: tell(Progress(line)),
        ended,
        lambda line: tell(_progress(line)),
    )


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
