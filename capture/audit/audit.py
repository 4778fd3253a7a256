"""What is wrong with a capture, found before anybody computes with it; each finding a message that can be acted on.

A flash that did not fire is an error: its light does not exist. All else is usable, and a warning.
"""

from collections.abc import Sequence

import numpy as np

from capture.audit.camera_settings import gaps_in_numbering, mixed_settings
from capture.audit.frame_facts import FrameFacts, facts_of, reduced
from capture.audit.gamma import jpeg_quality, noise_slope, speaks_for_gamma, stated_encoding
from capture.audit.missing_flashes import doubles, misfires
from capture.audit.movement import movement
from capture.camera.exif import Exif
from capture.session.globs import kind_of
from capture.session.session import Session
from scene.frames import PEDESTAL, WHITE, Frames

CUT = 0.01
"""Share of what is lit in some frame that may be black to the last bit in the median frame: sound files have 0.0005."""
GOOD_JPEG = 70
"""Quality, as libjpeg counts it, from which compression is not worth a word."""
BLOWN = 0.002
"""Share of the picture in large clipped spots that is worth a warning."""


def audit(
    session: Session,
    frames: Frames,
    exif: Sequence[Exif],
    *,
    facts: list[FrameFacts] | None = None,
    ambient_exif: Sequence[Exif] = (),
) -> tuple[str, ...]:
    """Return what is suspicious about a capture.

    Parameters
    ----------
    session : Session
    frames : Frames
        Its decoded frames.
    exif : F Exif
        The flash frames', in order; those of the ambient frames apart.
    facts : list of F FrameFacts, optional
        Gathered while decoding; else they are gathered from the frames now.

    Returns
    -------
    warnings : tuple of str
        Mixed settings, doubles, clipping, movement, gaps in the numbering, gamma. "frame: what. What to do."

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
    moved = _moved(frames, facts)
    return (
        *mixed_settings(session, exif, ambient_exif),
        *gaps_in_numbering(session),
        *misfires(frames.names, light, ambient),
        *doubles(frames.names, facts, light),
        *_blown(frames.names, facts),
        *moved,
        *_encoding(session, frames),
        *_compressed(session),
        # What lies elsewhere in other frames is lit there and black here.
        *(() if moved else _cut_at_black(session, frames)),
    )


def _blown(names: tuple[str, ...], facts: list[FrameFacts]) -> list[str]:
    share = np.array([fact.blown_share for fact in facts])
    blown = np.flatnonzero(share > BLOWN)
    if not len(blown):
        return []
    worst = int(np.argmax(share))
    listed = ", ".join(names[i] for i in blown[:6]) + (f" and {len(blown) - 6} more" if len(blown) > 6 else "")
    return [
        f"{listed}: overexposed ({names[worst]}: {share[worst]:.1%} of the picture is clipped in large spots). Those "
        "samples are left out; expose so that only a chrome ball's highlight clips."
    ]


def _moved(frames: Frames, facts: list[FrameFacts]) -> list[str]:
    found = movement(frames, facts)
    if found.step is not None:
        here, (right, down) = found.step.first, found.step.shift_px
        turn = f", turned by {abs(found.step.turn_deg):.1f} degrees" if found.step.turn_deg else ""
        return [
            f"{frames.names[here]}: from here on the picture lies {np.hypot(right, down):.1f} px off the frames before "
            f"(right {right:+.1f}, down {down:+.1f}{turn}): the camera or the table moved after "
            f"{frames.names[here - 1]}, or the object with what lies around it. Reshoot, or list the frames before or "
            "after under frames.skip."
        ]
    return [
        f"{frames.names[i]}: the picture lies {np.hypot(*found.shift_px[i]):.1f} px off the other frames' "
        f"(right {found.shift_px[i, 0]:+.1f}, down {found.shift_px[i, 1]:+.1f}): the camera or the table moved. "
        "Reshoot, or list it under frames.skip."
        for i in np.flatnonzero(found.moved)
    ]


def _encoding(session: Session, frames: Frames) -> list[str]:
    """Name what speaks against values being linear."""
    if session.encoding != "linear" or kind_of(session.flash[0]) != "image" or frames.codes.dtype != np.uint16:
        return []
    evidence = stated_encoding(session.flash[0])
    # At most 256 different codes: an 8-bit file.
    few = not session.half and np.unique(frames.codes[0, ::3, ::3]).size <= 256
    noise = noise_slope(frames, step=1 / 255 if few else 0.0)
    reasons = [evidence] if evidence else []
    if noise and speaks_for_gamma(*noise):
        reasons.append(f"noise that falls with brightness (slope {noise[0]:.2f}; 0 to 1 in linear values)")
    if reasons:
        verb = "speaks" if len(reasons) == 1 else "speak"
        return [
            f"frames.linear: taken as linear, but {' and '.join(reasons)} {verb} for gamma encoding, which "
            "costs some 14 degrees in the normals. Set linear = false (sRGB) or gamma = 2.2, or give the RAW files."
        ]
    if few and not session.encoding_stated:
        return [
            "frames.linear: not stated, and the files have 8 bits: taken as linear. Write linear = true if they are, "
            "linear = false if they are sRGB-encoded, as cameras' JPEG and most 8-bit pictures are."
        ]
    return []


def _compressed(session: Session) -> list[str]:
    """Name JPEG files whose compression bends more than 8 bits do."""
    quality = jpeg_quality(session.flash[0])
    if quality is None or quality >= GOOD_JPEG:
        return []
    return [
        f"{session.flash[0].name}: a JPEG file of quality {quality:.0f} (of 100): blocks and smeared edges move balls "
        "and highlights, and dark parts are lost. Give the RAW files, or export 16-bit TIFF or PNG."
    ]


def _cut_at_black(session: Session, frames: Frames) -> list[str]:
    """Name files in which too much was taken off as black: shadows without noise, and without bounced light."""
    import cv2

    if kind_of(session.flash[0]) != "image" or frames.codes.dtype != np.uint16:
        return []
    height, width = (min(size, 1024) for size in (frames.height, frames.width))
    top, left = (frames.height - height) // 2, (frames.width - width) // 2
    codes = frames.codes[:, top : top + height, left : left + width]
    # Of 8 bits the lowest step alone is so wide.
    if np.unique(codes[0]).size <= 256:
        return []
    lit = np.max([picture.max(-1) for picture in codes], 0) > PEDESTAL + 0.02 * (WHITE - PEDESTAL)
    if not lit.any():
        return []
    around = np.ones((3, 3), np.uint8)
    black = [cv2.erode((picture.max(-1) <= PEDESTAL).astype(np.uint8), around)[lit].mean() for picture in codes]
    share = float(np.median(black))
    if share < CUT:
        return []
    return [
        f"frames: {share:.0%} of what other frames show lit is zero to the last bit, without noise (median frame; "
        f"expected under {CUT:.0%}). Unless these are renderings without bounced light, the black level that was "
        "subtracted is too high, and the dark side of every shading is cut off. Export again with the camera's own "
        "black level, or give the RAW files."
    ]
