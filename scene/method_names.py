"""The names of the methods. Nothing is loaded here: `rgbn --help` asks."""

FAMILIES = {
    "ls": "pixelwise",
    "iterative": "pixelwise",
    "position": "pixelwise",
    "l1": "pixelwise",
    "sbl": "pixelwise",
    "hsh": "pixelwise",
    "rpca": "whole",
    "semicalibrated": "whole",
    "near": "whole",
    "reflectance": "whole",
    "metal": "whole",
    "ldr": "uncalibrated",
    "entropy": "uncalibrated",
    "tv": "uncalibrated",
}
"""The table of methods. The file solve/FAMILY/NAME.py defines `METHOD`; a new method is its file and its line here."""

METHODS = tuple(FAMILIES)
UNCALIBRATED = tuple(name for name, family in FAMILIES.items() if family == "uncalibrated")
"""They know the intensities, where those were calibrated, and no more."""
