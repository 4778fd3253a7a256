"""The camera by EXIF, with what that is worth: lenses are not what is engraved on them, and focusing changes them."""

from collections.abc import Sequence

import numpy as np

from capture.camera.exif import Exif
from scene.camera import Camera

DIAGONAL_35MM = float(np.hypot(36, 24))
"""mm: what "35 mm equivalent" refers to [CIPA2005]. By width it would be 4 % off on 4:3."""
ENGRAVED_SIGMA = 0.02
"""Relative, of the focal length on a lens against its real one: some 5 % is what makers allow themselves."""
STEP_SIGMA_MM = 0.5 / np.sqrt(3)
"""Of a number rounded to whole millimetres."""
CENTER_SIGMA = 0.01
"""Principal point against the picture's middle, of its width: lenses and stabilised sensors sit beside it."""
USUAL_DISTANCE_MM = 1000.0
"""Sensor to object, where EXIF does not tell: the balls and the object fill the picture."""


def camera_from_exif(
    exif: Sequence[Exif], width: int, height: int, *, half: bool = False
) -> tuple[Camera, tuple[str, ...]]:
    """Return the camera by the middle frame's focal length: focal-plane resolution, else the 35 mm equivalent.

    `exif` is the flash frames', `width` and `height` the decoded frames', which are 2 x 2 superpixels if `half`. The
    camera has `focal_sigma` and `center_sigma_px`; it is orthographic where EXIF says nothing. With it come warnings.
    """
    measured = sorted((e for e in exif if e.focal_mm and e.pixels_per_mm), key=lambda e: e.focal_mm or 0)
    equivalent = sorted((e for e in exif if e.focal_35mm), key=lambda e: e.focal_35mm or 0)
    convention = 0.0
    if measured:
        e = measured[len(measured) // 2]
        assert e.focal_mm
        assert e.pixels_per_mm
        stated_mm = e.focal_mm
        fx, fy = (_by_resolution(e, per_mm, width, half) for per_mm in e.pixels_per_mm)
        what = f"{e.focal_mm:g} mm at {e.pixels_per_mm[0]:.1f} px/mm (focal-plane resolution)"
    elif equivalent:
        e = equivalent[len(equivalent) // 2]
        assert e.focal_35mm
        stated_mm = e.focal_35mm
        diagonal = float(np.hypot(width, height))
        fx = fy = stated_mm * diagonal / DIAGONAL_35MM
        # Not every maker measures by the diagonal: on 3:2 it makes no difference, on 4:3 the width gives 4 % less.
        convention = abs(36 * diagonal / (DIAGONAL_35MM * max(width, height)) - 1) / 2
        what = f"{stated_mm:g} mm on 35 mm film, by the diagonal; rounded to whole millimetres"
    else:
        return Camera.orthographic(width, height), (
            "camera: unknown (no [camera] in session.toml, no focal length in EXIF): taken as orthographic. Then no "
            "light has a position, and a ball away from the centre gives a direction that is off by about as much as "
            "it lies off the axis, 5 to 15 degrees with usual lenses. Add [camera], or shots of a ChArUco board.",
        )
    longer, breathing = _breathing(e)
    sigma = float(np.hypot(np.hypot(ENGRAVED_SIGMA, STEP_SIGMA_MM / stated_mm), np.hypot(breathing, convention)))
    if e.subject_mm:
        what += f", focused at {e.subject_mm:.0f} mm"
    camera = Camera(
        *(width, height, fx * longer, fy * longer, (width - 1) / 2, (height - 1) / 2),
        source="EXIF",
        focal_sigma=sigma,
        center_sigma_px=CENTER_SIGMA * width,
    )
    return camera, (
        f"camera: focal length from EXIF, {what}: {camera.fx:.1f} px, good to {100 * sigma:.0f} %. The principal point "
        f"is taken as the centre, +- {camera.center_sigma_px:.0f} px, distortion as none. Shots of a ChArUco board "
        "would measure all of them.",
    )


def _by_resolution(e: Exif, per_mm: float, width: int, half: bool) -> float:
    scale = 2 if half else 1
    # A picture that was scaled after it was taken still states the resolution of the sensor. RAW files show a few more
    # pixels than EXIF's width, of the same pitch.
    shrunk = width * scale / e.width_px if e.width_px else 1.0
    return (e.focal_mm or 0.0) * per_mm * (1.0 if 0.9 < shrunk < 1.1 else shrunk) / scale


def _breathing(e: Exif) -> tuple[float, float]:
    """Return by what the focal length is multiplied for its focus, and the relative sigma of that.

    A thin lens at magnification m has its image at f (1 + m), and m = f / (distance - f): 5 % at a metre with 50 mm.
    Lenses that focus by moving inner groups get shorter instead, so half of it is added, and half of it is doubt.
    Where EXIF does not tell the distance nothing is added, and all of it at a metre is doubt.
    """
    focal = e.focal_mm or e.focal_35mm or 0.0
    distance = e.subject_mm or USUAL_DISTANCE_MM
    magnification = min(focal / max(distance - focal, 1e-9), 1.0) if distance > focal else 1.0
    return (1 + magnification / 2, magnification / 2) if e.subject_mm else (1.0, magnification)
