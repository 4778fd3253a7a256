"""Balls and lights by a camera of which nothing is known: the balls tell its focal length too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibrate.calibration import Calibration
from draw.readable import share
from scene.camera import Camera

ROUNDS = 4
STILL = 0.02
"""Change of the focal length, relative, after which it is taken."""
KNOWN = 0.1
"""Relative sigma of a focal length that is worth having; EXIF's is 0.06."""


def with_unknown_focal(run: Callable[[Camera], Calibration], camera: Camera) -> Calibration:
    """Return the calibration under the focal length that agrees with it.

    Outlines are found under a focal length that is guessed, and the adjustment of balls and lights corrects it: an
    outline off the axis is an ellipse, and lights must lie where all balls see them. With that they are found again.

    Parameters
    ----------
    run : callable
        Calibrates under a camera.
    camera : Camera
        The guess, with a large `focal_sigma`.

    Returns
    -------
    Calibration
        Its `camera` says how well the focal length is known; orthographic where the balls do not tell it.
    """
    guess, before = camera.fx, (0.0, 0.0)
    for turn in range(ROUNDS):
        found = run(replace(camera, fx=guess, fy=guess))
        told = found.camera
        if told is None or told.is_orthographic or told.focal_sigma > KNOWN:
            break
        x, y = float(np.log(guess)), float(np.log(told.fx))
        if abs(y - x) < max(STILL, told.focal_sigma):
            text = (
                "camera: unknown (no [camera] in session.toml, no focal length in EXIF): its focal length, "
                f"{told.fx:.0f} px, good to {share(told.focal_sigma, 1)} %, is what the balls' outlines and lights ask "
                "for. focal_mm and sensor_mm under [camera], or shots of a board, would be surer."
            )
            return replace(found, camera=replace(told, source="balls"), warnings=(text, *found.warnings))
        # Next where the line through the last two answers meets its own guess.
        slope = (y - before[1]) / (x - before[0]) if turn and x != before[0] else 0.0
        guess, before = float(np.exp(x + (y - x) / (1 - min(slope, 0.5)))), (x, y)
    # The balls do not tell it, or each guess is answered by another: they contradict each other.
    plain = Camera.orthographic(camera.width, camera.height)
    text = (
        "camera: unknown (no [camera] in session.toml, no focal length in EXIF), and the balls do not tell its focal "
        "length: taken as orthographic. Then no light has a position, and a ball away from the centre gives a "
        "direction that is off by about as much as it lies off the axis, 5 to 15 degrees with usual lenses. Add "
        "[camera] with focal_mm and sensor_mm, or shots of a ChArUco board or a chessboard."
    )
    found = run(plain)
    return replace(found, camera=plain, warnings=(text, *found.warnings))
