"""What is wrong with a capture, found before anybody computes with it; each finding a message that can be acted on.

A flash that did not fire is an error: its light does not exist. All else is usable, and a warning.
"""

from collections.abc import Sequence

import numpy as np

from capture.audit.camera_settings import mixed_settings
from capture.audit.encoding_check import encoding_warnings
from capture.audit.frame_facts import FrameFacts, facts_of, reduced
from capture.audit.missing_flashes import doubles, misfires
from capture.audit.movement import movement
from capture.camera.exif import Exif
from capture.session.session_types import CaptureSession
from scene.frames import Frames
from scene.reading import listed

BLOWN = 0.002
"""Share of the picture in large clipped spots that is worth a warning."""


def audit(
    session: CaptureSession,
    frames: Frames,
    exif: Sequence[Exif],
    *,
    facts: list[FrameFacts] | None = None,
    ambient_exif: Sequence[Exif] = (),
) -> tuple[str, ...]:
    """Return warnings, "frame: what. What to do.", of a session's decoded frames and of its files.

    `exif` is the flash frames', in order; `facts` (F,) were gathered while decoding, else they are gathered now.

    Raises
    ------
    CaptureError
        A flash did not fire, or it fired in the ambient frame; every such frame is named.
    """
    facts = facts or [facts_of(frames.codes[i]) for i in range(len(frames))]
    light = np.stack([fact.small * gain for fact, gain in zip(facts, frames.gain, strict=True)])
    ambient = None if frames.ambient is None else reduced(frames.ambient)
    if ambient is not None:
        light = light - ambient
    return (
        *mixed_settings(session, exif, ambient_exif),
        *misfires(frames.names, light, ambient),
        *doubles(frames.names, facts, light),
        *blown_warnings(frames.names, facts),
        *movement_warnings(frames, facts),
        *encoding_warnings(session, frames),
    )


def blown_warnings(names: tuple[str, ...], facts: list[FrameFacts]) -> list[str]:
    """Name frames of which a large part is clipped."""
    share = np.array([fact.blown_share for fact in facts])
    blown = [names[i] for i in np.flatnonzero(share > BLOWN)]
    if not blown:
        return []
    worst = int(np.argmax(share))
    return [
        f"{listed(blown)}: overexposed ({names[worst]}: {share[worst]:.1%} of the picture is clipped in large spots). "
        "Those samples are left out; expose so that only a chrome ball's highlight clips."
    ]


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
