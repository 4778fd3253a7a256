"""Balls and lights by a camera of which nothing is known: the balls tell its focal length too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibrate.calibration import Calibration
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
    guesses: list[float] = []
    answers: list[float] = []
    for _ in range(ROUNDS):
        guess = _next(guesses, answers, camera.fx)
        found = run(replace(camera, fx=guess, fy=guess))
        if found.camera is None or found.camera.is_orthographic or found.camera.focal_sigma > KNOWN:
            return _orthographic(run, camera)
        guesses.append(guess)
        answers.append(found.camera.fx)
        if abs(np.log(answers[-1] / guess)) < max(STILL, found.camera.focal_sigma):
            return _told(found, found.camera)
    # Each guess is answered by another: the balls contradict each other.
    return _orthographic(run, camera)


def _next(guesses: list[float], answers: list[float], first: float) -> float:
    """Return the focal length to try: where the line through the last two answers meets its own guess."""
    if not guesses:
        return first
    if len(guesses) == 1:
        return answers[0]
    x, y = np.log(guesses[-2:]), np.log(answers[-2:])
    slope = float((y[1] - y[0]) / (x[1] - x[0])) if x[1] != x[0] else 0.0
    return float(np.exp(x[1] + (y[1] - x[1]) / (1 - min(slope, 0.5))))


def _told(found: Calibration, camera: Camera) -> Calibration:
    text = (
        f"camera: unknown (no [camera] in session.toml, no focal length in EXIF): its focal length, {camera.fx:.0f} "
        f"px, good to {100 * camera.focal_sigma:.0f} %, is what the balls' outlines and lights ask for. focal_mm and "
        "sensor_mm under [camera], or shots of a board, would be surer."
    )
    return replace(found, camera=replace(camera, source="balls"), warnings=(text, *found.warnings))


def _orthographic(run: Callable[[Camera], Calibration], camera: Camera) -> Calibration:
    plain = Camera.orthographic(camera.width, camera.height)
    text = (
        "camera: unknown (no [camera] in session.toml, no focal length in EXIF), and the balls do not tell its focal "
        "length: taken as orthographic. Then no light has a position, and a ball away from the centre gives a "
        "direction that is off by about as much as it lies off the axis, 5 to 15 degrees with usual lenses. Add "
        "[camera] with focal_mm and sensor_mm, or shots of a ChArUco board or a chessboard."
    )
    found = run(plain)
    return replace(found, camera=plain, warnings=(text, *found.warnings))
