"""Many scenes through the steps: sweeps, datasets, two folders compared."""

import scene  # noqa: F401 (before numpy is loaded)
