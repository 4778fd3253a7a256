"""What is wrong with a capture, found before anybody computes with it; each finding a message that can be acted on.

A flash that did not fire is an error: its light does not exist. All else is usable, and a warning.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from capture.audit.camera_settings import exposure_by_room, exposure_gains, mixed_settings
from capture.audit.frame_facts import FrameFacts
from capture.audit.missing_flashes import doubles, misfires
from capture.audit.movement import movement
from capture.camera.exif import Exif
from capture.session.session_types import CaptureSession
from scene.frames import Frames
from scene.reading import listed

BLOWN = 0.002
"""Share of the picture in large clipped spots that is worth a warning."""


def at_a_glance(
    session: CaptureSession,
    exif: Sequence[Exif],
    ambient_exif: Sequence[Exif],
    facts: list[FrameFacts],
    ambient: NDArray | None,
) -> tuple[NDArray[np.float64], list[str], list[str]]:
    """Return the flash frames' gains (F,), lines that name frames without their flash, and warnings.

    `exif` and `facts` are the flash frames', in order; `ambient` (h, w) is reduced as `FrameFacts.small`.
    """
    names, gain = session.names, exposure_gains(exif, ambient_exif)[0]
    pictures = np.stack([fact.small * factor for fact, factor in zip(facts, gain, strict=True)])
    by_room, told = exposure_by_room(names, pictures, ambient)
    light = pictures * by_room[:, None, None] - (0 if ambient is None else ambient)
    missing, dark = misfires(names, light, ambient)
    told = [*told, *mixed_settings(session, exif, ambient_exif), *dark, *doubles(names, facts, light)]
    share = {name: fact.blown_share for name, fact in zip(names, facts, strict=True) if fact.blown_share > BLOWN}
    if share:
        worst = max(share, key=share.__getitem__)
        told.append(
            f"{listed(share)}: overexposed ({worst}: {share[worst]:.1%} of the picture is clipped in large spots). "
            "Those samples are left out; expose so that only a chrome ball's highlight clips."
        )
    return gain * by_room, missing, told


def movement_warnings(frames: Frames, facts: list[FrameFacts]) -> list[str]:
    """Name frames that lie beside the others, or the frame from which on all do."""
    found = movement(frames, facts)
    if found.step is not None:
        here, (right, down) = found.step.first, found.step.shift_px
        turn = f", turned by {abs(found.step.turn_deg):.1f} degrees" if found.step.turn_deg else ""
        growth = f", grown by {found.step.growth:+.1%}" if found.step.growth else ""
        what = "the focus or the zoom" if growth else "the camera or the table"
        return [
            f"{frames.names[here]}: from here on the picture lies {np.hypot(right, down):.1f} px off the frames before "
            f"(right {right:+.1f}, down {down:+.1f}{turn}{growth}): {what} moved after {frames.names[here - 1]}, or "
            "the object with what lies around it. Reshoot, or list the frames before or after under frames.skip."
        ]
    return [
        f"{frames.names[i]}: the picture lies {np.hypot(right, down):.1f} px off the other frames' (right "
        f"{right:+.1f}, down {down:+.1f}): the camera or the table moved. Reshoot, or list it under frames.skip."
        for i, (right, down) in enumerate(found.shift_px)
        if found.moved[i]
    ]
