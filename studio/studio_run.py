"""What a studio's processes do, with lines on the standard error.

`python -m studio.studio_run STEP SESSION OUT`: the steps up to one, as the output folder was made before; `render` for
the step: `rgbn twin SCENE.toml --out OUT`, a line for each piece.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lab.progress import say

RENDER = "render"


def settings_of(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `lab.run.run_session` with which a folder was made, so that what is current stays.

    summary: Of summary.json; empty: the command line's own defaults.
    """
    from lab.options import AS_GIVEN, BY_DEFAULT, Solving, TwinSettings

    said = summary.get("arguments") or {}
    programs, twin, truth = said.get("external") or {}, said.get("twin"), said.get("truth")
    own = ",".join(name for name in said.get("methods") or () if name not in programs)
    commands = tuple(f"{name}={command}" for name, command in programs.items())
    solving = Solving(own, said.get("profile") or BY_DEFAULT.profile, commands) if own or commands else BY_DEFAULT
    return {
        "solving": solving,
        "twin": TwinSettings(**twin) if twin else AS_GIVEN,
        "truth": None if truth is None else Path(truth),
        "refine_lights": bool(said.get("refine_lights")),
    }


@contextmanager
def _lines(label: str) -> Iterator[Callable[[int, int], None]]:
    yield lambda done, total: say(f"{label}: {done} of {total}")


def main() -> int:
    """Run; return the exit code."""
    from compare.report.facts import read_optional
    from experiments.scene_twin import render_description
    from lab.options import AS_GIVEN
    from lab.run import run_session
    from scene.errors import SceneError
    from scene.store import Store

    step, (source, out) = sys.argv[1], map(Path, sys.argv[2:])
    try:
        if step == RENDER:
            render_description(source, out, AS_GIVEN, bar=_lines)
        else:
            summary = read_optional(Store(out), "summary.json")
            run_session(source, step, out=out, **settings_of(summary if isinstance(summary, dict) else {}))
    except SceneError as error:
        say(f"rgbn: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
