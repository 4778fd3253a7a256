"""What the white balls say: intensities, and directions where chrome has none."""

import numpy as np
from numpy.typing import NDArray

from calibrate.intensity import measure, propagate
from calibrate.skin import Skin
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.normals import angular_error_deg
from scene.spheres import Sphere

Array = NDArray[np.float64]
MISFIRE = 0.05
"""A flash under this share of the median did not fire."""
APART_DEG = 6.0
"""From here shading and highlights contradict each other: distant lights are seen elsewhere by each ball."""
RESIDUAL = 0.08
"""Relative misfit of n.l from which a ball is not matte, or distant lights are too near."""
NEAR_APART_DEG, NEAR_RESIDUAL = 3.0, 0.02
"""The same where the lights' positions are known, and only the balls can be wrong: healthy is 1 degree and 0.6 %; a
diameter 20 % off gives 5 degrees and 4 %, 10 % off 2.5 to 4.5 degrees and 2 to 3 %."""


def intensities_from_white(
    frames: Frames,
    skins: list[Skin],
    meter: tuple[Array, Array | None, Array, Array],
    reference: Array,
    evidence: list[str],
    warnings: list[str],
    *,
    apart_deg: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Return intensities (F, 3), relative sigma (F,) and ambient (3,), as pixel values on the first white ball.

    `meter` holds directions, positions, their sigma (degrees) and the ranges' (relative), as the ball is to read them;
    `apart_deg` is what `compare_with_chrome` found.
    """
    directions, positions, sigma_deg, range_sigma = meter
    intensities, sigma, ambient = [], [], []
    for skin in skins:
        light = measure(skin, directions, positions, reference)
        bad = ~np.isfinite(light.intensities).all(1)
        if bad.any():
            names = ", ".join(np.array(frames.names)[bad][:3])
            raise CalibrationError(
                f"{names}: the white ball cannot be read ({light.clipped[bad].max():.0%} of it is clipped). Expose "
                "less, or turn the flash so that it lights the ball."
            )
        evidence.append(light.evidence)
        relative = propagate(skin, directions, positions, reference, sigma_deg, range_sigma)
        intensities.append(light.intensities)
        sigma.append(np.hypot(light.sigma, relative))
        ambient.append(light.ambient)
        if positions is not None:
            if apart_deg > NEAR_APART_DEG or light.residual > NEAR_RESIDUAL:
                warnings.append(
                    f"the white ball contradicts the lights' positions: its shading points {apart_deg:.1f} degrees "
                    f"beside them (median; expected under {NEAR_APART_DEG:g}) and misses n.l by {light.residual:.1%} "
                    f"of the flash (expected under {NEAR_RESIDUAL:.0%}). Check diameter_mm of every ball first, then "
                    "the camera's focal length; else the white ball is glossy or dirty, or the frames are not linear."
                )
        elif light.residual > RESIDUAL:
            warnings.append(
                f"the white ball misses n.l by {light.residual:.0%} of the flash: glossy, dirty, or frames not linear?"
            )
    # Other white balls may be of another gray: only what varies between frames is theirs to say.
    scale = [i.mean(0) / intensities[0].mean(0) for i in intensities]
    weight = [1 / np.maximum(s, 1e-4) ** 2 for s in sigma]
    total = np.sum(weight, axis=0)
    mean = sum(w[:, None] * i / k for w, i, k in zip(weight, intensities, scale, strict=True)) / total[:, None]
    level = mean.mean(1) / np.median(mean.mean(1))
    dark = np.flatnonzero(level < MISFIRE)
    if len(dark):
        # A light of no strength would have a vote on every pixel, and divide it by nothing.
        listed = ", ".join(f"{frames.names[f]} ({level[f]:.1%})" for f in dark)
        raise CalibrationError(
            f"{listed}: the flash did not fire, or the white ball stood in shadow (in brackets: its brightness, of the "
            "median frame's). Reshoot, or list the frame under frames.skip."
        )
    return mean, 1 / np.sqrt(total), ambient[0]


def compare_with_chrome(
    camera: Camera,
    sphere: Sphere,
    shaded: Array,
    directions: Array,
    positions: Array | None,
    evidence: list[str],
    warnings: list[str],
) -> float:
    """Return, and say, how far the white ball's shading and the chrome balls' lights agree, degrees (median)."""
    toward = directions
    if positions is not None and sphere.diameter_mm:
        toward = positions - sphere.center_mm(camera)
        toward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    angle = float(np.nanmedian(angular_error_deg(shaded, toward)))
    evidence.append(f"the white ball's shading agrees with the chrome to {angle:.1f} degrees (median)")
    if positions is None and angle > APART_DEG:
        warnings.append(
            f"the white ball's shading and the chrome balls' highlights point {angle:.0f} degrees apart (median): is "
            "the white ball matte, and are the frames linear?"
        )
    return angle
