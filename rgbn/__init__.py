"""The door: `rgbn.open` for Python, `rgbn.cli` for the command line.

>>> import rgbn
>>> session = rgbn.open("captures/penguin")
>>> session.lights.to_dataframe()
>>> session.normals("iterative")
"""

import scene  # noqa: F401 (before numpy is loaded)
from lab.options import Solving, TwinSettings
from rgbn.opened_session import Session
from rgbn.opened_session import open_session as open

__all__ = ["Session", "Solving", "TwinSettings", "open"]
