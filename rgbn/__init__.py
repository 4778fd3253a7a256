"""The door: `rgbn.open` for sessions in Python, `rgbn.solve` for arrays, `rgbn.cli` for the command line.

>>> import rgbn
>>> session = rgbn.open("captures/penguin")
>>> session.lights.to_dataframe()
>>> session.normals("iterative")
"""

import scene  # noqa: F401 (before numpy is loaded)
from lab.options import Solving, TwinSettings
from rgbn.array_solve import solve_arrays as solve
from rgbn.examples import example
from rgbn.opened_session import Session
from rgbn.opened_session import open_session as open
from scene.camera import Camera
from scene.errors import SceneError
from scene.lights import Lights

__all__ = ["Camera", "Lights", "SceneError", "Session", "Solving", "TwinSettings", "example", "open", "solve"]
