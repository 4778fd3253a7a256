"""One session through the steps: plan, job, run."""

import scene  # noqa: F401 (before numpy is loaded)
