"""All tables of the evidence, page by page."""

from importlib import import_module

from benchmarks.harness import Table

MODULES = (
    "calibration", "peers", "probe", "real_captures", "sessions", "registration", "methods", "unknown_lights",
    "trust", "twin", "materials", "truth", "counterparts", "sweeps", "plan", "init", "faults", "robustness", "memory",
    "studio",
)  # fmt: skip
"""Files of this folder that list `TABLES`, in the order in which they are measured."""


def tables() -> list[Table]:
    """Return all tables."""
    return [table for name in MODULES for table in import_module(f"benchmarks.{name}").TABLES]
