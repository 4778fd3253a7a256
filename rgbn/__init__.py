"""The door: `rgbn.open` for sessions in Python, `rgbn.solve` for arrays, `rgbn.cli` for the command line.

>>> import rgbn
>>> session = rgbn.open("captures/penguin")
>>> session.lights.to_dataframe()
>>> session.normals("iterative")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import scene  # noqa: F401 (before numpy is loaded)

if TYPE_CHECKING:
    from calibrate.known_lights.rig import rig
    from lab.options import Solving, TwinSettings
    from rgbn.array_solve import solve_arrays as solve
    from rgbn.examples import example
    from rgbn.opened_session import Session
    from rgbn.opened_session import Session as open
    from scene.camera import Camera
    from scene.errors import SceneError
    from scene.lights import Lights

__all__ = ["Camera", "Lights", "SceneError", "Session", "Solving", "TwinSettings", "example", "open", "rig", "solve"]

_PLACES = {
    "Camera": "scene.camera.Camera",
    "Lights": "scene.lights.Lights",
    "SceneError": "scene.errors.SceneError",
    "Session": "rgbn.opened_session.Session",
    "Solving": "lab.options.Solving",
    "TwinSettings": "lab.options.TwinSettings",
    "example": "rgbn.examples.example",
    "open": "rgbn.opened_session.Session",
    "rig": "calibrate.known_lights.rig.rig",
    "solve": "rgbn.array_solve.solve_arrays",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for: the command line's help needs none of it, and no numpy."""
    if name not in _PLACES:
        raise AttributeError(f"module 'rgbn' has no attribute {name!r}")
    place, _, known = _PLACES[name].rpartition(".")
    return getattr(import_module(place), known)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
