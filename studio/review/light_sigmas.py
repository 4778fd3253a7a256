"""The lights' directions and how well they are known: their numbers, and ellipsoids in space."""

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from studio.review.review_window import ReviewWindow
from studio.widgets import plain

Array = NDArray[np.float64]
FACTORS = (1, 3, 10, 30, 100)
"""By which a sigma may be drawn larger."""
SHOWN_DEG = 4.0
"""A sigma drawn this large is seen well."""


def light_places(lights: Lights) -> Array:
    """Return (N, 3), mm, where lights are drawn: near ones where they are, distant ones a metre toward them."""
    if lights.positions_mm is not None:
        return lights.positions_mm
    return lights.reference_point_mm + 1000.0 * lights.directions


def covariance_mm2(lights: Lights, position_covariance_mm2: Array | None) -> Array:
    """Return (N, 3, 3), how well each of `light_places` is known; NaN where nothing is.

    Where the positions' covariance is not known, the stated sigma holds all round, across the direction.
    """
    if position_covariance_mm2 is not None and lights.positions_mm is not None:
        return position_covariance_mm2
    away = np.linalg.norm(light_places(lights) - lights.reference_point_mm, axis=1)
    wide = away * np.tan(np.radians(lights.direction_sigma_deg))
    across = np.eye(3) - lights.directions[:, :, None] * lights.directions[:, None]
    return wide[:, None, None] ** 2 * across


def fitting_factor(lights: Lights) -> int:
    """Return by how much sigmas are drawn larger so that they are seen."""
    sigma = lights.direction_sigma_deg
    typical = float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else SHOWN_DEG
    return min(FACTORS, key=lambda factor: abs(np.log(factor * max(typical, 1e-6) / SHOWN_DEG)))


def ellipsoid_of(covariance_mm2: Array) -> tuple[Array, Array] | None:
    """Return one standard deviation (3,) along each axis, and the axes (3, 3), right-handed, as columns.

    None where the covariance (3, 3) is not known.
    """
    if not np.isfinite(covariance_mm2).all():
        return None
    values, axes = np.linalg.eigh(covariance_mm2)
    return np.sqrt(np.maximum(values, 0)), axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]


class LightSigmas:
    """The light of the frame that is chosen, and by how much the ellipsoids of all are drawn larger."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        gui.add_markdown("The flashes around the object, each with the ellipsoid of its sigma. A click chooses one.")
        self._factor = gui.add_dropdown("sigma drawn", tuple(f"{factor} times" for factor in FACTORS))
        self._facts = gui.add_markdown("")
        window.on_input(self._factor, lambda value: window.choose(factor=int(value.split()[0])))

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        lights = window.review.lights
        if window.factor == 0:
            window.factor = fitting_factor(lights) if lights is not None else 1
        self._factor.value = f"{window.factor} times"
        missing = window.review.missing.get("lights", "")
        self._facts.content = f"**No lights**: {missing}" if lights is None else self._text()

    def _text(self) -> str:
        review, index = self._window.review, self._window.frame
        lights = review.lights
        assert lights is not None
        facts, sigma = lights.facts()["frames"][index], lights.direction_sigma_deg[index]
        lines = [
            f"**{index + 1} {plain(lights.names[index])}**, {lights.model}",
            f"- {facts['zenith_deg']:.1f}° from the camera's axis, azimuth {facts['azimuth_deg']:.1f}° (0° right, "
            "90° up)",
            f"- sigma {sigma:.2f}°" if np.isfinite(sigma) else "- sigma: not known, the lights were given",
            f"- intensity {facts['intensity_mean']:.3f}" + _percent(lights.intensity_sigma[index]),
        ]
        if lights.positions_mm is not None:
            covariance = self._window.review.position_covariance_mm2
            told = "; how uncertain its place is, is not in this folder: calibrate again to have its ellipsoid"
            if covariance is not None and np.isfinite(covariance[index]).all():
                along = lights.directions[index]
                told = f" ± {np.sqrt(along @ covariance[index] @ along):.1f} mm"
            lines.append(f"- {facts['distance_mm']:.0f} mm from the object{told}")
        lines += [f"- **{plain(flag)}**" for flag in lights.flags[index]]
        return "\n".join(lines)


def _percent(sigma: float) -> str:
    return f" ± {sigma:.1%}" if np.isfinite(sigma) else ""
