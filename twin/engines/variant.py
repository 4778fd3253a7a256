"""Which of Mitsuba's variants runs here: the graphics card's if it works, else LLVM's if that does, else the scalar.

With an LLVM that is too old, or a broken driver, a vectorised variant does not raise, it aborts the process: so each
card and each library found is tried once, in a process of its own, and the verdict is kept in the user's cache folder.
"""

import contextlib
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from glob import glob
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scene.errors import RenderError, SceneError
from scene.files import write_json
from scene.reading import json_of

GPU, FAST, SLOW = "cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb"
ASKED = "RGBN_GPU"
"""Environment variable that keeps the twin off the graphics card, if it is `no`."""
AGREES = 0.02
"""Of a picture's mean: so far may the variant that is tried differ from the scalar one."""
OLDEST_LLVM = 16
"""LLVM 15 ends the process with "Cannot select: fminimum"."""

HOW_TO_GET_THE_FAST_ONE = (
    f"For the fast one (5 to 7 times) install LLVM {OLDEST_LLVM} or later (Debian, Ubuntu: apt install libllvm19; "
    "macOS: brew install llvm), or name the library in DRJIT_LIBLLVM_PATH."
)

# A mesh under an emitter: what is compiled is what the twin will ask for. 16,384 samples: their noise is far below 2 %.
_PROBE = f"""
import sys
import numpy
import mitsuba

def mean(variant):
    mitsuba.set_variant(variant)
    turned = mitsuba.ScalarTransform4f().translate([0, 0, 5]).rotate([1, 1, 0], 40)
    scene = mitsuba.load_dict({{
        "type": "scene", "integrator": {{"type": "path", "max_depth": 3}},
        "sensor": {{"type": "perspective", "film": {{"type": "hdrfilm", "width": 16, "height": 16}}}},
        "shape": {{"type": "cube", "to_world": turned}},
        "sky": {{"type": "constant"}}, "sun": {{"type": "directional", "direction": [1, 2, 3], "irradiance": 9.0}}}})
    return float(numpy.array(mitsuba.render(scene, spp=64)).mean())

known, tried = mean({SLOW!r}), mean(sys.argv[1])
assert known > 0 and abs(tried - known) <= {AGREES} * known, (known, tried)
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
    if variant == SLOW and not slow:
        raise RenderError(f"the engine `many` needs a vectorised variant of Mitsuba: {note} Or `mitsuba`.")
    import mitsuba as mi

    mi.set_variant(variant)  # type: ignore[attr-defined]
    mi.set_log_level(mi.LogLevel.Error)  # type: ignore[attr-defined]
    return mi


def pick_variant() -> tuple[str, str]:
    """Return the variant to render with, and a line that says why.

    Returns
    -------
    variant : {"cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb"}
        For the second, DRJIT_LIBLLVM_PATH is set in this process' environment: Mitsuba reads it when the variant is
        first used, so call this before.
    note : str
        For the summary: the card or the library used, why a card is not, or what to install for a fast variant.
    """
    card, note = graphics_card(), ""
    # Not by itself: nobody has rendered a twin on one yet.
    if card and os.environ.get(ASKED, "").casefold() != "yes":
        note = f"{card} is not used ({ASKED}=yes asks for it); "
    elif card and _has(GPU):
        if _works(GPU, card):
            return GPU, f"on {card}"
        note = f"{card} does not render as the processor does; "
    if _has(FAST):
        named = os.environ.get("DRJIT_LIBLLVM_PATH")
        for library in [Path(named)] if named else llvm_libraries():
            if library.exists() and _works(FAST, f"{library}, {library.stat().st_mtime_ns}", library):
                os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
                return FAST, f"{note}with {library}"
    return SLOW, f"{note}no LLVM that works was found. {HOW_TO_GET_THE_FAST_ONE}"


@cache
def graphics_card() -> str:
    """Return name and driver of this machine's graphics cards, as NVIDIA's own program tells them; empty if none."""
    program = shutil.which("nvidia-smi")
    asked = [str(program), "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        told = subprocess.run(asked, capture_output=True, text=True, timeout=30, check=True).stdout if program else ""
    except (OSError, subprocess.SubprocessError):
        return ""
    return "; ".join(" ".join(line.split()) for line in told.splitlines())


def llvm_libraries() -> list[Path]:
    """Return the LLVM libraries on this machine that are not known to be too old, newest first."""
    found: dict[Path, tuple[int, Path]] = {}
    for place in (*_PLACES, str(Path(sys.prefix) / "lib" / "libLLVM*")):
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


def _has(variant: str) -> bool:
    import mitsuba

    return variant in mitsuba.variants()


def _works(variant: str, what: str, library: Path | None = None) -> bool:
    """Return whether a variant renders with a card or a library; asks the cache first."""
    key = f"mitsuba {version('mitsuba')}, {what}"
    kept = _cache_folder() / "mitsuba_llvm.json"
    verdicts: dict[str, bool] = {}
    # A cache that cannot be read or written costs a second probe, no more.
    with contextlib.suppress(SceneError, TypeError, ValueError):
        verdicts = dict(json_of(kept))
    if key not in verdicts:
        verdicts[key] = _probe(variant, library)
        with contextlib.suppress(OSError, SceneError):
            write_json(kept, verdicts)
    return verdicts[key]


def _probe(variant: str, library: Path | None = None) -> bool:
    """Render a few pixels in another process, which may well be aborted."""
    environment = os.environ if library is None else {**os.environ, "DRJIT_LIBLLVM_PATH": str(library)}
    try:
        result = subprocess.run(
            [sys.executable, "-c", _PROBE, variant],
            env=environment,
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
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
