"""What tells whether a result is current, and whether two machines would make the same one: the code, the libraries."""

import hashlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any

ROOMS = ("scene", "capture", "calibrate", "align", "solve", "twin", "compare", "lab")
"""The root folders that are import packages."""
ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = (
    "numpy", "scipy", "opencv-contrib-python-headless", "rawpy", "scikit-image", "trimesh", "open3d", "mitsuba",
    "drjit", "numba", "llvmlite", "pillow", "plotly", "tifffile", "exifread", "h5py", "pyarrow",
)  # fmt: skip
"""Packages that a result may depend on."""


def paths_in(value: Any) -> Iterator[Path]:
    """Yield the paths in dataclasses and sequences."""
    if isinstance(value, Path):
        yield value
    elif is_dataclass(value) and not isinstance(value, type):
        yield from paths_in([getattr(value, field.name) for field in fields(value)])
    elif isinstance(value, tuple | list):
        for part in value:
            yield from paths_in(part)


@cache
def libraries() -> dict[str, str]:
    """Return the versions of Python, of rgbn, and of the packages that results depend on."""
    found = {"python": python_version()}
    for name in ("rgbn", *LIBRARIES):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "absent"
    return found


@cache
def code_fingerprint() -> str:
    """Return a hash of the house's sources, as they were when it was first asked for."""
    whole = hashlib.sha256()
    for path in sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        whole.update(f"{path.relative_to(ROOT).as_posix()} ".encode())
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()
