"""The door: `rgbn.open` for Python, `rgbn.cli` for the command line.

>>> run = rgbn.open("captures/penguin", out="out/penguin")
>>> lights = run.calibrate().lights
>>> normals = run.solve("ls,iterative").normals("iterative")
"""

import scene  # noqa: F401 (before numpy is loaded)
from lab.options import Solving, TwinSettings
from rgbn.session_run import Results, SessionRun
from rgbn.session_run import open_session as open

__all__ = ["Results", "SessionRun", "Solving", "TwinSettings", "open"]
