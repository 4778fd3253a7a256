"""What this machine has, and what would make it faster."""

import os
import shutil
from pathlib import Path

from scene.current import libraries


def examine() -> list[tuple[str, str]]:
    """Return (what, finding) rows; what is most often missing, the ray caster and the renderer, is really tried."""
    rows = [("machine", f"{os.cpu_count()} cores, {_memory_gb():.0f} GB memory")]
    rows += [(name, version) for name, version in libraries().items()]
    from twin.engines.variant import pick_variant

    variant, note = pick_variant()
    rows.append(("renderer", f"{variant}: {note}" if note else variant))
    try:
        from scene.rays import import_open3d

        import_open3d()
        rows.append(("ray casting", "open3d imports"))
    except Exception as error:
        rows.append(("ray casting", f"open3d does not import: {error}"))
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    rows.append(("disk", f"{free:.0f} GB free here; a 60 x 24 MP session takes about 11 GB, with its twin 25 GB"))
    return rows


def _memory_gb() -> float:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
