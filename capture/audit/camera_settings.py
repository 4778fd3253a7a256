"""Exposure and settings: what EXIF says, and what the room's light says where EXIF is silent."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from capture.camera.exif import Exif
from capture.session.session_types import CaptureSession
from scene.reading import listed

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

_SETTINGS = (
    ("exposure_s", "exposure time {:g} s", "the shutter"),
    ("iso", "ISO {:g}", "the sensitivity"),
    ("aperture", "aperture f/{:g}", "the aperture"),
    ("focal_mm", "focal length {:g} mm", "the zoom"),
    ("camera", "camera {}", "the camera"),
)
_POWERS = {"exposure_s": 1, "iso": 1, "aperture": -2}
"""Of which the light gathered is the product."""


def exposure_gains(exif: Sequence[Exif], ambient: Sequence[Exif] = ()) -> tuple[NDArray[np.float64], list[float]]:
    """Return the gains that take flash frames and ambient ones to the session's exposure, the flash frames' middle one.

    An exposure is time x ISO / aperture^2, relative. What no frame tells is taken as the same in all, what some do not
    tell as the others' middle one. Frames that tell nothing, and those within 1 % (cameras round), keep gain 1.
    """
    everyone = [*exif, *ambient]
    exposures = np.ones(len(everyone))
    for field, power in _POWERS.items():
        known = sorted(value for e in everyone if (value := getattr(e, field)))
        usual = known[len(known) // 2] if known else 1.0
        exposures *= [float(getattr(e, field) or usual) ** power for e in everyone]
    tells = np.array([any(getattr(e, field) for field in _POWERS) for e in everyone], bool)
    told = np.sort(exposures[: len(exif)][tells[: len(exif)]])
    gain = np.where(tells, told[len(told) // 2] / exposures, 1.0) if len(told) else np.ones(len(everyone))
    gain[abs(gain - 1) < 0.01] = 1.0
    return gain[: len(exif)], gain[len(exif) :].tolist()


def exposure_by_room(
    names: tuple[str, ...], pictures: NDArray, ambient: NDArray | None
) -> tuple[NDArray[np.float64], list[str]]:
    """Return the gains (F,) of frames that are darker than the frame without flash, and a warning for each.

    `pictures` (F, h, w) are reduced, with the room's light, at EXIF's exposure; `ambient` (h, w) alike. Light only
    adds: in a flash's shadows a frame is as bright as the one without flash, and nowhere darker.
    """
    gain = np.ones(len(pictures))
    lit = ambient is not None and ambient > ROOM
    if ambient is None or np.mean(lit) < ENOUGH:
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


def mixed_settings(session: CaptureSession, exif: Sequence[Exif], ambient_exif: Sequence[Exif]) -> list[str]:
    """Name frames whose settings differ from what most frames have, or which do not tell what others do."""
    names = [*session.names, *(path.stem for path in session.ambient)]
    everyone = list(zip(names, [*exif, *ambient_exif], strict=False))
    gains = np.concatenate(exposure_gains(exif, ambient_exif)).round(3).tolist()
    scaled = {name for name, gain in zip(names, gains, strict=False) if gain != Counter(gains).most_common(1)[0][0]}
    silent = [name for name, e in everyone if not any(getattr(e, field) for field in _POWERS)]
    nowhere = [what for field, _, what in _SETTINGS[:3] if not any(getattr(e, field) for _, e in everyone)]
    same = f" Taken as the same in all, since EXIF does not tell: {' and '.join(nowhere)}." if nowhere else ""
    warnings = []
    for field, label, what in _SETTINGS:
        known = [(name, value) for name, e in everyone if (value := getattr(e, field))]
        usual = Counter(value for _, value in known).most_common(1)
        odd = {name: f"{name} ({label.format(value)})" for name, value in known if value != usual[0][0]}
        if odd:
            remedy = "The frames do not fit together."
            if field in _POWERS:
                remedy = (
                    f"They were scaled to the others' exposure, which holds for steady lamps; a flash is over before "
                    f"the shutter closes, so that time scales the ambient light only.{same}"
                    if scaled & odd.keys()
                    else "With their other settings they gather as much light as the others: they were not scaled."
                )
            warnings.append(
                f"{listed(odd.values())}: the others have {label.format(usual[0][0])}. {remedy} Lock {what}, reshoot."
            )
        lacks = [name for name, e in everyone if field in _POWERS and not getattr(e, field) and name not in silent]
        if known and lacks:
            middle = sorted(value for _, value in known)[len(known) // 2]
            warnings.append(
                f"{listed(lacks)}: EXIF does not tell {what}, which {len(known)} others have; taken as "
                f"{label.format(middle)}."
            )
    if 0 < len(silent) < len(everyone):
        warnings.append(
            f"{listed(silent)}: no exposure in EXIF, unlike the other {len(everyone) - len(silent)} frames; "
            "taken as the same exposure."
        )
    return warnings
