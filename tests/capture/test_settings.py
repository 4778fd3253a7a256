"""The audit of what is known beside the pixels: gaps in the numbering, settings that differ."""

import numpy as np
import pytest

from capture.audit.camera_settings import gaps_in_numbering, mixed_settings
from capture.camera.exif import Exif
from capture.session.session import load_session


@pytest.fixture
def numbered(picture_session):
    def session(numbers, name="flash_{:03d}", skip=()):
        images = np.zeros((len(numbers), 2, 2, 3))
        folder = picture_session(images, names=[name.format(n) for n in numbers])
        for entry in skip:
            (folder / f"{entry}.png").write_bytes((folder / f"{name.format(numbers[0])}.png").read_bytes())
        listed = ", ".join(f'"{entry}"' for entry in skip)
        (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.png"\nskip = [{listed}]')
        return load_session(folder)

    return session


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        (list(range(12)), None),
        ([14, 15, 17, 18], "flash_016"),
        ([1, 2, 3, 6, 7, 8, 9, 10, 11], "flash_004, flash_005"),
        ([0, 10, 20, 30, 50, 60, 70], "flash_040"),
        ([3, 17, 42, 99], None),
    ],
)
def test_a_missing_number(numbered, numbers, missing):
    warnings = gaps_in_numbering(numbered(numbers))
    if missing is None:
        assert warnings == []
    else:
        assert warnings[0].startswith(f"{missing}: missing from the numbering")


def test_a_skipped_number_is_not_missing(numbered):
    assert gaps_in_numbering(numbered([14, 15, 17, 18], skip=["flash_016"])) == []


def test_mixed_settings_are_named(numbered):
    session = numbered([0, 1, 2, 3])
    usual = Exif(exposure_s=0.01, iso=100, aperture=8.0, focal_mm=50, camera="A")
    assert mixed_settings(session, [usual] * 4, []) == []
    odd = Exif(exposure_s=0.01, iso=200, aperture=5.6, focal_mm=55, camera="B")
    found = mixed_settings(session, [usual, usual, odd, usual], [])
    for part in ("flash_002 (ISO 200)", "flash_002 (aperture f/5.6)", "flash_002 (focal length 55 mm)", "(camera B)"):
        assert any(text.startswith("flash_002") and part in text for text in found)
    (silent,) = mixed_settings(session, [usual, usual, Exif(), usual], [])
    assert silent.startswith("flash_002: no exposure in EXIF")
    assert mixed_settings(session, [Exif()] * 4, []) == []
