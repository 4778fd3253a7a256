"""Many scenes through the steps: sweeps, datasets, virtual counterparts, two folders compared."""

import scene  # noqa: F401 (before numpy is loaded)
