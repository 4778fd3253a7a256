"""Every frame's exposure: what EXIF says, and what the room's light says where EXIF says nothing."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from capture.camera.exif import Exif

ROOM = 0.01
"""Of white: where the frame without flash is brighter, its noise does not matter."""
ENOUGH = 0.01
"""Share of the picture that must be so bright."""
DARKER = 0.85
"""Share of the room's light under which a frame is another exposure."""
ALIKE = 0.92
"""The same that the middle frame must reach: else the room's light, or the frame without flash, is what changed."""
SHADOW = 0.02
"""Share of the room-lit picture that a flash leaves in shadow."""


def reference_exposure(exif: Sequence[Exif]) -> tuple[float | None, NDArray[np.float64]]:
    """Return the session's exposure (the middle one of time x ISO / aperture^2) and each frame's gain to it.

    Frames without EXIF, and those within 1 % (cameras round), keep gain 1.
    """
    known = sorted(e.exposure for e in exif if e.exposure is not None)
    if not known:
        return None, np.ones(len(exif))
    reference = known[len(known) // 2]
    gain = [reference / e.exposure if e.exposure else 1.0 for e in exif]
    return reference, np.array([1.0 if abs(factor - 1) < 0.01 else factor for factor in gain])


def exposure_by_room(
    names: tuple[str, ...], pictures: NDArray, ambient: NDArray | None
) -> tuple[NDArray[np.float64], list[str]]:
    """Return the gains (F,) of frames that are darker than the frame without flash, and a warning for each.

    Parameters
    ----------
    pictures : (F, h, w) float32
        Reduced, with the room's light, at EXIF's exposure.
    ambient : (h, w) float32 or None

    Notes
    -----
    Light only adds: in a flash's shadows a frame is as bright as the one without flash, and nowhere darker.
    """
    gain = np.ones(len(pictures))
    if ambient is None:
        return gain, []
    lit = ambient > ROOM
    if lit.mean() < ENOUGH:
        return gain, []
    least, share = np.quantile(pictures[:, lit] / ambient[lit], (SHADOW / 4, SHADOW), axis=1)
    if np.median(share) < ALIKE:
        return gain, []
    # Of another exposure all shadows are darker alike; of a picture that moved, here and there, by any amount.
    odd = np.flatnonzero((share < DARKER) & (least > 0.7 * share) & (share > 0.02))
    gain[odd] = 1 / share[odd]
    return gain, [
        f"{names[i]}: in the flash's shadows it is {share[i]:.0%} as bright as the frame without flash, and light only "
        f"adds: another exposure, which its EXIF does not tell. It was scaled by {gain[i]:.2f}. Lock the shutter, the "
        "aperture and the sensitivity; reshoot it, or list it under frames.skip."
        for i in odd
    ]
