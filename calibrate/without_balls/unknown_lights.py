"""No probe at all: no ball, no light file, no known normals. The lights stay unknown, or wait for the scan."""

import numpy as np

from calibrate.calibration import Calibration
from scene.frames import Frames
from scene.lights import Lights


def unknown_lights(frames: Frames, found: str, *, has_scan: bool) -> Calibration:
    """Return a calibration that knows no light; `found` is what the search for balls says.

    Where there is a scan, `align` finds pose and lights together: nothing is lost, and nothing said.
    """
    shown = np.full((0, len(frames), 2), np.nan)
    if has_scan:
        waiting = "no ball, no light file, no known normals: the lights are found with the scan's pose, by `align`"
        return Calibration([], Lights.unknown(frames.names), shown, (), (waiting,))
    found = found.removeprefix("spheres: ").replace(" (asked for: any)", "")
    said = (
        f"no probe tells the lights, which are unknown: {found} Without them only ldr, "
        "entropy and tv can run; they are taken where --method names none. Their relief may be inverted, or too high "
        "or too flat by any factor: read their own doubts. A ball or two in the next capture tell the lights."
    )
    evidence = "no ball, no light file, no known normals: the lights are unknown"
    return Calibration([], Lights.unknown(frames.names), shown, (), (evidence,), (said,))
