"""What a studio's processes do, with lines on the standard error.

`python -m studio.studio_run STEP SESSION OUT`: the steps up to one, as the output folder was made before; `render` for
the step: `rgbn twin SCENE.toml --out OUT`, a line for each piece.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lab import progress
from lab.progress import say

RENDER = "render"
EVERY_S = 1.0
"""A page is told of the work under way more often than a log."""


@contextmanager
def _lines(label: str) -> Iterator[Callable[[int, int], None]]:
    yield lambda done, total: say(f"{label}: {done} of {total}")


def main() -> int:
    """Run; return the exit code."""
    from experiments.scene_twin import render_description
    from lab.options import AS_GIVEN
    from lab.run import run_session
    from scene.errors import SceneError

    progress.EVERY_S = EVERY_S
    step, (source, out) = sys.argv[1], map(Path, sys.argv[2:])
    try:
        if step == RENDER:
            render_description(source, out, AS_GIVEN, bar=_lines)
        else:
            run_session(source, step, out=out)
    except SceneError as error:
        say(f"rgbn: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
