"""Whether this machine can run rgbn, and what would make it faster: a line a check."""

import os
import shutil
from pathlib import Path

from lab.progress import is_quiet
from scene.current import libraries
from scene.errors import SceneError

DISK_GB, MEMORY_GB = 25, 4
"""What a session of 60 frames of 24 megapixels takes, with its twin."""


def _packages() -> tuple[str, str]:
    found = libraries()
    if missing := [name for name, version in found.items() if version == "absent"]:
        return "X", f"not installed: {', '.join(missing)}. Run: make setup"
    import rawpy

    from scene.rays import import_open3d

    import_open3d()
    raw = ".".join(map(str, rawpy.libraw_version))
    return "ok", f"rgbn {found['rgbn']} on Python {found['python']}, {len(found) - 2} libraries, LibRaw {raw}"


def _renderer() -> tuple[str, str]:
    from twin.engines.variant import SLOW, pick_variant

    variant, note = pick_variant()
    return "!" if variant == SLOW else "ok", f"{variant}: {note}" if note else variant


def _machine() -> tuple[str, str]:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    text = f"{os.cpu_count()} cores, {memory:.0f} GB memory"
    small = f"; large sessions want {MEMORY_GB} GB: use half = true under [frames]"
    return ("ok", text) if memory >= MEMORY_GB else ("!", text + small)


def _disk() -> tuple[str, str]:
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    room = f"{free:.0f} GB free here; a session of 60 x 24 MP takes about 11 GB, with its twin {DISK_GB} GB"
    return "ok" if free > DISK_GB else "!", room


CHECKS = {"packages": _packages, "renderer": _renderer, "machine": _machine, "disk": _disk}
"""Each returns a mark and a text: "ok"; "!": works, but could be better; "X": must be mended. What is most often
missing, the ray caster and the renderer, is really tried."""


def doctor() -> None:
    """Print every check with its mark.

    Raises SceneError: rgbn cannot run here.
    """
    marks = {}
    for what, look in CHECKS.items():
        try:
            marks[what], text = look()
        except Exception as error:
            marks[what], text = "X", f"{' '.join(str(error).split())}. Run: make setup"
        if not is_quiet() or marks[what] != "ok":
            print(f"{marks[what]:2}  {what:12}  {text}")
    if wrong := [what for what, mark in marks.items() if mark == "X"]:
        raise SceneError(f"doctor: this machine cannot run rgbn yet: {', '.join(wrong)}. Mend the lines marked X.")
    if not is_quiet():
        print("rgbn can be used here." + " Lines marked ! could be better." * ("!" in marks.values()))
