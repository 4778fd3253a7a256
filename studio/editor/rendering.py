"""`python -m studio.editor.rendering SCENE.toml OUT`: `rgbn twin SCENE.toml --out OUT`, with a line for each piece."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lab.progress import say


@contextmanager
def _lines(label: str) -> Iterator[Callable[[int, int], None]]:
    yield lambda done, total: say(f"{label}: {done} of {total}")


def main() -> int:
    """Render; return the exit code."""
    from experiments.scene_twin import render_description
    from lab.options import AS_GIVEN
    from scene.errors import SceneError

    description, out = map(Path, sys.argv[1:])
    try:
        render_description(description, out, AS_GIVEN, bar=_lines)
    except SceneError as error:
        say(f"rgbn: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
