"""A folder of photographs that nobody has described yet, and what a look finds there."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from capture.camera.exif import Exif
from capture.session.manifest import FramesTable, Manifest, SphereTable
from capture.survey.small_pictures import frames_of, read_small
from shoot.init.draft import Draft, ScanSize

BALLS = tuple(
    SphereTable(kind=kind, center_px=[u, v], radius_px=radius)
    for kind, u, v, radius in (("chrome", 20.0, 15.0, 8.0), ("chrome", 60.0, 15.0, 7.5), ("white", 20.0, 45.0, 7.0))
)


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
def found(folder, monkeypatch):
    """What a look finds there, but for the balls, which noise does not show."""
    monkeypatch.setattr("shoot.init.draft.read_scan", lambda path: ScanSize(1000, (50.0, 40.0, 30.0)))
    flash, ambient = sorted(folder.glob("flash_*")), sorted(folder.glob("ambient_*"))
    small = {one.path: one for one in read_small([*ambient, *flash, folder / "odd.png"], "linear")[0]}
    frames = frames_of([small[path] for path in flash], [small[path] for path in ambient])
    manifest = Manifest(frames=FramesTable(flash=["flash_*.png"], ambient=["ambient_0.png"], linear=True))
    draft = Draft(manifest, folder, 80, 60, frames, 1, exif=(Exif(),), found=BALLS, across_px=30.0,
                  notes=("left out: x.",))  # fmt: skip
    draft = draft.with_balls(BALLS).saying("object", scan="jug.ply")
    return SimpleNamespace(draft=draft, small=small)
