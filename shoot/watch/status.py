"""The state of a shoot: in words, and as a file and a picture of sigma that the studio shows while it goes on."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from compare.report.pictures import error_picture, with_colour_scale
from lab.progress import say
from scene.files import write_json, write_png
from scene.output_folder import record_for
from shoot.plan.run_plan import clock
from shoot.watch.shoot import Shoot

STATUS, MAP = "watch.json", "watch-sigma.png"


class Screen:
    """What the photographer and the studio see.

    Parameters
    ----------
    shoot : Shoot
    out : Path
        Output folder.
    wanted_deg : float
        Sigma of the normals that is good enough.
    """

    def __init__(self, shoot: Shoot, out: Path, wanted_deg: float) -> None:
        self._shoot, self._out, self._wanted_deg = shoot, out, wanted_deg
        self._warnings: list[str] = []
        self._said: list[str] = []

    def note(self, text: str) -> None:
        """Say what happened."""
        say(f"  {text}")

    def warn(self, text: str) -> None:
        """Say a warning, with the terminal's bell."""
        self._warnings.append(text)
        bell = "\a" if sys.stderr.isatty() else ""
        say(f"{bell}warning: {text}", always=True)

    def renew(self, *, is_over: bool = False) -> None:
        """Say what is known by now, and write watch.json, and watch-sigma.png where the normals are known."""
        shoot, record, known = self._shoot, record_for(self._out / STATUS), None
        assert record is not None
        with record.part_of("watch"):
            if shoot.sigma_deg is not None:
                sigma = shoot.sigma_deg[np.isfinite(shoot.sigma_deg)]
                known = {
                    "sigma_deg_median": float(np.median(sigma)),
                    "wanted_deg": self._wanted_deg,
                    "share_under_wanted": float(np.mean(sigma < self._wanted_deg)),
                    "next_flash": shoot.next_flash,
                }
                end = 2 * self._wanted_deg
                scaled = with_colour_scale(error_picture(shoot.sigma_deg, end), end, "sigma of the normals")
                write_png(self._out / MAP, scaled)
            lights, ambient = shoot.lights.facts() if shoot.lights else None, len(shoot.roles["ambient"])
            status = {"flash": len(shoot.flash), "ambient": ambient, "warnings": self._warnings}
            write_json(self._out / STATUS, {"is_over": is_over, **status, "lights": lights, "normals": known})
        lines = state_lines(shoot, known)
        # What is as it was need not be said again.
        for line in [] if is_over else [line for line in lines if line not in self._said]:
            self.note(line)
        self._said = lines


def state_lines(shoot: Shoot, known: dict[str, Any] | None) -> list[str]:
    """Return what is known by now, in lines; `known`: `normals` of watch.json."""
    count = len(shoot.flash)
    lines = [f"{count} flash frame{'s' * (count != 1)}, {len(shoot.roles['ambient'])} ambient"]
    light = shoot.light_of(shoot.newest) if shoot.newest else None
    lines += [f"{shoot.newest.name}: flash at {place_text(light)}"] if shoot.newest and light else []
    if shoot.lights is None:
        return [*lines, f"lights: not known yet; {shoot.why}"]
    lines.append(f"lights: {shoot.lights!r}")
    if known is None:
        return [*lines, f"normals: not known yet; {shoot.why}"]
    sigma, wanted, following = known["sigma_deg_median"], known["wanted_deg"], known["next_flash"]
    lines.append(
        f"normals: sigma {sigma:.2g} degrees (median), {known['share_under_wanted']:.0%} of the object under {wanted:g}"
    )
    if sigma <= wanted:
        return [*lines, f"enough: the median sigma is under {wanted:g} degrees"]
    return [*lines, f"next flash: {place_text(following)}: sigma to {following['sigma_deg']:.2g} degrees"]


def place_text(light: dict[str, Any]) -> str:
    """Return where a flash stands, in words; `light`: a row of `Lights.facts`."""
    away = f", {light['distance_mm']:.0f} mm away" if light["distance_mm"] is not None else ""
    sigma = light.get("direction_sigma_deg")
    known = "" if sigma is None else f" (to {sigma:.2g})"
    return f"{light['zenith_deg']:.0f} degrees from the axis{known} at {clock(light['azimuth_deg'])} o'clock{away}"
