"""The documentation as a site, by `make docs`. Nothing is fetched from the net, neither to build it nor to read it."""

from importlib.metadata import version as version_of
from pathlib import Path

project = "rgbn"
author = "the rgbn developers"
version = release = version_of("rgbn")

extensions = ["myst_parser"]
exclude_patterns = ["_build", "_gallery"]
# The example reports, where `make gallery` has made them.
html_extra_path = ["_gallery"] if (Path(__file__).parent / "_gallery").is_dir() else []
myst_enable_extensions = ["tasklist"]
myst_heading_anchors = 3
# `toml` stands in the pages as people write it, `...` and all.
suppress_warnings = ["misc.highlighting_failure"]

html_theme = "furo"
html_title = "rgbn"
html_show_sphinx = False
html_show_copyright = False
# Two dashes before an option stay two.
smartquotes = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}
