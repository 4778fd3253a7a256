"""The lights' directions and how well they are known: the panel with the hemisphere, and ellipsoids in space."""

from dataclasses import dataclass
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
    x, y, z = lights.directions.T
    return np.degrees(np.stack([np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)], -1))


def direction_covariance(lights: Lights, position_covariance_mm2: Array | None) -> Array:
    """Return (N, 2, 2), degrees squared, along (away from the axis, around it); NaN where nothing is known.

    A near light's direction d = (q - x) / r moves by (I - d d^T) / r dq. Where the positions' covariance is not known,
    the stated sigma holds along both.
    """
    across = np.stack(_tangents(lights), 1)
    if position_covariance_mm2 is None or lights.positions_mm is None:
        return lights.direction_sigma_deg[:, None, None] ** 2 * np.eye(2)
    ranges = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    jacobian = np.degrees(across / ranges[:, None, None])
    return jacobian @ position_covariance_mm2 @ jacobian.transpose(0, 2, 1)


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
    covariance = direction_covariance(lights, position_covariance_mm2)
    for index, (zenith, azimuth) in enumerate(places):
        x, y = place_in_picture(zenith, azimuth)
        colour = "#1a73e8" if index == chosen else "#e37400" if lights.flags[index] else "#202124"
        sigma = lights.direction_sigma_deg[index]
        title = f"{index + 1} {lights.names[index]}: {zenith:.1f}° from the axis, azimuth {azimuth % 360:.1f}°"
        title += f", sigma {sigma:.2f}°" if np.isfinite(sigma) else ", sigma unknown"
        title += "".join(f"; {flag}" for flag in lights.flags[index])
        parts.append(f"<g><title>{escape(title)}</title>")
        if np.isfinite(covariance[index]).all():
            wide, high, turn = _ellipse(covariance[index], zenith, azimuth)
            parts.append(
                f'<ellipse cx="0" cy="0" rx="{factor * wide:.2f}" ry="{factor * high:.2f}" fill="{colour}" '
                f'fill-opacity="0.25" stroke="{colour}" transform="translate({x:.2f} {y:.2f}) rotate({turn:.2f})"/>'
            )
        parts.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="3" fill="{colour}"/>')
        weight = "bold" if index == chosen else "normal"
        parts.append(_words(str(index + 1), x + 5, y - 5, colour, font_weight=weight) + "</g>")
    return (
        f'<svg viewBox="0 0 {SIZE} {SIZE}" width="100%" style="background:#fff;border-radius:4px" role="img" '
        f'aria-label="Directions of the lights">{"".join(parts)}</svg>'
    )


@dataclass(frozen=True)
class Ellipsoid:
    """Where a light may be: one standard deviation along each of its own axes.

    half_axes_mm (3,).
    rotation (3, 3): Columns are the axes, right-handed.
    """

    half_axes_mm: Array
    rotation: Array


def ellipsoid_of(covariance_mm2: Array) -> Ellipsoid | None:
    """Return the ellipsoid of a covariance (3, 3); None where it is not known."""
    if not np.isfinite(covariance_mm2).all():
        return None
    values, axes = np.linalg.eigh(covariance_mm2)
    if np.linalg.det(axes) < 0:
        axes = axes * [1.0, 1.0, -1.0]
    return Ellipsoid(np.sqrt(np.maximum(values, 0)), axes)


def distant_ellipsoid(direction: Array, sigma_deg: float, distance_mm: float) -> Ellipsoid | None:
    """Return the flat ellipsoid, `distance_mm` away, of a light of which a direction alone is known."""
    if not np.isfinite(sigma_deg):
        return None
    wide = distance_mm * np.tan(np.radians(sigma_deg))
    normal = np.asarray(direction) / np.linalg.norm(direction)
    covariance = wide**2 * (np.eye(3) - np.outer(normal, normal))
    return ellipsoid_of(covariance)


def _tangents(lights: Lights) -> tuple[Array, Array]:
    """Return unit vectors (N, 3) away from the axis and around it, counter-clockwise as the camera sees it."""
    zenith, azimuth = np.radians(directions_deg(lights)).T
    away = np.stack([np.cos(zenith) * np.cos(azimuth), np.cos(zenith) * np.sin(azimuth), -np.sin(zenith)], -1)
    around = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], -1)
    return away, around


def _ellipse(covariance_deg2: Array, zenith_deg: float, azimuth_deg: float) -> tuple[float, float, float]:
    """Return half axes in the picture, and by how many degrees the first is turned, clockwise as SVG has it.

    On the picture a turn around the axis moves a light by its angle from the axis, not by that angle's sine.
    """
    angle = np.radians(zenith_deg)
    stretch = np.diag([1.0, angle / np.sin(angle) if angle > 1e-6 else 1.0]) * RIM / 90
    values, axes = np.linalg.eigh(stretch @ covariance_deg2 @ stretch)
    wide, high = np.sqrt(np.maximum(values[::-1], 0))
    return float(wide), float(high), float(-(azimuth_deg + np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))))


class HemispherePanel:
    """The directions with their sigmas, as seen by the camera."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._picture = gui.add_html("")
        self._factor = gui.add_dropdown("sigma drawn", tuple(f"{factor} times" for factor in FACTORS))
        self._facts = gui.add_markdown("")
        window.on_click(gui.add_button("Show in 3-D"), lambda: window.choose(view="Lights in 3-D"))
        window.on_input(self._factor, lambda value: window.enlarge(int(value.split()[0])))
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
