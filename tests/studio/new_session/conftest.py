"""A folder of photographs that nobody has described yet, and what a look finds there."""

import cv2
import numpy as np
import pytest

from capture.camera.exif import Exif
from capture.survey.folder_files import survey
from capture.survey.small_pictures import frames_of, read_small
from shoot.init.draft import Draft, DraftBall
from shoot.init.scan_unit import ScanSize
from studio.new_session.found_capture import FoundCapture

BALLS = (
    DraftBall("chrome", (20.0, 15.0), 8.0),
    DraftBall("chrome", (60.0, 15.0), 7.5),
    DraftBall("white", (20.0, 45.0), 7.0),
)
SCAN = ScanSize(1000, (50.0, 40.0, 30.0))


@pytest.fixture
def folder(tmp_path):
    """Photographs of noise, one of another size, and files of every other kind."""
    generator = np.random.default_rng(10_040)
    place = tmp_path / "bench" / "jug"
    place.mkdir(parents=True)
    for name in (*(f"flash_{n}" for n in range(5)), "ambient_0", "odd"):
        shape = (30, 40, 3) if name == "odd" else (60, 80, 3)
        cv2.imwrite(str(place / f"{name}.png"), generator.integers(1000, 60000, shape).astype(np.uint16))
    for name in ("jug.ply", "mask.png", "lights.lp"):
        (place / name).write_bytes(b"as it was")
    return place


@pytest.fixture
def found(folder):
    """What a look finds there, but for the balls, which noise does not show."""
    (files,) = survey(folder)
    flash, ambient = sorted(folder.glob("flash_*")), sorted(folder.glob("ambient_*"))
    small = {one.path: one for one in read_small([*ambient, *flash, folder / "odd.png"], "linear")[0]}
    frames = frames_of([small[path] for path in flash], [small[path] for path in ambient])
    draft = Draft(
        folder, {"flash": flash, "ambient": ambient}, 80, 60, frames, 1, exif=(Exif(),), linear=True, balls=BALLS,
        scan=folder / "jug.ply", scan_size=SCAN, unit="unknown", across_px=30.0, notes=("left out: x.",),
    )  # fmt: skip
    return FoundCapture(files, draft, small, frames.read().mean(0))
