"""The units of length that a scan may have."""

from typing import Literal

Unit = Literal["m", "cm", "mm", "inch", "unknown"]
UNITS_MM: dict[str, float] = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "inch": 25.4, "unknown": 1.0}
"""In millimetres; a scan of unknown unit keeps its file's numbers."""
