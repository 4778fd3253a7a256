"""The state of a shoot as a file, and its sigma map as a picture: what the studio shows while it goes on."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_json, write_png
from scene.output_folder import record_for
from shoot.watch.shoot import Shoot

STATUS, MAP = "watch.json", "watch-sigma.png"
WORK = "watch"
"""Of the record: what a watch writes beside its session."""


def write_status(out: Path, shoot: Shoot, warnings: list[str], wanted_deg: float, *, is_over: bool = False) -> None:
    """Write watch.json, and watch-sigma.png where the normals are known."""
    record = record_for(out / STATUS)
    assert record is not None
    with record.part_of(WORK):
        if shoot.known is not None:
            write_png(out / MAP, sigma_picture(shoot.known.sigma_deg, wanted_deg))
        write_json(out / STATUS, {"is_over": is_over, **status_of(shoot, warnings, wanted_deg)})


def status_of(shoot: Shoot, warnings: list[str], wanted_deg: float) -> dict[str, Any]:
    """Return the state of a shoot as plain values."""
    known = shoot.known
    return {
        "folder": shoot.folder,
        "flash": len(shoot.sorted.flash),
        "ambient": len(shoot.sorted.ambient),
        "photographs": [
            {"name": one.name, "role": one.role, "warnings": one.warnings, "seconds": one.seconds}
            for one in shoot.verdicts
        ],
        "warnings": warnings,
        "lights": shoot.lights.facts() if shoot.lights else None,
        "normals": None
        if known is None
        else {
            "sigma_deg_median": known.median_deg,
            "wanted_deg": wanted_deg,
            "share_under_wanted": known.share_under(wanted_deg),
            "next_flash": known.next_flash,
        },
    }


def sigma_picture(sigma_deg: NDArray[np.float64], wanted_deg: float) -> NDArray[np.uint8]:
    """Return the map (h, w, 3): green where sigma is half of what is wanted, red where it is twice that."""
    share = np.clip(np.log2(np.maximum(sigma_deg, 1e-6) / wanted_deg) / 2 + 0.5, 0, 1)
    picture = np.full((*sigma_deg.shape, 3), 40.0)
    inside = np.isfinite(sigma_deg)
    picture[inside] = np.stack([220 * share, 180 * (1 - share), np.full_like(share, 60)], -1)[inside]
    return picture.round().astype(np.uint8)
