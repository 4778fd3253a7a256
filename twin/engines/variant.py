"""Which of Mitsuba's variants runs here: the vectorised one if its LLVM works, else the scalar one.

With an LLVM that is too old the vectorised variant does not raise, it aborts the process: so each library found is
tried once, in a process of its own, and the verdict is kept in the user's cache folder.
"""

import contextlib
import os
import re
import subprocess
import sys
from glob import glob
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scene.errors import RenderError, SceneError
from scene.files import write_json
from scene.reading import json_of

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"
OLDEST_LLVM = 16
"""LLVM 15 ends the process with "Cannot select: fminimum"."""

HOW_TO_GET_THE_FAST_ONE = (
    f"For the fast one (5 to 7 times) install LLVM {OLDEST_LLVM} or later (Debian, Ubuntu: apt install libllvm19; "
    "macOS: brew install llvm), or name the library in DRJIT_LIBLLVM_PATH."
)

# A mesh and an emitter, rendered: what is compiled is what the twin will ask for.
_PROBE = f"""
import mitsuba
mitsuba.set_variant({FAST!r})
scene = mitsuba.load_dict({{
    "type": "scene", "integrator": {{"type": "path", "max_depth": 3}},
    "sensor": {{"type": "perspective", "film": {{"type": "hdrfilm", "width": 8, "height": 8}}}},
    "shape": {{"type": "cube"}}, "emitter": {{"type": "constant"}}}})
import numpy
assert numpy.isfinite(numpy.array(mitsuba.render(scene, spp=1))).all()
print("rendered")
"""

_PLACES = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib/llvm/*/lib*/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)


def load(description: dict[str, Any]) -> Any:
    """Return what Mitsuba makes of a scene's or a sensor's description, made in this thread.

    By itself Mitsuba loads in several, and Dr.Jit refuses what depends on variables that a thread started later made.
    """
    import mitsuba as mi

    return mi.load_dict(description, parallel=False)


def import_mitsuba(*, slow: bool = False) -> Any:
    """Return mitsuba with the variant set that is to be used here; `slow`: the scalar one will do.

    Raises
    ------
    RenderError
        Only the scalar variant runs on this machine.
    """
    variant, note = pick_variant()
    if variant != FAST and not slow:
        raise RenderError(f"the engines `direct` and `many` need Mitsuba's variant {FAST}: {note} Or use `mitsuba`.")
    import mitsuba as mi

    mi.set_variant(variant)  # type: ignore[attr-defined]
    mi.set_log_level(mi.LogLevel.Error)  # type: ignore[attr-defined]
    return mi


def pick_variant() -> tuple[str, str]:
    """Return the variant to render with, and a line that says why.

    Returns
    -------
    variant : {"llvm_ad_rgb", "scalar_rgb"}
        For the first, DRJIT_LIBLLVM_PATH is set in this process' environment: Mitsuba reads it when the variant is
        first used, so call this before.
    note : str
        For the summary: the library used, or what to install for the fast variant.
    """
    if _has_fast_variant():
        named = os.environ.get("DRJIT_LIBLLVM_PATH")
        for library in [Path(named)] if named else llvm_libraries():
            if _works(library):
                os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
                return FAST, f"with {library}"
    return SLOW, f"no LLVM that works was found. {HOW_TO_GET_THE_FAST_ONE}"


def llvm_libraries(places: tuple[str, ...] | None = None) -> list[Path]:
    """Return the LLVM libraries on this machine that are not known to be too old, newest first.

    `places` are glob patterns of absolute paths; where the usual systems put the library, if not given.
    """
    found: dict[Path, tuple[int, Path]] = {}
    for place in (*(_PLACES if places is None else places), str(Path(sys.prefix) / "lib" / "libLLVM*")):
        for path in map(Path, sorted(glob(place))):
            release = _release(path)
            if release >= OLDEST_LLVM:
                found.setdefault(path.resolve(), (release, path))
    return [path for _, path in sorted(found.values(), key=lambda item: (-item[0], str(item[1])))]


def _release(path: Path) -> int:
    """Return the major version that a library's name, or its real path, tells; 0 if none."""
    for name in (path.name, path.resolve().name, str(path.resolve())):
        match = re.search(r"(?:libLLVM-|libLLVM\.so\.|llvm-|llvm@|llvm/)(\d+)", name)
        if match:
            return int(match.group(1))
    return 0


def _has_fast_variant() -> bool:
    import mitsuba

    return FAST in mitsuba.variants()


def _works(library: Path) -> bool:
    """Return whether the fast variant renders with this library; asks the cache first."""
    try:
        key = f"mitsuba {version('mitsuba')}, {library}, {library.stat().st_mtime_ns}"
    except OSError:
        return False
    cache = _cache_folder() / "mitsuba_llvm.json"
    verdicts: dict[str, bool] = {}
    # A cache that cannot be read or written costs a second probe, no more.
    with contextlib.suppress(SceneError, TypeError, ValueError):
        verdicts = dict(json_of(cache))
    if key not in verdicts:
        verdicts[key] = _probe(library)
        with contextlib.suppress(OSError, SceneError):
            write_json(cache, verdicts)
    return verdicts[key]


def _probe(library: Path) -> bool:
    """Render a few pixels in another process, which may well be aborted."""
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": str(library)}
    try:
        result = subprocess.run(
            [sys.executable, "-c", _PROBE], env=environment, capture_output=True, text=True, timeout=180, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return result.returncode == 0 and "rendered" in result.stdout


def _cache_folder() -> Path:
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", str(Path.home()))
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    return Path(base) / "rgbn"
