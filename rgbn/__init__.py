"""The door: the command line."""

import scene  # noqa: F401 (before numpy is loaded)
