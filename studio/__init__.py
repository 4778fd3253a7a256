"""The browser: `rgbn studio`. A thin layer over the functions of the command line, shown by viser."""

import scene  # noqa: F401 (before numpy is loaded)
