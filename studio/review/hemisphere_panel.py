"""The panel of the lights: the hemisphere, and what is known of the chosen one."""

import numpy as np

from studio.markdown import plain
from studio.review.hemisphere import FACTORS, directions_deg, fitting_factor, hemisphere_picture
from studio.review.review_desk import ReviewDesk


class LightsPanel:
    """The directions with their sigmas, as seen by the camera."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._picture = gui.add_html("")
        self._factor = gui.add_dropdown("sigma drawn", tuple(f"{factor} times" for factor in FACTORS))
        self._facts = gui.add_markdown("")
        desk.on_click(gui.add_button("Show in 3-D"), lambda: desk.choose(view="Lights in 3-D"))
        desk.on_input(self._factor, self._scale)
        if desk.review.lights is not None:
            desk.factor = fitting_factor(desk.review.lights)

    def refresh(self) -> None:
        """Follow the desk."""
        desk = self._desk
        lights = desk.review.lights
        self._factor.value = f"{desk.factor} times"
        if lights is None:
            self._picture.content, self._facts.content = "", f"**No lights**: {desk.review.missing['lights']}"
            return
        covariance = desk.review.position_covariance_mm2
        self._picture.content = hemisphere_picture(lights, covariance, chosen=desk.frame, factor=desk.factor)
        self._facts.content = self._text()

    def _scale(self, value: str) -> None:
        self._desk.factor = int(value.split()[0])
        self._desk.refresh()

    def _text(self) -> str:
        review, index = self._desk.review, self._desk.frame
        lights = review.lights
        assert lights is not None
        zenith, azimuth = directions_deg(lights)[index]
        sigma = lights.direction_sigma_deg[index]
        lines = [
            f"**{index + 1} {plain(lights.names[index])}**, {lights.model}",
            f"- {zenith:.1f}° from the camera's axis, azimuth {azimuth % 360:.1f}° (0° right, 90° up)",
            f"- sigma {sigma:.2f}°" if np.isfinite(sigma) else "- sigma: not known, the lights were given",
            f"- intensity {lights.intensities[index].mean():.3f}" + _percent(lights.intensity_sigma[index]),
        ]
        if lights.positions_mm is not None:
            away = float(np.linalg.norm(lights.positions_mm[index] - lights.reference_point_mm))
            lines.append(f"- {away:.0f} mm from the object" + self._range_sigma(index))
        lines += [f"- **{plain(flag)}**" for flag in lights.flags[index]]
        return "\n".join(lines)

    def _range_sigma(self, index: int) -> str:
        covariance, lights = self._desk.review.position_covariance_mm2, self._desk.review.lights
        assert lights is not None
        if covariance is None or not np.isfinite(covariance[index]).all():
            return "; how uncertain its place is, is not in this folder: calibrate again to have its ellipsoid"
        along = lights.directions[index]
        return f" ± {np.sqrt(along @ covariance[index] @ along):.1f} mm"


def _percent(sigma: float) -> str:
    return f" ± {sigma:.1%}" if np.isfinite(sigma) else ""
