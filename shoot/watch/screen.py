"""What the photographer sees: on a terminal one screen that changes, elsewhere a line for each photograph."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lab.progress import say
from lab.streams import is_quiet
from shoot.watch.shoot import Shoot, Verdict
from shoot.watch.status import write_status

SHOWN = 8
"""Photographs and warnings that a screen shows."""
DOME_ROWS, DOME_COLUMNS = 13, 27
"""Of the small dome; a character is twice as high as wide."""


class Screen:
    """Lines, and the status file that the studio shows.

    Parameters
    ----------
    shoot : Shoot
    out : Path
        Output folder.
    wanted_deg : float
        Sigma of the normals that is good enough.
    """

    def __init__(self, shoot: Shoot, out: Path, wanted_deg: float) -> None:
        self.shoot, self.out, self.wanted_deg = shoot, out, wanted_deg
        self.warnings: list[str] = []
        self._said: list[str] = []

    def verdict(self, verdict: Verdict) -> None:
        """Show what is said of a photograph."""
        say(line_of(verdict))

    def warn(self, text: str) -> None:
        """Show a warning."""
        self.warnings.append(text)
        say(f"warning: {text}", always=True)

    def note(self, text: str) -> None:
        """Show what happened."""
        say(f"  {text}")

    def refresh(self, seconds: float = 0.0) -> None:
        """Show what is known by now; `seconds`: what it took to find out."""
        write_status(self.out, self.shoot, self.warnings, self.wanted_deg)
        lines = state_of(self.shoot, self.wanted_deg)
        if self.shoot.verdicts and (light := self.shoot.light_of(self.shoot.verdicts[-1])):
            lines.insert(1, f"{self.shoot.verdicts[-1].name}: flash at {light_text(light)}")
        # What is as it was need not be said again.
        fresh = [line for line in lines if line not in self._said]
        self._said = lines
        if fresh:
            say("\n".join(f"  {line}" for line in fresh) + (f" ({seconds:.1f} s)" if seconds >= 0.1 else ""))


class LiveScreen(Screen):
    """A screen that is drawn anew."""

    def __init__(self, shoot: Shoot, out: Path, wanted_deg: float, live: Any) -> None:
        super().__init__(shoot, out, wanted_deg)
        self._live = live

    def verdict(self, verdict: Verdict) -> None:
        self._draw()

    def warn(self, text: str) -> None:
        from rich.text import Text

        self.warnings.append(text)
        # Above the screen: a warning stays, whatever comes after it.
        self._live.console.print(Text("warning ", style="bold red") + Text(text))
        self._draw()

    def note(self, text: str) -> None:
        from rich.text import Text

        self._live.console.print(Text(text, style="dim"))

    def refresh(self, seconds: float = 0.0) -> None:
        write_status(self.out, self.shoot, self.warnings, self.wanted_deg)
        self._draw()

    def _draw(self) -> None:
        self._live.update(_screen(self.shoot, self.wanted_deg), refresh=True)


@contextmanager
def screen_for(shoot: Shoot, out: Path, wanted_deg: float) -> Iterator[Screen]:
    """Yield the screen for where standard error goes."""
    if is_quiet() or not sys.stderr.isatty():
        yield Screen(shoot, out, wanted_deg)
        return
    from rich.console import Console
    from rich.live import Live

    with Live(_screen(shoot, wanted_deg), console=Console(stderr=True), auto_refresh=False) as live:
        yield LiveScreen(shoot, out, wanted_deg, live)


def line_of(verdict: Verdict) -> str:
    """Return a verdict as a line."""
    warned = f", {len(verdict.warnings)} warning{'s' * (len(verdict.warnings) != 1)}" if verdict.warnings else ""
    return f"{verdict.name}: {verdict.role}{warned} ({verdict.seconds:.1f} s)"


def light_text(light: dict[str, Any]) -> str:
    """Return where a flash stands, in words; `light`: its row of `Lights.facts`."""
    away = f", {light['distance_mm']:.0f} mm away" if light["distance_mm"] is not None else ""
    sigma = light["direction_sigma_deg"]
    known = "" if sigma is None else f" (to {sigma:.2g})"
    return f"{light['zenith_deg']:.0f} degrees from the axis{known}, {side_of(light['azimuth_deg'])}{away}"


def state_of(shoot: Shoot, wanted_deg: float) -> list[str]:
    """Return what is known by now, in lines."""
    lights, known = shoot.lights, shoot.known
    count = len(shoot.sorted.flash)
    lines = [f"{count} flash frame{'s' * (count != 1)}, {len(shoot.sorted.ambient)} ambient"]
    if lights is None:
        lines.append("lights: not known yet; balls are looked for from the 4th flash frame on")
        return lines
    lines.append(f"lights: {lights!r}")
    if known is None:
        lines.append(f"normals: not known yet ({shoot.why_no_normals})")
        return lines
    lines.append(
        f"normals: sigma {known.median_deg:.2g} degrees (median), {known.share_under(wanted_deg):.0%} of the object "
        f"under {wanted_deg:g}"
    )
    lines.append(_next(shoot, wanted_deg))
    return lines


def _next(shoot: Shoot, wanted_deg: float) -> str:
    assert shoot.known is not None
    following = shoot.known.next_flash
    if following.before_deg <= wanted_deg:
        return f"enough: the median sigma is under {wanted_deg:g} degrees"
    away = "" if following.distance_mm is None else f", {following.distance_mm:.0f} mm away"
    return (
        f"next flash: {following.zenith_deg:.0f} degrees from the axis, {following.azimuth_deg:.0f} around "
        f"({side_of(following.azimuth_deg)}){away}: sigma to {following.sigma_deg:.2g} degrees"
    )


def side_of(azimuth_deg: float) -> str:
    """Return where a flash stands as the camera sees it."""
    sides = ("right", "above right", "above", "above left", "left", "below left", "below", "below right")
    return sides[round(azimuth_deg / 45) % 8]


def dome(shoot: Shoot, rows: int = DOME_ROWS, columns: int = DOME_COLUMNS) -> list[str]:
    """Return the lights so far as the camera sees them, the axis in the middle, 90 degrees at the rim; x: the next."""
    from math import cos, radians, sin

    grid = [[" "] * columns for _ in range(rows)]

    def put(zenith: float, azimuth: float, mark: str) -> None:
        # Equal angles are equal distances.
        right, up = zenith / 90 * cos(radians(azimuth)), zenith / 90 * sin(radians(azimuth))
        grid[round((1 - up) / 2 * (rows - 1))][round((1 + right) / 2 * (columns - 1))] = mark

    for azimuth in range(0, 360, 6):
        put(90, azimuth, ".")
    put(0, 0, "+")
    if shoot.known is not None:
        put(shoot.known.next_flash.zenith_deg, shoot.known.next_flash.azimuth_deg, "x")
    for row in shoot.lights.facts()["frames"] if shoot.lights else []:
        if row["zenith_deg"] is not None:
            put(min(row["zenith_deg"], 90), row["azimuth_deg"], "o")
    return ["".join(line).rstrip() for line in grid]


def _screen(shoot: Shoot, wanted_deg: float) -> Any:
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, expand=False, padding=(0, 2, 0, 0))
    for title in ("photograph", "role", "from axis", "side", "mm away", "sigma", "seconds"):
        table.add_column(title, justify="left" if title in ("photograph", "role", "side") else "right", no_wrap=True)
    for verdict in shoot.verdicts[-SHOWN:]:
        light = shoot.light_of(verdict)
        cells = (verdict.name, verdict.role, *(_cells(light) if light else [""] * 4), f"{verdict.seconds:.1f}")
        table.add_row(*(Text(cell, style="red" if verdict.warnings else "") for cell in cells))
    sides = Table(box=None, show_header=False, padding=(0, 3, 0, 0))
    sides.add_row(Text("\n".join(dome(shoot)), style="cyan"), table)
    return Group(sides, Text("\n".join(state_of(shoot, wanted_deg)), style="bold"))


def _cells(light: dict[str, Any]) -> list[str]:
    """Return where a flash stands, for a table."""
    away, sigma = light["distance_mm"], light["direction_sigma_deg"]
    return [
        f"{light['zenith_deg']:.0f}°",
        side_of(light["azimuth_deg"]),
        "" if away is None else f"{away:.0f}",
        "" if sigma is None else f"{sigma:.2g}°",
    ]
