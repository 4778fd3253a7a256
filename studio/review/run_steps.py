"""`python -m studio.review.run_steps SESSION OUT STEP`: the steps up to one, as the output folder was made before."""

import sys
from pathlib import Path
from typing import Any

from lab.progress import say


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


def main() -> int:
    """Run; return the exit code."""
    from compare.report.facts import read_optional
    from lab.run import run_session
    from scene.errors import SceneError
    from scene.store import Store

    session, out, step = sys.argv[1:]
    summary = read_optional(Store(Path(out)), "summary.json")
    try:
        run_session(Path(session), step, out=Path(out), **settings_of(summary if isinstance(summary, dict) else {}))
    except SceneError as error:
        say(f"rgbn: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
