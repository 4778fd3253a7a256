"""The lights' directions and how well they are known: the panel with the hemisphere, and ellipsoids in space."""

from html import escape

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
SIZE, RIM, TICKS = 400, 165, (30, 60, 90)
"""Of the picture, the radius of 90 degrees in it, and the circles."""


def directions_deg(lights: Lights) -> Array:
    """Return (N, 2): angle from the camera's axis, and azimuth, 0 right and 90 up as the camera sees it."""
    return np.stack(_angles_deg(lights.directions), -1)


def _angles_deg(vectors: Array) -> tuple[Array, Array]:
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x))


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


def place_in_picture(zenith_deg: Array, azimuth_deg: Array) -> Array:
    """Return (..., 2) picture coordinates, right and down: the distance from the middle is the angle from the axis."""
    radius, angle = RIM * np.asarray(zenith_deg) / 90, np.radians(azimuth_deg)
    return SIZE / 2 + np.stack([radius * np.cos(angle), -radius * np.sin(angle)], -1)


def _words(text: str, x: float, y: float, colour: str = "#5f6368", **style: str) -> str:
    more = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in ({"font_size": "12"} | style).items())
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}"{more}>{text}</text>'


def hemisphere_picture(lights: Lights, position_covariance_mm2: Array | None, *, chosen: int, factor: int) -> str:
    """Return the hemisphere as SVG, seen as the camera sees it, one light chosen, sigma `factor` times."""
    middle = SIZE / 2
    parts = [f'<circle cx="{middle}" cy="{middle}" r="{RIM * tick / 90:.1f}" fill="none" stroke="#9aa0a6"/>'
             for tick in TICKS]  # fmt: skip
    parts += [_words(f"{tick}°", middle + 3, middle - RIM * tick / 90 - 3, "#80868b", font_size="11") for tick in TICKS]
    parts += [
        _words("right", SIZE - 4, middle + 4, text_anchor="end"),
        _words("left", 4, middle + 4),
        _words("up", middle, 14, text_anchor="middle"),
        _words("down", middle, SIZE - 6, text_anchor="middle"),
    ]
    places = directions_deg(lights)
    ellipses = _ellipses(lights, position_covariance_mm2)
    for index, (zenith, azimuth) in enumerate(places):
        x, y = place_in_picture(zenith, azimuth)
        colour = "#1a73e8" if index == chosen else "#e37400" if lights.flags[index] else "#202124"
        sigma = lights.direction_sigma_deg[index]
        title = f"{index + 1} {lights.names[index]}: {zenith:.1f}° from the axis, azimuth {azimuth % 360:.1f}°"
        title += f", sigma {sigma:.2f}°" if np.isfinite(sigma) else ", sigma unknown"
        title += "".join(f"; {flag}" for flag in lights.flags[index])
        parts.append(f"<g><title>{escape(title)}</title>")
        wide, high, turn = ellipses[index]
        if np.isfinite(wide):
            parts.append(
                f'<ellipse cx="0" cy="0" rx="{factor * wide:.3f}" ry="{factor * high:.3f}" fill="{colour}" '
                f'fill-opacity="0.25" stroke="{colour}" transform="translate({x:.2f} {y:.2f}) rotate({turn:.2f})"/>'
            )
        parts.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="3" fill="{colour}"/>')
        weight = "bold" if index == chosen else "normal"
        parts.append(_words(str(index + 1), x + 5, y - 5, colour, font_weight=weight) + "</g>")
    return (
        f'<svg viewBox="0 0 {SIZE} {SIZE}" width="100%" style="background:#fff;border-radius:4px" role="img" '
        f'aria-label="Directions of the lights">{"".join(parts)}</svg>'
    )


def ellipsoid_of(covariance_mm2: Array) -> tuple[Array, Array] | None:
    """Return one standard deviation (3,) along each axis, and the axes (3, 3), right-handed, as columns.

    None where the covariance (3, 3) is not known.
    """
    if not np.isfinite(covariance_mm2).all():
        return None
    values, axes = np.linalg.eigh(covariance_mm2)
    return np.sqrt(np.maximum(values, 0)), axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]


def _ellipses(lights: Lights, position_covariance_mm2: Array | None) -> Array:
    """Return (N, 3): half axes in the picture, and by how many degrees the first is turned, clockwise as SVG has it.

    The covariance of the places is taken into the picture by the derivatives of `place_in_picture` there.
    """
    away = light_places(lights) - lights.reference_point_mm
    step = 1e-4 * np.linalg.norm(away, axis=1)[:, None, None]
    ends = [place_in_picture(*_angles_deg(away[:, None] + side * step * np.eye(3))) for side in (1, -1)]
    slopes = (ends[0] - ends[1]) / (2 * step)
    spread = slopes.transpose(0, 2, 1) @ covariance_mm2(lights, position_covariance_mm2) @ slopes
    known = np.isfinite(spread).all((1, 2))
    values, axes = np.linalg.eigh(np.where(known[:, None, None], spread, 0))
    found = np.column_stack([np.sqrt(np.maximum(values[:, ::-1], 0)), np.degrees(np.arctan2(*axes[:, ::-1, 1].T))])
    return np.where(known[:, None], found, np.nan)


class HemispherePanel:
    """The directions with their sigmas, as seen by the camera."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._picture = gui.add_html("")
        self._factor = gui.add_dropdown("sigma drawn", tuple(f"{factor} times" for factor in FACTORS))
        self._facts = gui.add_markdown("")
        window.button("Show in 3-D", lambda: window.choose(view="Lights in 3-D"))
        window.on_input(self._factor, lambda value: window.choose(factor=int(value.split()[0])))
        if window.review.lights is not None:
            window.factor = fitting_factor(window.review.lights)

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        lights = window.review.lights
        self._factor.value = f"{window.factor} times"
        if lights is None:
            self._picture.content, self._facts.content = "", f"**No lights**: {window.review.missing['lights']}"
            return
        covariance = window.review.position_covariance_mm2
        self._picture.content = hemisphere_picture(lights, covariance, chosen=window.frame, factor=window.factor)
        self._facts.content = self._text()

    def _text(self) -> str:
        review, index = self._window.review, self._window.frame
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
            covariance = self._window.review.position_covariance_mm2
            told = "; how uncertain its place is, is not in this folder: calibrate again to have its ellipsoid"
            if covariance is not None and np.isfinite(covariance[index]).all():
                along = lights.directions[index]
                told = f" ± {np.sqrt(along @ covariance[index] @ along):.1f} mm"
            lines.append(f"- {away:.0f} mm from the object{told}")
        lines += [f"- **{plain(flag)}**" for flag in lights.flags[index]]
        return "\n".join(lines)


def _percent(sigma: float) -> str:
    return f" ± {sigma:.1%}" if np.isfinite(sigma) else ""
