"""The root folders are the import packages: make sure that they are ours."""

import importlib.util
from pathlib import Path

from scene.current import ROOMS, ROOT
from scene.errors import SceneError


def check_rooms() -> None:
    """Raise when another distribution owns one of the folders' import names.

    Raises
    ------
    SceneError
        Names the folder, where it was found and whose it is.
    """
    for room in ROOMS:
        found = importlib.util.find_spec(room)
        place = Path(found.origin).resolve().parent if found and found.origin else None
        if place == ROOT / room:
            continue
        from importlib.metadata import packages_distributions

        owners = ", ".join(sorted(set(packages_distributions().get(room, ())) - {"rgbn"})) or "an unknown package"
        raise SceneError(
            f"The import name {room!r} belongs to {owners} here ({place}), not to rgbn ({ROOT / room}). "
            "rgbn is an application and wants an environment of its own: run `make setup` in its folder."
        )
