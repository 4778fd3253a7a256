"""Lights: where they stand, how bright they are, how well that is known. Each takes `scene.lights.Lights.facts`."""

from math import ceil, cos, radians, sin, sqrt
from typing import Any

from draw.readable import Readable, readable
from draw.svg import COLOURS, EDGE, Axes, Axis, Drawing, circle, svg, text

CHANNELS = {"red": "#D55E00", "green": "#009E73", "blue": "#0072B2"}
SIZE, RIM = 360, 150.0
"""Of the hemisphere's drawing, and the radius at which its rim is drawn, pixels."""


def directions(lights: dict[str, Any]) -> Drawing:
    """Return the lights on the hemisphere, as the camera sees it: centre = camera's axis, rim = 90 degrees or more."""
    rows, middle = lights["frames"], SIZE / 2
    rim_deg = max(90.0, 10.0 * ceil((lights.get("zenith_max_deg") or 0) / 10))
    parts, aside = [], sqrt(0.5)
    for angle in (30.0, 60.0, rim_deg):
        radius = RIM * angle / rim_deg
        parts.append(circle(middle, middle, radius, "none", stroke=EDGE))
        parts.append(text(middle + aside * radius + 3, middle + aside * radius - 3, f"{angle:g}°", "start", 11))
    parts += [text(SIZE - 12, middle, "+x", size=11), text(middle, 14, "up (+y)", size=11)]
    for number, row in enumerate(rows, 1):
        azimuth, radius = radians(row["azimuth_deg"]), RIM * row["zenith_deg"] / rim_deg
        u, v = middle + radius * cos(azimuth), middle - radius * sin(azimuth)
        told = Readable().format("{name}: {zenith_deg:1°} from the camera's axis, azimuth {azimuth_deg:1°}", **row)
        parts.append(circle(u, v, 6, COLOURS[5], told, stroke="#333"))
        # The numbers of more lights would lie on each other.
        parts.append(text(u, v - 9, str(number), size=12) if len(rows) <= 30 else "")
    return svg(SIZE, SIZE, parts, label="Directions of the lights as the camera sees them")


def intensities(lights: dict[str, Any]) -> Drawing:
    """Return each light's intensity, channel by channel, with its sigma as a bar."""
    marks = []
    for number, row in enumerate(lights["frames"], 1):
        for channel, (name, colour) in enumerate(CHANNELS.items()):
            value, sigma = row["intensity"][channel], (row["intensity_sigma"] or 0.0) * row["intensity"][channel]
            told = f"{row['name']}, {name}: {readable(value, 3)} ± {readable(sigma, 3)}"
            marks.append((number + 0.18 * (channel - 1), value, sigma, colour, told))
    return _over_lights(marks, len(lights["frames"]), "Relative intensity of each light", "intensity (mean = 1)")


def sigmas(lights: dict[str, Any]) -> Drawing:
    """Return the standard deviation of each light's direction."""
    known = [(k, row) for k, row in enumerate(lights["frames"], 1) if row["direction_sigma_deg"] is not None]
    found = ((float(k), row["name"], row["direction_sigma_deg"]) for k, row in known)
    marks = [(k, sigma, 0.0, COLOURS[0], f"{name}: {readable(sigma, 3)}°") for k, name, sigma in found]
    label = "Standard deviation of each light's direction, degrees"
    return _over_lights(marks, len(lights["frames"]), label, "direction sigma (°)")


def _over_lights(marks: list[tuple[float, float, float, str, str]], count: int, label: str, y_title: str) -> Drawing:
    """Return a dot a mark (light, value, sigma, colour, words), and the sigma as a bar."""
    ticks = [(float(k), str(k)) for k in range(1, count + 1, ceil(count / 16) or 1)]
    x = Axis(0.4, count + 0.6, 62, 440, False, ticks)
    y = Axis.over([[0.0, *(value + sigma for _, value, sigma, *_ in marks)]], 190, 12, log=False)
    on = Axes(x, y)
    parts = on.drawn("light", y_title)
    for at, value, sigma, colour, told in marks:
        if sigma:
            parts.append(on.line([(at, value - sigma), (at, value + sigma)], colour, told))
        parts.append(circle(x.at(at), y.at(value), 3.5, colour, told))
    return svg(450, 240, parts, label=label)
